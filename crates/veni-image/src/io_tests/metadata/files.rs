//! Small files with tags, straight from the specifications.

use std::path::PathBuf;

use image::{DynamicImage, ImageFormat};

use super::super::super::*;

/// A folder with one file.
pub(super) struct File {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl File {
    pub(super) fn new(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, bytes).unwrap();
        Self { _folder: folder, path }
    }

    pub(super) fn empty() -> Self {
        Self::new(b"")
    }

    pub(super) fn path(&self) -> &std::path::Path {
        &self.path
    }

    pub(super) fn content(&self) -> Result<Content> {
        Content::read(&self.path, &ReadOptions { any_aspect: true, ..ReadOptions::default() })
    }

    /// Linear radiance, and what is noted.
    pub(super) fn linear(&self) -> (Vec<[f32; 3]>, String) {
        let (panorama, notes) = match self.content().unwrap() {
            Content::Radiance(panorama) => (panorama.clone(), panorama.notes().join("; ")),
            Content::Display(ldr) => (ldr.linear(TransferFunction::Srgb), ldr.notes().join("; ")),
        };
        (panorama.into_pixels(), notes)
    }

    pub(super) fn first(&self) -> [f32; 3] {
        self.linear().0[0]
    }

    pub(super) fn notes(&self) -> String {
        self.linear().1
    }

    pub(super) fn error(&self) -> String {
        self.content().unwrap_err().to_string()
    }
}

/// Within a part in a thousand of the larger value.
pub(super) fn close(found: [f32; 3], expected: [f32; 3]) {
    let scale = expected.iter().fold(1e-3f32, |m, v| m.max(v.abs()));
    let off = found.iter().zip(expected).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(off <= 1e-3 * scale, "{found:?} is not {expected:?}");
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

pub(super) fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), format).unwrap();
    bytes
}

/// A chunk of a PNG.
pub(super) fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let body = [name.as_slice(), content].concat();
    [&u32::try_from(content.len()).unwrap().to_be_bytes()[..], &body, &crc(&body).to_be_bytes()].concat()
}

/// A PNG with whole chunks behind its header, and others behind its pixels.
pub(super) fn png_around(image: &DynamicImage, before: &[Vec<u8>], behind: &[Vec<u8>]) -> File {
    let mut bytes = encoded(image, ImageFormat::Png);
    // 12 bytes of IEND
    bytes.splice(bytes.len() - 12..bytes.len() - 12, behind.concat());
    // 8 bytes of signature and 25 of IHDR
    bytes.splice(33..33, before.concat());
    File::new(&bytes)
}

/// A picture of 16 bits, 8 × 4, of one colour.
pub(super) fn plain(colour: [f32; 3]) -> DynamicImage {
    let pixel = image::Rgb(colour.map(|v| (v * 65535.0).round() as u16));
    DynamicImage::ImageRgb16(image::ImageBuffer::from_pixel(8, 4, pixel))
}

/// A PNG of 16 bits, 8 × 4, of one colour, with chunks behind its header.
pub(super) fn png(colour: [f32; 3], chunks: &[(&[u8; 4], &[u8])]) -> File {
    let chunks: Vec<_> = chunks.iter().map(|(name, content)| chunk(name, content)).collect();
    png_around(&plain(colour), &chunks, &[])
}

/// A PNG with a profile.
pub(super) fn png_icc(colour: [f32; 3], profile: &[u8], others: &[(&[u8; 4], &[u8])]) -> File {
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(profile, 6);
    let body = [b"profile\0\0".as_slice(), &packed].concat();
    png(colour, &[others, &[(b"iCCP", &body)]].concat())
}

/// Numbers of 32 bits, in units of 1/100000.
pub(super) fn hundred_thousandths(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| ((v * 1e5).round() as u32).to_be_bytes()).collect()
}

/// A segment of a JPEG.
pub(super) fn segment(marker: u8, content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len() + 2).unwrap().to_be_bytes();
    [&[0xFF, marker], length.as_slice(), content].concat()
}

/// A JPEG at full quality with segments behind its first marker.
pub(super) fn jpeg(image: &DynamicImage, segments: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100);
    image.write_with_encoder(encoder).unwrap();
    bytes.splice(2..2, segments.concat());
    bytes
}

/// An XMP packet of one namespace.
pub(super) fn packet(namespace: &str, prefix: &str, properties: &str) -> String {
    format!(
        "<x:xmpmeta xmlns:x='adobe:ns:meta/'><rdf:RDF xmlns:rdf='http://www.w3.org/1999/02/22-rdf-syntax-ns#'>\
         <rdf:Description xmlns:{prefix}='{namespace}' {properties}/></rdf:RDF></x:xmpmeta>"
    )
}

/// An XMP packet as a JPEG's segment.
pub(super) fn xmp_segment(packet: &[u8]) -> Vec<u8> {
    segment(0xE1, &[b"http://ns.adobe.com/xap/1.0/\0", packet].concat())
}

/// The same of one namespace.
pub(super) fn xmp(namespace: &str, prefix: &str, properties: &str) -> Vec<u8> {
    xmp_segment(packet(namespace, prefix, properties).as_bytes())
}

/// EXIF of one directory: orientation; and of the Exif directory: colour space and interoperability index.
pub(super) fn exif(orientation: u8, colour_space: u16, interoperability: &[u8; 4]) -> Vec<u8> {
    let mut tiff = b"MM\0*\0\0\0\x08".to_vec();
    let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| -> Vec<u8> {
        [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value].concat()
    };
    let directory = |entries: &[Vec<u8>]| {
        [&(entries.len() as u16).to_be_bytes()[..], &entries.concat(), &[0; 4]].concat()
    };
    // directories of two, two and one entries: at 8, 38 and 68
    tiff.extend(directory(&[
        entry(0x112, 3, 1, [0, orientation, 0, 0]),
        entry(0x8769, 4, 1, 38u32.to_be_bytes()),
    ]));
    let [high, low] = colour_space.to_be_bytes();
    tiff.extend(directory(&[
        entry(0xA001, 3, 1, [high, low, 0, 0]),
        entry(0xA005, 4, 1, 68u32.to_be_bytes()),
    ]));
    tiff.extend(directory(&[entry(1, 2, 4, *interoperability)]));
    tiff
}

/// A WebP file in the extended layout with one more chunk (RFC 9649, section 2.7).
pub(super) fn webp(image: &DynamicImage, name: &[u8; 4], content: &[u8], flag: u8) -> Vec<u8> {
    let simple = encoded(image, ImageFormat::WebP);
    let mut extended = b"WEBPVP8X\x0a\0\0\0".to_vec();
    extended.extend([flag, 0, 0, 0]);
    for side in [image.width(), image.height()] {
        extended.extend(&(side - 1).to_le_bytes()[..3]);
    }
    extended.extend(name);
    extended.extend(u32::try_from(content.len()).unwrap().to_le_bytes());
    extended.extend(content);
    extended.extend(std::iter::repeat_n(0, content.len() % 2));
    extended.extend(&simple[12..]);
    [b"RIFF".as_slice(), &u32::try_from(extended.len()).unwrap().to_le_bytes(), &extended].concat()
}
