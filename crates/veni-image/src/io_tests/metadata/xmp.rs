//! XMP in every format: odd bytes, other encodings, several packets, packets over several segments; and EXIF that stands twice.

use image::{DynamicImage, ImageBuffer, Luma, Rgb};

use super::super::super::*;
use super::Case;
use super::files::{File, chunk, exif, jpeg, packet, png_around, segment, webp, xmp_segment};
use crate::tonemap::srgb_to_linear;

pub(super) const CASES: &[Case] = &[
    ("PNG, JPEG, WebP", "XMP in UTF-16 or UTF-32, or with wrong bytes", encodings),
    ("PNG, JPEG, WebP", "XMP tiff:Orientation", orientation),
    ("JPEG", "several XMP packets", several),
    ("JPEG", "extended XMP", extended),
    ("JPEG", "extended XMP of which pieces are missing", incomplete),
    ("JPEG", "second EXIF", twice),
];

const GPANO: &str = "http://ns.google.com/photos/1.0/panorama/";
const HDRGM: &str = "http://ns.adobe.com/hdr-gain-map/1.0/";
/// The left half of a panorama.
const HALF: &str = "G:FullPanoWidthPixels='32' G:FullPanoHeightPixels='8' G:CroppedAreaImageWidthPixels='16' \
    G:CroppedAreaImageHeightPixels='8' G:CroppedAreaLeftPixels='0' G:CroppedAreaTopPixels='0'";

/// Bright above, dark below.
fn picture() -> DynamicImage {
    let bright = |y| if y < 4 { 240 } else { 16 };
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(16, 8, |_, y| Rgb([bright(y); 3])))
}

fn in_png(packet: &[u8]) -> File {
    let text = chunk(b"iTXt", &[b"XML:com.adobe.xmp\0\0\0\0\0", packet].concat());
    png_around(&picture(), &[text], &[])
}

fn in_jpeg(segments: &[Vec<u8>]) -> File {
    File::new(&jpeg(&picture(), segments))
}

fn everywhere(packet: &[u8]) -> [File; 3] {
    let webp = File::new(&webp(&picture(), b"XMP ", packet, 0x04));
    [in_png(packet), in_jpeg(&[xmp_segment(packet)]), webp]
}

fn is_half(file: &File) -> bool {
    let Content::Display(ldr) = file.content().unwrap() else { panic!("display values") };
    (ldr.grid().width, ldr.unknown()) == (32, 0.5)
}

fn is_bright_above(file: &File) -> bool {
    file.first()[1] > 0.5
}

/// A JPEG with a gain map of three stops, described by these packets.
fn with_map(first: &[u8], second: &[u8]) -> File {
    let map = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(8, 4, Luma([255])));
    File::new(&[jpeg(&picture(), &[xmp_segment(first)]), jpeg(&map, &[xmp_segment(second)])].concat())
}

fn is_three_stops(file: &File) -> bool {
    let Content::Radiance(panorama) = file.content().unwrap() else { panic!("radiance") };
    let expected = 8.0 * srgb_to_linear(240.0 / 255.0);
    (panorama.pixel(1, 1)[1] / expected - 1.0).abs() < 0.03
}

fn encodings() {
    let words = packet(GPANO, "G", HALF);
    let wide: Vec<u8> = format!("\u{FEFF}{words}").encode_utf16().flat_map(u16::to_be_bytes).collect();
    let wider: Vec<u8> = words.chars().flat_map(|c| (c as u32).to_le_bytes()).collect();
    let odd = [words.as_bytes(), b"<a>caf\xe9</a>"].concat();
    for (k, packet) in [wide, wider, odd].iter().enumerate() {
        everywhere(packet).iter().for_each(|file| assert!(is_half(file), "{k}, {}", file.notes()));
    }
    let announced = [packet(HDRGM, "h", "h:Version='1.0'").as_bytes(), b"<a>caf\xe9</a>"].concat();
    let values = "h:GainMapMax='3' h:OffsetSDR='0' h:OffsetHDR='0'";
    let values = [packet(HDRGM, "h", values).as_bytes(), b"<!-- caf\xe9 -->"].concat();
    assert!(is_three_stops(&with_map(&announced, &values)));
    // comments say nothing
    let other = HALF.replace("='16'", "='32'").replace("G:", "H:");
    let comment = format!("<!-- xmlns:H='{GPANO}' {other} -->{words}");
    everywhere(comment.as_bytes()).iter().for_each(|file| assert!(is_half(file), "{}", file.notes()));
    everywhere(format!("<!-- {words} -->").as_bytes()).iter().for_each(|file| assert!(!is_half(file)));
}

