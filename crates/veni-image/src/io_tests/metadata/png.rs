//! PNG: what stands behind the pixels, in text, twice, or with a wrong checksum.

use image::{DynamicImage, ImageBuffer, Rgb};

use super::super::super::*;
use super::Case;
use super::files::{chunk, close, exif, hundred_thousandths, packet, plain, png_around, png_icc};
use crate::tonemap::srgb_to_linear;

pub(super) const CASES: &[Case] = &[
    ("PNG", "eXIf, XMP behind the pixels", behind),
    ("PNG", "text \"Raw profile type exif\" (APP1, xmp)", digits),
    ("PNG", "chunk with a wrong checksum", checksum),
    ("PNG", "second gAMA (cHRM, cICP, sRGB, iCCP, eXIf)", twice),
    ("PNG", "gAMA, cHRM of zeros", zeros),
];

const COLOUR: [f32; 3] = [0.6, 0.3, 0.45];
const XMP: &[u8] = b"XML:com.adobe.xmp\0\0\0\0\0";

/// 6 × 4, no two pixels alike.
fn picture() -> DynamicImage {
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(6, 4, |x, y| Rgb([(x * 40) as u8, (y * 60) as u8, 9])))
}

fn upside_down(file: &super::files::File) -> bool {
    let upright = png_around(&picture(), &[], &[]).linear().0;
    let found = file.linear().0;
    assert!(found == upright || found.iter().rev().eq(&upright), "neither way round");
    found != upright
}

/// The left half of a panorama.
fn half() -> String {
    let sizes = "G:FullPanoWidthPixels='12' G:FullPanoHeightPixels='4' G:CroppedAreaImageWidthPixels='6' \
        G:CroppedAreaImageHeightPixels='4' G:CroppedAreaLeftPixels='0' G:CroppedAreaTopPixels='0'";
    packet("http://ns.google.com/photos/1.0/panorama/", "G", sizes)
}

fn is_half(file: &super::files::File) -> bool {
    let Content::Display(ldr) = file.content().unwrap() else { panic!("display values") };
    (ldr.grid().width, ldr.unknown()) == (12, 0.5)
}

fn behind() {
    let turned = chunk(b"eXIf", &exif(3, 1, b"R98\0"));
    assert!(upside_down(&png_around(&picture(), &[], std::slice::from_ref(&turned))));
    let text = chunk(b"iTXt", &[XMP, half().as_bytes()].concat());
    assert!(is_half(&png_around(&picture(), &[], std::slice::from_ref(&text))));
    // colours there come too late
    let late = png_around(&plain(COLOUR), &[], &[chunk(b"gAMA", &hundred_thousandths(&[1.0]))]);
    close(late.first(), COLOUR.map(srgb_to_linear));
    // cut within it
    let mut cut = std::fs::read(png_around(&picture(), &[], &[text]).path()).unwrap();
    cut.truncate(cut.len() - 40);
    assert!(super::files::File::new(&cut).error().contains("truncated PNG file"));
}

/// As ImageMagick writes a profile: its name, its length, 36 bytes a line.
fn raw(kind: &str, content: &[u8]) -> Vec<u8> {
    let lines =
        content.chunks(36).map(|line| line.iter().map(|b| format!("{b:02x}")).collect::<String>() + "\n");
    format!("\n{kind}\n{:8}\n{}", content.len(), lines.collect::<String>()).into_bytes()
}

