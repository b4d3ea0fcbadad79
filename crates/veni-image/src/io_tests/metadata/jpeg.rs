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
    ("JPEG", "picture data that end early, also a gain map's", early),
    ("JPEG", "arithmetic, lossless, hierarchical coding, 12 bits, JPEG-LS", coding),
    ("JPEG", "sampling factors", sampling),
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
    let error = Panorama::read(file.path()).unwrap_err().to_string();
    assert!(error.contains("no high dynamic range (has a gain map of Apple's kind"), "{error}");
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

/// A JPEG of 8 × 8 in four components, baseline, each of one value (T.81): quantisation by 1, four bits for each category of a
/// DC difference, one for the end of a block.
fn four_components(values: [u8; 4]) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0xD8];
    bytes.extend(segment(0xEE, b"Adobe\0\x64\0\0\0\0\0"));
    bytes.extend(segment(0xDB, &[&[0][..], &[1; 64]].concat()));
    let components: Vec<u8> = (1..=4).flat_map(|c| [c, 0x11, 0]).collect();
    bytes.extend(segment(0xC0, &[&[8, 0, 8, 0, 8, 4][..], &components].concat()));
    let counts = |length: usize, count: u8| (1..=16).map(move |l| if l == length { count } else { 0 });
    bytes.extend(segment(0xC4, &[vec![0], counts(4, 12).collect(), (0..12).collect()].concat()));
    bytes.extend(segment(0xC4, &[vec![0x10], counts(1, 1).collect(), vec![0]].concat()));
    let scan: Vec<u8> = (1..=4).flat_map(|c| [c, 0]).collect();
    bytes.extend(segment(0xDA, &[&[4][..], &scan, &[0, 63, 0]].concat()));
    let mut bits = String::new();
    for value in values {
        let coefficient = 8 * (i32::from(value) - 128);
        let size = 32 - coefficient.unsigned_abs().leading_zeros();
        bits += &format!("{size:04b}");
        if size > 0 {
            let code = if coefficient > 0 { coefficient } else { coefficient + (1 << size) - 1 };
            bits += &format!("{code:0width$b}", width = size as usize);
        }
        bits.push('0');
    }
    while !bits.len().is_multiple_of(8) {
        bits.push('1');
    }
    for byte in bits.as_bytes().chunks(8) {
        let byte = byte.iter().fold(0, |b, bit| b << 1 | (bit - b'0'));
        bytes.push(byte);
        bytes.extend((byte == 0xFF).then_some(0));
    }
    bytes.extend([0xFF, 0xD9]);
    bytes
}

/// As Adobe's programs store it, ink is 255 − value: red, green and blue are value × black / 255.
#[test]
fn cmyk_is_converted_by_the_plain_formula() {
    for (stored, expected) in [([200, 100, 50, 255], [200, 100, 50]), ([200, 100, 50, 128], [100, 50, 25])] {
        let file = File::new(&four_components(stored));
        let Content::Display(ldr) = file.content().unwrap() else { panic!("display values") };
        for (found, expected) in ldr.values()[9].iter().zip(expected) {
            assert!((255.0 * found - expected as f32).abs() < 2.5, "{stored:?}: {:?}", ldr.values()[9]);
        }
    }
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

/// What an end marker behind half of the data hides, in the picture and in its gain map.
fn early() {
    let ended = |bytes: &[u8], cut: usize| File::new(&[&bytes[..cut], &[0xFF, 0xD9]].concat());
    let first = jpeg(&base(), &[xmp(HDRGM, "hdrgm", "hdrgm:Version='1.0'")]);
    let second = jpeg(&map(), &[xmp(HDRGM, "hdrgm", "hdrgm:GainMapMax='3'")]);
    let error = ended(&first, first.len() - 5).error();
    assert!(error.contains("truncated JPEG file") && error.contains("of 2 blocks"), "{error}");
    let both = [first, second].concat();
    let error = ended(&both, both.len() - 5).error();
    assert!(error.contains("its gain map") && error.contains("of 1 blocks"), "{error}");
    // to those who ask for radiance alone too
    let error = Panorama::read(ended(&both, both.len() - 5).path()).unwrap_err().to_string();
    assert!(error.contains("its gain map"), "{error}");
}

/// A frame header of components with these factors, and nothing behind it.
fn frame(marker: u8, bits: u8, factors: &[u8]) -> File {
    let components: Vec<u8> = (1..).zip(factors).flat_map(|(id, factor)| [id, *factor, 0]).collect();
    let head = [bits, 0, 8, 0, 16, factors.len() as u8];
    File::new(
        &[&[0xFF, 0xD8][..], &segment(marker, &[&head[..], &components].concat()), &[0xFF, 0xD9]].concat(),
    )
}

fn coding() {
    for (marker, bits, word) in [
        (0xC9, 8, "arithmetically"),
        (0xCA, 8, "arithmetically"),
        (0xC3, 16, "without loss"),
        (0xC1, 12, "12 bits"),
        (0xC5, 8, "hierarchy"),
        (0xF7, 8, "JPEG-LS"),
    ] {
        let error = frame(marker, bits, &[0x11]).error();
        assert!(error.contains(word) && !error.contains("damaged"), "{error}");
    }
}

fn sampling() {
    for (factors, words) in [
        (&[0x11, 0x21, 0x21][..], "1x1, 2x1, 2x1"),
        (&[0x31, 0x11, 0x11], "3x1, 1x1, 1x1"),
        (&[0x22, 0x11, 0x41], "2x2, 1x1, 4x1"),
        (&[0x14, 0x12, 0x12], "1x4, 1x2, 1x2"),
    ] {
        let error = frame(0xC0, 8, factors).error();
        assert!(error.contains(words) && !error.contains("damaged"), "{error}");
    }
    for read in [&[0x11][..], &[0x22], &[0x22, 0x11, 0x11], &[0x11, 0x12, 0x12], &[0x22, 0x21, 0x12]] {
        let error = frame(0xC0, 8, read).error();
        assert!(!error.contains("sampling"), "{error}");
    }
}
