//! Pictures as cameras store them: turned upright by what EXIF says, in every format that carries it, and refused
//! where their end is missing.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb};
use veni_image::{LdrPanorama, ReadOptions};
use veni_light::sphere::Equirect;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name)
}

/// Any shape, as photographs have.
fn read(path: &Path) -> veni_image::Result<LdrPanorama> {
    LdrPanorama::read_with(path, &ReadOptions { any_aspect: true, ..ReadOptions::default() })
}

/// Mean |a − b| of the display values; infinite for other sizes.
fn difference(a: &LdrPanorama, b: &LdrPanorama) -> f32 {
    if a.grid() != b.grid() {
        return f32::INFINITY;
    }
    let pairs = a.values().as_flattened().iter().zip(b.values().as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).sum::<f32>() / (3 * a.values().len()) as f32
}

/// Turned by half a turn, which a wrong orientation leaves.
fn upside_down(image: &LdrPanorama) -> LdrPanorama {
    LdrPanorama::new(image.grid(), image.values().iter().rev().copied().collect())
}

#[test]
fn jpeg_files_are_turned_upright() {
    for (upright, held) in [
        ("a.jpg", "exif3.jpg"),
        ("photo_upright.jpg", "photo_exif3.jpg"),
        ("photo_upright.jpg", "photo_exif6.jpg"),
    ] {
        let (upright, held_image) = (read(&file(upright)).unwrap(), read(&file(held)).unwrap());
        // two JPEG codings of one picture, blocks laid differently
        let off = difference(&upright, &held_image);
        let wrong = difference(&upside_down(&upright), &held_image);
        assert!(off < 0.01 && wrong > 10.0 * off.max(0.005), "{held}: {off} upright, {wrong} upside down");
    }
    assert_eq!(read(&file("photo_exif6.jpg")).unwrap().grid(), Equirect::new(64, 96));
    // a photograph is not a panorama, whichever way it is held
    for name in ["photo_upright.jpg", "photo_exif6.jpg"] {
        let error = LdrPanorama::read(file(name)).unwrap_err().to_string();
        assert!(error.contains("64 × 96") && error.contains(name), "{error}");
    }
}

#[test]
fn jpeg_files_without_their_end_are_refused() {
    for name in ["trunc.jpg", "photo_trunc.jpg"] {
        let error = read(&file(name)).unwrap_err().to_string();
        assert!(error.contains("truncated JPEG file") && error.contains(name), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.jpg");
    for name in ["a.jpg", "exif3.jpg", "photo_exif6.jpg"] {
        let whole = std::fs::read(file(name)).unwrap();
        read(&file(name)).unwrap();
        for eighths in 1..8 {
            std::fs::write(&path, &whole[..whole.len() * eighths / 8]).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("JPEG") && error.contains("cut.jpg"), "{name}, {eighths}/8: {error}");
        }
        // as an interrupted download into a file of the final size leaves it
        let mut padded = whole.clone();
        padded[whole.len() * 3 / 4..].fill(0);
        std::fs::write(&path, &padded).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("truncated JPEG file"), "{name}");
    }
}

/// EXIF data that say how the camera was held: TIFF, big-endian, one entry (tag 0x0112, one SHORT).
fn exif(orientation: u8) -> Vec<u8> {
    [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".as_slice(), &[orientation], b"\0\0\0\0\0\0"].concat()
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), format).unwrap();
    bytes
}

/// A PNG with an `eXIf` chunk behind its header (PNG, third edition, 11.3.2.7).
fn png(image: &DynamicImage, orientation: u8) -> Vec<u8> {
    let mut bytes = encoded(image, ImageFormat::Png);
    let body = [b"eXIf".as_slice(), &exif(orientation)].concat();
    let mut chunk = u32::try_from(body.len() - 4).unwrap().to_be_bytes().to_vec();
    chunk.extend(&body);
    chunk.extend(crc(&body).to_be_bytes());
    // 8 bytes of signature and 25 of IHDR
    bytes.splice(33..33, chunk);
    bytes
}

/// A WebP file in the extended layout with an EXIF chunk at its end (RFC 9649, section 2.7).
fn webp(image: &DynamicImage, orientation: u8) -> Vec<u8> {
    let simple = encoded(image, ImageFormat::WebP);
    let mut extended = b"WEBPVP8X\x0a\0\0\0\x08\0\0\0".to_vec();
    for side in [image.width(), image.height()] {
        extended.extend(&(side - 1).to_le_bytes()[..3]);
    }
    extended.extend(&simple[12..]);
    let exif = exif(orientation);
    extended.extend(b"EXIF");
    extended.extend(u32::try_from(exif.len()).unwrap().to_le_bytes());
    extended.extend(exif);
    let mut bytes = b"RIFF".to_vec();
    bytes.extend(u32::try_from(extended.len()).unwrap().to_le_bytes());
    bytes.extend(extended);
    bytes
}

/// All eight orientations of EXIF 2.32, table of tag 274, in the lossless formats: the same values to the bit.
#[test]
fn all_eight_orientations_of_png_and_webp() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("held");
    let upright =
        DynamicImage::ImageRgb8(ImageBuffer::from_fn(6, 4, |x, y| Rgb([(x * 40) as u8, (y * 60) as u8, 9])));
    let stored = [
        upright.clone(),
        upright.fliph(),
        upright.rotate180(),
        upright.flipv(),
        upright.rotate90().fliph(),
        upright.rotate270(),
        upright.rotate270().fliph(),
        upright.rotate90(),
    ];
    std::fs::write(&path, encoded(&upright, ImageFormat::Png)).unwrap();
    let expected = read(&path).unwrap();
    assert_eq!(expected.grid(), Equirect::new(6, 4));
    for (orientation, stored) in (1..).zip(&stored) {
        for (format, bytes) in [("PNG", png(stored, orientation)), ("WebP", webp(stored, orientation))] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read(&path).unwrap(), expected, "{format}, orientation {orientation}");
        }
    }
}

/// Cut anywhere behind its first bytes, a lossless file is refused, never filled up.
#[test]
fn png_and_webp_files_without_their_end_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut");
    let noise = DynamicImage::ImageRgb8(ImageBuffer::from_fn(24, 12, |x, y| {
        Rgb([(x * x * 7 + y * 13) as u8, (x * y * 31) as u8, (x * 97 + y * y * 5) as u8])
    }));
    for format in [ImageFormat::Png, ImageFormat::WebP] {
        let whole = encoded(&noise, format);
        std::fs::write(&path, &whole).unwrap();
        read(&path).unwrap();
        // the 12 bytes of IEND at the end of a PNG hold no pixels
        let last = if format == ImageFormat::Png { whole.len() - 13 } else { whole.len() - 2 };
        for length in (16..last).step_by(7).chain([last]) {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "{format:?}: {length} of {} bytes were read", whole.len());
        }
    }
}