fn orientation() {
    let turned = packet("http://ns.adobe.com/tiff/1.0/", "tiff", "tiff:Orientation='3'");
    everywhere(turned.as_bytes()).iter().for_each(|file| assert!(!is_bright_above(file)));
    // EXIF goes before it
    let upright = segment(0xE1, &[b"Exif\0\0", exif(1, 1, b"R98\0").as_slice()].concat());
    assert!(is_bright_above(&in_jpeg(&[xmp_segment(turned.as_bytes()), upright])));
    for none in ["0", "9", "2.5", "-3", "left"] {
        let none = packet("http://ns.adobe.com/tiff/1.0/", "t", &format!("t:Orientation='{none}'"));
        assert!(is_bright_above(&in_png(none.as_bytes())), "{none}");
    }
}

fn several() {
    let other = xmp_segment(b"<x/>");
    let words = packet(GPANO, "G", HALF);
    assert!(is_half(&in_jpeg(&[xmp_segment(words.as_bytes()), other.clone()])));
    let first =
        jpeg(&picture(), &[other.clone(), xmp_segment(packet(HDRGM, "h", "h:Version='1.0'").as_bytes())]);
    let values = packet(HDRGM, "h", "h:GainMapMax='3' h:OffsetSDR='0' h:OffsetHDR='0'");
    let map = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(8, 4, Luma([255])));
    let second = jpeg(&map, &[other, xmp_segment(values.as_bytes())]);
    assert!(is_three_stops(&File::new(&[first, second].concat())));
}

const DIGEST: &str = "0123456789ABCDEF0123456789ABCDEF";

/// The piece of `whole` from `at` to `end`.
fn piece(digest: &str, whole: &str, at: usize, end: usize) -> Vec<u8> {
    let place = [whole.len() as u32, at as u32].map(u32::to_be_bytes).concat();
    let head = [b"http://ns.adobe.com/xmp/extension/\0", digest.as_bytes(), &place].concat();
    segment(0xE1, &[&head, &whole.as_bytes()[at..end]].concat())
}

fn named() -> Vec<u8> {
    let note =
        packet("http://ns.adobe.com/xmp/note/", "xmpNote", &format!("xmpNote:HasExtendedXMP='{DIGEST}'"));
    xmp_segment(note.as_bytes())
}

fn extended() {
    let words = packet(GPANO, "G", HALF);
    let pieces = [piece(DIGEST, &words, 100, words.len()), piece(DIGEST, &words, 0, 100)];
    let old = piece(&DIGEST.replace('A', "B"), "an earlier state", 0, 10);
    assert!(is_half(&in_jpeg(&[named(), old.clone(), pieces[0].clone(), pieces[1].clone()])));
    // nobody names what is left over
    let file = in_jpeg(&[xmp_segment(b"<x/>"), old]);
    assert_eq!((is_half(&file), file.notes()), (false, String::new()));
}

fn incomplete() {
    let words = packet(GPANO, "G", HALF);
    let size = words.len();
    let overlap = vec![piece(DIGEST, &words, 0, 120), piece(DIGEST, &words, 100, size)];
    for pieces in
        [vec![piece(DIGEST, &words, 0, 100)], vec![piece(DIGEST, &words, 100, size)], vec![], overlap]
    {
        let file = in_jpeg(&[vec![named()], pieces].concat());
        assert!(!is_half(&file) && file.notes().contains("extended XMP"), "{}", file.notes());
    }
}

fn twice() {
    let block = |code: u8| segment(0xE1, &[b"Exif\0\0", exif(code, 1, b"R98\0").as_slice()].concat());
    assert!(!is_bright_above(&in_jpeg(&[block(3), block(1)])));
    assert!(is_bright_above(&in_jpeg(&[block(1), block(3)])));
    // LONG in place of SHORT
    let mut long = exif(3, 1, b"R98\0");
    long[10..22].copy_from_slice(&[1, 0x12, 0, 4, 0, 0, 0, 1, 0, 0, 0, 3]);
    assert!(!is_bright_above(&in_jpeg(&[segment(0xE1, &[b"Exif\0\0", long.as_slice()].concat())])));
    let file = png_around(&picture(), &[], &[chunk(b"eXIf", &long)]);
    assert!(!is_bright_above(&file));
    // fill bytes before a marker
    let filled = [vec![0xFF, 0xFF], block(3)].concat();
    assert!(!is_bright_above(&in_jpeg(&[filled])));
}
