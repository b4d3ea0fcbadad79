//! JPEG: gain maps and CMYK.

use image::{DynamicImage, ImageBuffer, Luma, Rgb};

use super::super::super::*;
use super::Case;
use super::files::{File, jpeg, segment, xmp};
use crate::tonemap::srgb_to_linear;

pub(super) const CASES: &[Case] = &[
    ("JPEG", "gain map (hdrgm)", gain_map),
    ("JPEG", "gain map without hdrgm values (Apple, ISO 21496-1)", foreign),
    ("JPEG", "gain map to limited range (BaseRenditionIsHDR)", backwards),
    ("JPEG", "CMYK profile", cmyk),
];

const HDRGM: &str = "http://ns.adobe.com/hdr-gain-map/1.0/";

fn base() -> DynamicImage {
    DynamicImage::ImageRgb8(ImageBuffer::from_pixel(16, 8, Rgb([188; 3])))
}

/// The left half 0, the right half 255.
fn map() -> DynamicImage {
    DynamicImage::ImageLuma8(ImageBuffer::from_fn(8, 4, |x, _| Luma([if x < 4 { 0 } else { 255 }])))
}

fn with(properties: &str) -> File {
    let first = jpeg(&base(), &[xmp(HDRGM, "hdrgm", "hdrgm:Version='1.0'")]);
    let second = jpeg(&map(), &[xmp(HDRGM, "hdrgm", properties)]);
    File::new(&[first, second].concat())
}

fn gain_map() {
    let file = with("hdrgm:GainMapMin='-1' hdrgm:GainMapMax='3' hdrgm:OffsetSDR='0' hdrgm:OffsetHDR='0'");
    let Content::Radiance(panorama) = file.content().unwrap() else { panic!("radiance") };
    let light = srgb_to_linear(188.0 / 255.0);
    let [left, right] = [panorama.pixel(1, 4)[1], panorama.pixel(14, 4)[1]];
    assert!((left / light - 0.5).abs() < 0.02 && (right / light - 8.0).abs() < 0.2, "{left} {right}");
    assert!(panorama.notes().join(" ").contains("3.0 stops"));
    // offsets: (L + 0.1) 2³ − 0.2; exponent: white stays white
    let file = with("hdrgm:GainMapMax='3' hdrgm:Gamma='2' hdrgm:OffsetSDR='0.1' hdrgm:OffsetHDR='0.2'");
    let Content::Radiance(panorama) = file.content().unwrap() else { panic!("radiance") };
    let right = panorama.pixel(14, 4)[1];
    assert!((right - ((light + 0.1) * 8.0 - 0.2)).abs() < 0.1, "{right}");
    // the first picture alone, for those who want display values
    let ldr = LdrPanorama::read(file.path()).unwrap();
    assert!((ldr.values()[0][0] - 188.0 / 255.0).abs() < 0.01);
    let error = with("hdrgm:GainMapMax='-3' hdrgm:Gamma='1'").error();
    assert!(error.contains("implausible"), "{error}");
    let whole = std::fs::read(with("hdrgm:GainMapMax='3'").path()).unwrap();
    assert!(File::new(&whole[..whole.len() - 40]).error().contains("gain map"));
}

fn foreign() {
    let announced = File::new(&jpeg(&base(), &[xmp(HDRGM, "hdrgm", "hdrgm:Version='1.0'")]));
    assert!(announced.notes().contains("gain map"), "{}", announced.notes());
    let apple =
        xmp("http://ns.apple.com/HDRGainMap/1.0/", "HDRGainMap", "HDRGainMap:HDRGainMapVersion='65536'");
    let multiple = segment(0xE2, b"MPF\0");
    let file = File::new(&[jpeg(&base(), &[multiple]), jpeg(&map(), &[apple])].concat());
    assert!(file.notes().contains("Apple"), "{}", file.notes());
    let iso = segment(0xE2, b"urn:iso:std:iso:ts:21496:-1\0\0\0\0\0");
    let file = File::new(&[jpeg(&base(), std::slice::from_ref(&iso)), jpeg(&map(), &[iso])].concat());
    assert!(file.notes().contains("21496"), "{}", file.notes());
    assert_eq!(File::new(&jpeg(&base(), &[])).notes(), "");
}

fn backwards() {
    assert!(
        with("hdrgm:GainMapMax='3' hdrgm:BaseRenditionIsHDR='True'").error().contains("BaseRenditionIsHDR")
    );
}

/// The header of a profile for CMYK, without tags.
fn cmyk() {
    let mut profile = vec![0; 132];
    profile[3] = 132;
    profile[8..12].copy_from_slice(&[4, 0, 0, 0]);
    profile[12..24].copy_from_slice(b"prtrCMYKLab ");
    profile[36..40].copy_from_slice(b"acsp");
    let file =
        File::new(&jpeg(&base(), &[segment(0xE2, &[b"ICC_PROFILE\0\x01\x01", profile.as_slice()].concat())]));
    assert!(file.notes().contains("CMYK"), "{}", file.notes());
}
