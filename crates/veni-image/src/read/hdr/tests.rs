//! Headers and rows as other programs write them, each against values worked out by hand.

use std::io::Cursor;
use std::path::Path;

use super::*;

fn options() -> ReadOptions {
    ReadOptions { any_aspect: true, ..ReadOptions::default() }
}

fn file(header: &str, resolution: &str, pixels: &[u8]) -> Vec<u8> {
    [format!("#?RADIANCE\n{header}\n{resolution}\n").as_bytes(), pixels].concat()
}

fn read_bytes(bytes: &[u8]) -> Result<Panorama> {
    read(Cursor::new(bytes), Path::new("a.hdr"), &options())
}

const FORMAT: &str = "FORMAT=32-bit_rle_rgbe\n";

/// Mantissas 128, 64, 32 with exponent 129 are 1, ½, ¼.
#[test]
fn lines_may_end_in_carriage_return_and_line_feed() {
    let plain = file(FORMAT, "-Y 1 +X 2", &[128, 64, 32, 129, 10, 13, 10, 129]);
    let split = plain.len() - 8;
    let text = String::from_utf8(plain[..split].to_vec()).unwrap();
    let expected = [[1.0, 0.5, 0.25], [10.0, 13.0, 10.0].map(|v| v / 128.0)];
    for text in [
        text.clone(),
        text.replace('\n', "\r\n"),
        text.replace("BE\n\n", "BE\r\n\r\n"),
        text.replace('\n', "\r"),
    ] {
        let read = read_bytes(&[text.as_bytes(), &plain[split..]].concat()).unwrap();
        assert_eq!(read.pixels(), expected, "{text:?}");
        assert_eq!(read.attributes()["FORMAT"], "32-bit_rle_rgbe");
    }
}

/// 2 2 0 9 in a row of eight is a pixel, as is 2 2 and anything in a row of four; 2 2 0 8 begins eight runs.
#[test]
fn flat_rows_that_begin_like_runs_are_flat() {
    let flat = |start: [u8; 4], width: usize| {
        let pixels = [start.to_vec(), [128, 128, 128, 129].repeat(width - 1)].concat();
        read_bytes(&file(FORMAT, &format!("-Y 1 +X {width}"), &pixels))
    };
    let value = |v: u8, e: u8| f32::from(v) * (f32::from(e) - 136.0).exp2();
    for (start, width) in
        [([2, 2, 0, 9], 8), ([2, 2, 1, 8], 8), ([2, 2, 0, 4], 4), ([2, 2, 200, 129], 8), ([1, 1, 1, 129], 8)]
    {
        let read = flat(start, width).unwrap();
        let [r, g, b, e] = start;
        assert_eq!(read.pixels()[0], [r, g, b].map(|v| value(v, e)), "{start:?}");
        assert_eq!(read.pixels()[1], [1.0; 3], "{start:?}");
    }
    let runs = [vec![2, 2, 0, 8], [136, 128].repeat(3), vec![136, 130]].concat();
    assert_eq!(read_bytes(&file(FORMAT, "-Y 1 +X 8", &runs)).unwrap().pixels(), [[2.0; 3]; 8]);
}

#[test]
fn old_runs_repeat_the_pixel_before_and_multiply() {
    let pixels = |widths: &[u8]| [&[128, 0, 0, 129][..], widths].concat();
    // 3, and 1 + 256
    let short = read_bytes(&file(FORMAT, "-Y 1 +X 4", &pixels(&[1, 1, 1, 3]))).unwrap();
    assert_eq!(short.pixels(), [[1.0, 0.0, 0.0]; 4]);
    let long = read_bytes(&file(FORMAT, "-Y 1 +X 258", &pixels(&[1, 1, 1, 1, 1, 1, 1, 1]))).unwrap();
    assert_eq!(long.pixels(), [[1.0, 0.0, 0.0]; 258]);
    let error = read_bytes(&file(FORMAT, "-Y 1 +X 4", &pixels(&[1, 1, 1, 9]))).unwrap_err().to_string();
    assert!(error.contains("damaged"), "{error}");
    for bad in [[2, 2, 0, 8, 200, 1].as_slice(), &[2, 2, 0, 8, 0, 1]] {
        let error = read_bytes(&file(FORMAT, "-Y 1 +X 8", bad)).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
    }
    assert!(
        read_bytes(&file(FORMAT, "-Y 1 +X 8", &[2, 2, 0, 8, 136]))
            .unwrap_err()
            .to_string()
            .contains("truncated")
    );
}

/// A picture of 3 × 2 whose pixels are 0 to 5, stored in each of the eight orders.
#[test]
fn all_eight_orientations_are_brought_upright() {
    let shown = |x: usize, y: usize| (3 * y + x) as u8;
    type Order = fn(usize, usize) -> (usize, usize);
    let orders: [(&str, [usize; 2], Order); 8] = [
        ("-Y 2 +X 3", [2, 3], |r, c| (c, r)),
        ("-Y 2 -X 3", [2, 3], |r, c| (2 - c, r)),
        ("+Y 2 +X 3", [2, 3], |r, c| (c, 1 - r)),
        ("+Y 2 -X 3", [2, 3], |r, c| (2 - c, 1 - r)),
        ("+X 3 -Y 2", [3, 2], |r, c| (r, c)),
        ("-X 3 -Y 2", [3, 2], |r, c| (2 - r, c)),
        ("+X 3 +Y 2", [3, 2], |r, c| (r, 1 - c)),
        ("-X 3 +Y 2", [3, 2], |r, c| (2 - r, 1 - c)),
    ];
    for (resolution, [rows, columns], order) in orders {
        let places = (0..rows).flat_map(|r| (0..columns).map(move |c| order(r, c)));
        let pixels: Vec<u8> = places.flat_map(|(x, y)| [shown(x, y), 128, 0, 136]).collect();
        let read = read_bytes(&file(FORMAT, resolution, &pixels)).unwrap();
        assert_eq!((read.grid().width, read.grid().height), (3, 2), "{resolution}");
        let found: Vec<f32> = read.pixels().iter().map(|p| p[0]).collect();
        assert_eq!(found, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{resolution}");
    }
    assert!(read_bytes(&file(FORMAT, "-Y 2 +Y 3", &[0; 24])).unwrap_err().to_string().contains("resolution"));
}

#[test]
fn headers_that_say_nonsense_are_refused_by_name() {
    for (line, word) in [
        ("EXPOSURE=-1", "EXPOSURE=-1"),
        ("EXPOSURE=inf", "EXPOSURE=inf"),
        ("EXPOSURE=abc", "EXPOSURE=abc"),
        ("COLORCORR=1 2", "COLORCORR=1 2"),
        ("COLORCORR=1 0 1", "COLORCORR=1 0 1"),
        ("GAMMA=-2", "GAMMA=-2"),
        ("PRIMARIES=1 2 3", "PRIMARIES=1 2 3"),
        ("PRIMARIES=.3 .3 .3 .3 .3 .3 .3 .3", "PRIMARIES=.3"),
        ("FORMAT=32-bit_rle_xyzw", "FORMAT=32-bit_rle_xyzw"),
    ] {
        let error =
            read_bytes(&file(&format!("{line}\n"), "-Y 1 +X 1", &[1, 2, 3, 129])).unwrap_err().to_string();
        assert!(error.contains(word), "{line}: {error}");
    }
}
