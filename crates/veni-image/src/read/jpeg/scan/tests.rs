//! Pictures of several encoders, whole, cut off and ended again, and with parts left out. The files are libjpeg's (`cjpeg`), made of
//! a gradient for this project.

use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb};

use super::*;

/// 4:2:0 in ten scans, of which some refine others.
const PROGRESSIVE: &[u8] = include_bytes!("../files/progressive.jpg");
/// 4:2:2 with a restart behind each of its 16 units.
const RESTARTS: &[u8] = include_bytes!("../files/restarts.jpg");
/// 4:2:0, sequential, each component in a scan of its own.
const SEPARATE: &[u8] = include_bytes!("../files/separate.jpg");

/// What the image crate's encoder makes of noise, with stuffed bytes.
fn noise() -> Vec<u8> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let image = DynamicImage::ImageRgb8(ImageBuffer::from_fn(75, 33, |_, _| Rgb([next(), next(), next()])));
    let mut bytes = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), ImageFormat::Jpeg).unwrap();
    assert!(bytes.windows(2).any(|pair| pair == [0xFF, 0]));
    bytes
}

fn all() -> [(&'static str, Vec<u8>); 4] {
    [
        ("progressive", PROGRESSIVE.to_vec()),
        ("restarts", RESTARTS.to_vec()),
        ("separate", SEPARATE.to_vec()),
        ("noise", noise()),
    ]
}

fn message(bytes: &[u8]) -> String {
    complete(bytes).unwrap_err().to_string()
}

fn places(bytes: &[u8], marker: impl Fn(u8) -> bool) -> Vec<usize> {
    (0..bytes.len() - 1).filter(|at| bytes[*at] == 0xFF && marker(bytes[at + 1])).collect()
}

#[test]
fn whole_pictures_are_complete() {
    for (name, bytes) in all() {
        complete(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        // what stands behind the end is another picture's
        complete(&[&bytes[..], &bytes[..bytes.len() / 2]].concat()).unwrap_or_else(|e| panic!("{name}: {e}"));
        // a few bytes too many are harmless, fill bytes are none
        let end = bytes.len() - 2;
        let padded = [&bytes[..end], &[0; 40], &[0xFF; 200], &bytes[end..]].concat();
        complete(&padded).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

/// Wherever it is cut behind its first scan header, an end marker does not make it whole, be it read as part of a later header.
#[test]
fn pictures_that_end_early_are_truncated() {
    for (name, bytes) in all() {
        let scan = places(&bytes, |m| m == 0xDA)[0] + 20;
        for cut in scan..bytes.len() - 3 {
            let ended = [&bytes[..cut], &[0xFF, 0xD9]].concat();
            let Err(error) = complete(&ended) else { panic!("{name}, {cut} of {}", bytes.len()) };
            let error = error.to_string();
            assert!(error.contains("JPEG file"), "{name}, {cut} of {}: {error}", bytes.len());
        }
    }
    let bytes = noise();
    let error = message(&[&bytes[..bytes.len() / 2], &[0xFF, 0xD9]].concat());
    assert!(error.contains("picture data end after") && error.contains("of 50 blocks"), "{error}");
}

#[test]
fn all_bits_of_all_components_are_there() {
    let scans = places(PROGRESSIVE, |m| m == 0xDA);
    let error = message(&[&PROGRESSIVE[..scans[1]], &[0xFF, 0xD9]].concat());
    assert!(error.contains("last bits of coefficient 0 of component 1"), "{error}");
    let error = message(&[&PROGRESSIVE[..scans[9]], &[0xFF, 0xD9]].concat());
    assert!(error.contains("last bits of coefficient 1 of component 1"), "{error}");
    let scans = places(SEPARATE, |m| m == 0xDA);
    let error = message(&[&SEPARATE[..scans[2]], &[0xFF, 0xD9]].concat());
    assert!(error.contains("no scan holds its component 3"), "{error}");
}

#[test]
fn restarts_come_in_order() {
    let restarts = places(RESTARTS, |m| (0xD0..=0xD7).contains(&m));
    assert_eq!(restarts.len(), 15);
    let without = |from: usize, to: usize| [&RESTARTS[..restarts[from]], &RESTARTS[restarts[to]..]].concat();
    let error = message(&without(2, 3));
    assert!(error.contains("restart marker 3 stands where 2 is due, after 3 of 16"), "{error}");
    // eight of them: their numbers fit again
    let error = message(&without(2, 10));
    assert!(error.contains("data end after 8 of 16"), "{error}");
}

#[test]
fn what_is_misread_is_damaged() {
    // zeros, as where a download left a hole
    for (name, mut bytes) in all() {
        let (scan, end) = (places(&bytes, |m| m == 0xDA)[0] + 20, bytes.len() - 2);
        bytes[scan..end].fill(0);
        assert!(complete(&bytes).is_err(), "{name}");
    }
    let bytes = noise();
    let end = bytes.len() - 2;
    let error = message(&[&bytes[..end], &vec![0; end / 8], &bytes[end..]].concat());
    assert!(error.contains(&format!("go on for {} bytes", end / 8)), "{error}");
    // a table without the codes that are used
    let mut bytes = SEPARATE.to_vec();
    let table = places(&bytes, |m| m == 0xC4)[0];
    bytes[table + 5..table + 21].fill(0);
    let error = message(&bytes);
    assert!(error.contains("no code after 0 of 32 blocks"), "{error}");
    bytes[table + 1] = 0xFE;
    assert!(message(&bytes).contains("a Huffman table that is not there"));
}
