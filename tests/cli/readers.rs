//! Readers that share no code with veni, to check what it writes: OpenEXR (scan lines, ZIP or raw, half or
//! float) and Radiance `.hdr` (new run-length encoding), straight from their specifications.

use std::collections::BTreeMap;
use std::path::Path;

/// An image as another program would see it.
#[derive(Debug)]
pub(crate) struct Image {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row-major, top row first.
    pub(crate) pixels: Vec<[f32; 3]>,
    /// EXR attributes of type string, and the type names of all others.
    pub(crate) attributes: BTreeMap<String, String>,
}

impl Image {
    /// The largest relative difference to `other`, in units of each value's larger magnitude; NaN if one is.
    pub(crate) fn difference(&self, other: &Self) -> f32 {
        assert_eq!((self.width, self.height), (other.width, other.height), "sizes differ");
        let pairs = self.pixels.iter().flatten().zip(other.pixels.iter().flatten());
        let differences = pairs.map(|(a, b)| (a - b).abs() / a.abs().max(b.abs()).max(1e-20));
        differences.fold(0.0, |worst, d| if d.is_nan() || d > worst { d } else { worst })
    }

    /// This image with its columns rolled to the left by `columns`.
    pub(crate) fn rolled(&self, columns: usize) -> Self {
        let pixels =
            self.pixels.chunks(self.width).flat_map(|row| [&row[columns..], &row[..columns]].concat());
        Self { pixels: pixels.collect(), attributes: self.attributes.clone(), ..*self }
    }
}

struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> &'a [u8] {
        let (head, tail) = self.0.split_at(n);
        self.0 = tail;
        head
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take(4).try_into().unwrap())
    }
    fn text(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).expect("a terminating zero");
        let text = String::from_utf8(self.take(end).to_vec()).unwrap();
        self.take(1);
        text
    }
}

/// Reads a single-part scan-line OpenEXR file with channels B, G, R.
pub(crate) fn exr(path: &Path) -> Image {
    let file = std::fs::read(path).unwrap();
    let mut bytes = Bytes(&file);
    assert_eq!(bytes.u32(), 20_000_630, "magic number");
    let version = bytes.u32();
    assert_eq!(version & 0xff, 2);
    assert_eq!(version & 0x1a00, 0, "one part, scan lines");
    let mut attributes = BTreeMap::new();
    let (mut compression, mut types, mut window) = (0, Vec::new(), [0i32; 4]);
    loop {
        let name = bytes.text();
        if name.is_empty() {
            break;
        }
        let kind = bytes.text();
        let size = bytes.u32() as usize;
        let value = bytes.take(size);
        match name.as_str() {
            "compression" => compression = value[0],
            "dataWindow" => {
                let mut v = Bytes(value);
                window = [0; 4].map(|_| v.u32() as i32);
            }
            "channels" => {
                let mut v = Bytes(value);
                while v.0[0] != 0 {
                    let channel = v.text();
                    types.push((channel, v.u32()));
                    v.take(12);
                }
            }
            "lineOrder" => assert_eq!(value[0], 0, "increasing order"),
            _ => {}
        }
        let value = if kind == "string" { String::from_utf8(value.to_vec()).unwrap() } else { kind };
        attributes.insert(name, value);
    }
    let names: Vec<_> = types.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["B", "G", "R"]);
    let size = if types[0].1 == 1 { 2 } else { 4 };
    let (width, height) = ((window[2] - window[0] + 1) as usize, (window[3] - window[1] + 1) as usize);
    let block = match compression {
        0 | 2 => 1,
        3 => 16,
        other => panic!("compression {other} is not handled here"),
    };
    bytes.take(8 * height.div_ceil(block));
    let mut pixels = vec![[f32::NAN; 3]; width * height];
    for first in (0..height).step_by(block) {
        let rows = block.min(height - first);
        assert_eq!(bytes.u32() as i32 - window[1], first as i32, "rows in order");
        let packed = bytes.u32() as usize;
        let packed = bytes.take(packed);
        let raw = if packed.len() == rows * width * 3 * size { packed.to_vec() } else { unzip(packed) };
        assert_eq!(raw.len(), rows * width * 3 * size);
        for (at, value) in raw.chunks(size).enumerate() {
            let (row, channel, column) = (first + at / (3 * width), 2 - at / width % 3, at % width);
            pixels[row * width + column][channel] = match value {
                [a, b] => half(u16::from_le_bytes([*a, *b])),
                value => f32::from_le_bytes(value.try_into().unwrap()),
            };
        }
    }
    assert!(bytes.0.is_empty(), "nothing after the last block");
    Image { width, height, pixels, attributes: whole(attributes) }
}