fn digits() {
    let turned = [b"Exif\0\0".as_slice(), &exif(3, 1, b"R98\0")].concat();
    let packed = |text: &[u8]| miniz_oxide::deflate::compress_to_vec_zlib(text, 6);
    let with =
        |name: &[u8; 4], parts: [&[u8]; 3]| png_around(&picture(), &[chunk(name, &parts.concat())], &[]);
    let (exif_text, xmp_text) = (raw("exif", &turned), raw("xmp", half().as_bytes()));
    assert!(upside_down(&with(b"tEXt", [b"Raw profile type exif", b"\0", &exif_text])));
    assert!(upside_down(&with(b"zTXt", [b"Raw profile type exif", b"\0\0", &packed(&exif_text)])));
    assert!(upside_down(&with(b"zTXt", [b"Raw profile type APP1", b"\0\0", &packed(&raw("app1", &turned))])));
    assert!(is_half(&with(b"zTXt", [b"Raw profile type xmp", b"\0\0", &packed(&xmp_text)])));
    let app1 = raw("app1", &[b"http://ns.adobe.com/xap/1.0/\0", half().as_bytes()].concat());
    assert!(is_half(&with(b"tEXt", [b"Raw profile type APP1", b"\0", &app1])));
    // an eXIf chunk goes before them
    let text = chunk(b"tEXt", &[b"Raw profile type exif\0", exif_text.as_slice()].concat());
    let upright = chunk(b"eXIf", &exif(1, 1, b"R98\0"));
    assert!(!upside_down(&png_around(&picture(), &[text], &[upright])));
    let damaged = with(b"zTXt", [b"Raw profile type xmp", b"\0\0", b"no zlib"]);
    assert!(damaged.notes().contains("Raw profile type xmp"), "{}", damaged.notes());
    let short = with(b"tEXt", [b"Raw profile type exif", b"\0", &exif_text[..60]]);
    assert!(!upside_down(&short) && short.notes().contains("exif"), "{}", short.notes());
}

fn checksum() {
    let wrong = |name: &[u8; 4], content: &[u8]| {
        let mut chunk = chunk(name, content);
        *chunk.last_mut().unwrap() ^= 1;
        chunk
    };
    let p3 = hundred_thousandths(&[0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060]);
    let gamma = hundred_thousandths(&[1.0]);
    let tags: [(&[u8; 4], &[u8]); 6] = [
        (b"gAMA", &gamma),
        (b"cHRM", &p3),
        (b"cICP", &[1, 8, 0, 1]),
        (b"cICP", &[1, 8, 0]),
        (b"iCCP", b"P3\0\0no zlib"),
        (b"eXIf", &exif(3, 2, b"R98\0")),
    ];
    for (name, content) in tags {
        let file = png_around(&plain(COLOUR), &[wrong(name, content)], &[]);
        close(file.first(), COLOUR.map(srgb_to_linear));
        let name = String::from_utf8_lossy(name);
        assert!(file.notes().contains(&*name) && file.notes().contains("checksum"), "{}", file.notes());
    }
    let file = png_around(&plain(COLOUR), &[wrong(b"sRGB", &[0]), chunk(b"gAMA", &gamma)], &[]);
    close(file.first(), COLOUR);
    let text = wrong(b"iTXt", &[XMP, half().as_bytes()].concat());
    let file = png_around(&picture(), &[text], &[]);
    assert!(!is_half(&file) && file.notes().contains("iTXt"), "{}", file.notes());
    // words for people are not looked at
    assert_eq!(png_around(&picture(), &[wrong(b"tEXt", b"Title\0sky")], &[]).notes(), "");
    // the profile behind a damaged one counts
    let profile = moxcms::ColorProfile::new_gray_with_gamma(1.8).encode().unwrap();
    let bytes = std::fs::read(png_icc([0.5; 3], &profile, &[]).path()).unwrap();
    let bytes = [&bytes[..33], &wrong(b"iCCP", b"P3\0\0no zlib"), &bytes[33..]].concat();
    close(super::files::File::new(&bytes).first(), [0.5f32.powf(1.8); 3]);
}

fn twice() {
    let gamma = |value: f64| chunk(b"gAMA", &hundred_thousandths(&[value]));
    let file = png_around(&plain(COLOUR), &[gamma(0.45455), gamma(1.0)], &[]);
    close(file.first(), COLOUR.map(srgb_to_linear));
    assert!(file.notes().contains("second gAMA"), "{}", file.notes());
    let cicp = |transfer: u8| chunk(b"cICP", &[1, transfer, 0, 1]);
    close(png_around(&plain(COLOUR), &[cicp(8), cicp(13)], &[]).first(), COLOUR);
    let turned = |code: u8| chunk(b"eXIf", &exif(code, 1, b"R98\0"));
    assert!(upside_down(&png_around(&picture(), &[turned(3)], &[turned(1)])));
}

fn zeros() {
    for name in [b"gAMA", b"cHRM"] {
        let file = png_around(&plain(COLOUR), &[chunk(name, &[0; 32])], &[]);
        close(file.first(), COLOUR.map(srgb_to_linear));
        assert!(file.notes().contains(&*String::from_utf8_lossy(name)), "{}", file.notes());
    }
}
