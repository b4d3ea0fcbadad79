//! Pictures of limited range: PNG, JPEG, WebP, AVIF, with what they may say of themselves.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};
use veni_image::{Content, TransferFunction};

use super::images::options;
use super::{Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "png", run: picture, seeds: png, repair: checksums },
    Target { name: "jpeg", run: picture, seeds: jpeg, repair: untouched },
    Target { name: "webp", run: picture, seeds: webp, repair: untouched },
    #[cfg(feature = "avif")]
    Target { name: "avif", run: picture, seeds: avif, repair: untouched },
];

/// Where the 32 × 16 pixels lie in a panorama of twice the size.
const XMP: &[u8] =
    b"<x:x xmlns:G='http://ns.google.com/photos/1.0/panorama/' G:ProjectionType='equirectangular' \
    G:FullPanoWidthPixels='64' G:FullPanoHeightPixels='32' G:CroppedAreaImageWidthPixels='32' \
    G:CroppedAreaImageHeightPixels='16' G:CroppedAreaLeftPixels='8' G:CroppedAreaTopPixels='4'/>";

fn picture(path: &Path) -> bool {
    match Content::read(path, &options()) {
        Ok(Content::Display(found)) => {
            let linear = found.linear(TransferFunction::Srgb);
            // colours of wider primaries are outside of 0 to 1
            assert!(linear.pixels().as_flattened().iter().all(|v| v.is_finite()), "display values");
            true
        }
        // a gain map, PQ or HLG
        Ok(Content::Radiance(found)) => {
            assert!(found.pixels().as_flattened().iter().all(|v| v.is_finite()), "radiance");
            true
        }
        Err(_) => false,
    }
}

fn encoded(format: ImageFormat, alpha: bool) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let done = if alpha {
        let at = |x: u32, y: u32| Rgba([(8 * x) as u8, (16 * y) as u8, 77, (255 - 5 * x) as u8]);
        RgbaImage::from_fn(32, 16, at).write_to(&mut out, format)
    } else {
        RgbImage::from_fn(32, 16, |x, y| Rgb([(8 * x) as u8, (16 * y) as u8, 77])).write_to(&mut out, format)
    };
    done.expect("a seed can be encoded");
    out.into_inner()
}

pub(super) fn png() -> Vec<Vec<u8>> {
    let mut all = vec![encoded(ImageFormat::Png, false), encoded(ImageFormat::Png, true)];
    let chunk =
        |name: &[u8; 4], body: &[u8]| [&(body.len() as u32).to_be_bytes()[..], name, body, &[0; 4]].concat();
    // a palette of two colours: one row of 16 pixels, stored without compression
    let header = [0, 0, 0, 16, 0, 0, 0, 1, 1, 3, 0, 0, 0];
    let data = [0x78, 1, 1, 3, 0, 0xFC, 0xFF, 0, 0x55, 0x0F, 0, 0xB9, 0, 0x65];
    let mut indexed = [
        &b"\x89PNG\r\n\x1a\n"[..],
        &chunk(b"IHDR", &header),
        &chunk(b"gAMA", &[0, 0, 0xB1, 0x8F]),
        &chunk(b"PLTE", &[0, 0, 0, 255, 128, 64]),
        &chunk(b"tRNS", &[255, 128]),
        &chunk(b"eXIf", b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"),
        &chunk(b"IDAT", &data),
        &chunk(b"IEND", &[]),
    ]
    .concat();
    checksums(&mut indexed);
    all.push(indexed);
    let text = [b"XML:com.adobe.xmp\0\0\0\0\0", XMP].concat();
    // "Exif\0\0MM\0*" and no entries, as ImageMagick writes it
    let raw = b"Raw profile type exif\0\nexif\n      16\n457869660000\n4d4d002a000000080000\n";
    let exif = b"MM\0*\0\0\0\x08\0\0";
    for (name, body) in [(b"iTXt", &text[..]), (b"tEXt", raw), (b"eXIf", exif), (b"cICP", &[9, 16, 0, 1])] {
        // behind the header's chunk
        let mut file = all[0][..33].to_vec();
        file.extend(chunk(name, body));
        file.extend(&all[0][33..]);
        checksums(&mut file);
        all.push(file);
    }
    all.push(include_bytes!("../../../tests/cli/files/icc_p3.png").to_vec());
    all
}

pub(super) fn jpeg() -> Vec<Vec<u8>> {
    let plain = encoded(ImageFormat::Jpeg, false);
    let exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let with = |segments: &[&[u8]]| {
        let mut file = plain[..2].to_vec();
        for content in segments {
            file.extend([0xFF, 0xE1]);
            file.extend((content.len() as u16 + 2).to_be_bytes());
            file.extend(*content);
        }
        file.extend(&plain[2..]);
        file
    };
    let whole = [b"http://ns.adobe.com/xap/1.0/\0", XMP].concat();
    // a packet that names its other part, which is in two pieces
    let digest = "0123456789ABCDEF0123456789ABCDEF";
    let note = format!("<x:x xmlns:n='http://ns.adobe.com/xmp/note/' n:HasExtendedXMP='{digest}'/>");
    let note = [b"http://ns.adobe.com/xap/1.0/\0", note.as_bytes()].concat();
    let piece = |from: usize, to: usize| {
        let place = [XMP.len() as u32, from as u32].map(u32::to_be_bytes).concat();
        [&b"http://ns.adobe.com/xmp/extension/\0"[..], digest.as_bytes(), &place, &XMP[from..to]].concat()
    };
    let mut all = vec![
        with(&[exif]),
        with(&[&whole]),
        with(&[&note, &piece(0, 100), &piece(100, XMP.len())]),
        include_bytes!("../../../tests/cli/files/icc_p3.jpg").to_vec(),
        include_bytes!("../../../tests/cli/files/ultrahdr.jpg").to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/jpeg/files/progressive.jpg").to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/jpeg/files/restarts.jpg").to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/jpeg/files/separate.jpg").to_vec(),
    ];
    all.insert(0, plain);
    all
}

fn webp() -> Vec<Vec<u8>> {
    vec![encoded(ImageFormat::WebP, false), encoded(ImageFormat::WebP, true)]
}

#[cfg(feature = "avif")]
fn avif() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../../crates/veni-image/src/read/avif/files/8-bit-420-bt601-limited.avif")
            .to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/avif/files/8-bit-alpha.avif").to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/avif/files/10-bit-444-bt2020.avif").to_vec(),
    ]
}

/// The checksums of a PNG's chunks.
pub(super) fn checksums(file: &mut [u8]) {
    let mut at = 8;
    while let Some(length) =
        file.get(at..at + 4).and_then(|b| b.first_chunk()).map(|b| u32::from_be_bytes(*b))
    {
        let end = at + 8 + length as usize;
        if !file.starts_with(b"\x89PNG") || end + 4 > file.len() {
            return;
        }
        let sum = crc(&file[at + 4..end]);
        file[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// CRC-32 (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xEDB8_8320))
    })
}