/// Long texts are stored as `NAME[1/2]`, `NAME[2/2]`.
fn whole(attributes: BTreeMap<String, String>) -> BTreeMap<String, String> {
    let mut whole: BTreeMap<String, String> = BTreeMap::new();
    // in the order of their names, so the parts of one text are in order too
    for (name, value) in attributes {
        assert!(value.len() <= 255, "{name} is longer than other software reads");
        let name = name.split_once('[').map_or(name.as_str(), |(name, _)| name);
        whole.entry(name.to_owned()).or_default().push_str(&value);
    }
    whole
}

/// OpenEXR's ZIP: deflate, undo the predictor, undo the split into even and odd bytes.
fn unzip(packed: &[u8]) -> Vec<u8> {
    let mut bytes = miniz_oxide::inflate::decompress_to_vec_zlib(packed).expect("zlib data");
    for i in 1..bytes.len() {
        bytes[i] = bytes[i].wrapping_add(bytes[i - 1]).wrapping_sub(128);
    }
    let (even, odd) = bytes.split_at(bytes.len().div_ceil(2));
    (0..bytes.len()).map(|i| if i % 2 == 0 { even[i / 2] } else { odd[i / 2] }).collect()
}

fn half(bits: u16) -> f32 {
    let (sign, exponent, fraction) = (bits >> 15, bits >> 10 & 31, f32::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * (-24f32).exp2(),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        e => (1.0 + fraction / 1024.0) * (f32::from(e) - 15.0).exp2(),
    };
    if sign == 1 { -magnitude } else { magnitude }
}

/// Reads a Radiance picture with rows from top to bottom.
pub(crate) fn hdr(path: &Path) -> Image {
    let file = std::fs::read(path).unwrap();
    let end = file.windows(2).position(|w| w == b"\n\n").expect("end of header") + 2;
    let header = std::str::from_utf8(&file[..end]).unwrap();
    assert!(header.starts_with("#?RADIANCE\n"), "{header}");
    assert_eq!(header.lines().nth(1), Some("FORMAT=32-bit_rle_rgbe"), "{header}");
    assert!(header.lines().all(|line| line.len() < 100), "{header}");
    let line_end = end + file[end..].iter().position(|b| *b == b'\n').unwrap();
    let line: Vec<_> = std::str::from_utf8(&file[end..line_end]).unwrap().split(' ').collect();
    let ["-Y", height, "+X", width] = line[..] else { panic!("resolution line {line:?}") };
    let (width, height): (usize, usize) = (width.parse().unwrap(), height.parse().unwrap());
    let mut bytes = Bytes(&file[line_end + 1..]);
    let mut pixels = Vec::with_capacity(width * height);
    for _ in 0..height {
        let mut row = vec![[0u8; 4]; width];
        if (8..32768).contains(&width) {
            assert_eq!(bytes.take(4), [2, 2, (width >> 8) as u8, width as u8], "new run-length encoding");
            for channel in 0..4 {
                let mut at = 0;
                while at < width {
                    let count = usize::from(bytes.take(1)[0]);
                    if count > 128 {
                        let value = bytes.take(1)[0];
                        row[at..at + count - 128].iter_mut().for_each(|p| p[channel] = value);
                        at += count - 128;
                    } else {
                        row[at..at + count]
                            .iter_mut()
                            .zip(bytes.take(count))
                            .for_each(|(p, v)| p[channel] = *v);
                        at += count;
                    }
                }
            }
        } else {
            row.iter_mut().for_each(|p| *p = bytes.take(4).try_into().unwrap());
        }
        pixels.extend(row.iter().map(|[r, g, b, e]| {
            let scale = if *e == 0 { 0.0 } else { (f32::from(*e) - 136.0).exp2() };
            [r, g, b].map(|v| (f32::from(*v) + 0.5) * scale)
        }));
    }
    assert!(bytes.0.is_empty(), "nothing after the last row");
    Image { width, height, pixels, attributes: BTreeMap::new() }
}
