//! Formats of limited range: every layout, upright, within limits, and refused when damaged.

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};

use super::*;
use crate::TransferFunction;

const SIZE: (u32, u32) = (8, 4);

fn write(image: &DynamicImage, name: &str, format: ImageFormat) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    image.save_with_format(&path, format).unwrap();
    (folder, path)
}

fn gradient() -> ImageBuffer<Rgb<u8>, Vec<u8>> {
    ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([(x * 30) as u8, (y * 60) as u8, 128]))
}

#[test]
fn sample_layouts_of_png_jpeg_and_webp() {
    let expected = |k: usize| [(k % 8 * 30) as f32 / 255.0, (k / 8 * 60) as f32 / 255.0, 128.0 / 255.0];
    for (format, tolerance) in [(ImageFormat::Png, 1e-6), (ImageFormat::WebP, 1e-6), (ImageFormat::Jpeg, 0.1)]
    {
        let (_folder, path) = write(&gradient().into(), "misnamed.exr", format);
        assert!(LdrPanorama::recognise(&path).unwrap());
        let ldr = LdrPanorama::read(&path).unwrap();
        assert_eq!((ldr.grid(), ldr.unknown()), (Equirect::new(8, 4), 0.0));
        for (k, value) in ldr.values().iter().enumerate() {
            let off = value.iter().zip(expected(k)).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
            assert!(off <= tolerance, "{format:?}, pixel {k}: {value:?}");
        }
    }
    let deep = ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, _| Rgb([x as u16, 40000, 65535]));
    let (_folder, path) = write(&DynamicImage::ImageRgb16(deep), "deep.png", ImageFormat::Png);
    assert_eq!(
        LdrPanorama::read(&path).unwrap().values()[3],
        [3.0, 40000.0, 65535.0].map(|v: f32| v / 65535.0)
    );
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(SIZE.0, SIZE.1, Luma([51])));
    let (_folder, path) = write(&grey, "grey.png", ImageFormat::Png);
    assert_eq!(LdrPanorama::read(&path).unwrap().values()[0], [0.2; 3]);
    let half = ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, _| LumaA([51, if x < 2 { 0 } else { 255 }]));
    let (_folder, path) = write(&DynamicImage::ImageLumaA8(half), "half.png", ImageFormat::Png);
    let ldr = LdrPanorama::read(&path).unwrap();
    assert_eq!((ldr.values()[0], ldr.unknown()), ([0.2; 3], 0.25));
    let clear = DynamicImage::ImageRgba8(ImageBuffer::from_pixel(SIZE.0, SIZE.1, Rgba([255, 0, 0, 127])));
    let (_folder, path) = write(&clear, "clear.webp", ImageFormat::WebP);
    assert_eq!(LdrPanorama::read(&path).unwrap().unknown(), 1.0);
    // radiance only where the file holds it
    let error = Panorama::read(&path).unwrap_err().to_string();
    assert!(error.contains("WebP") && error.contains("expand"), "{error}");
    assert!((TransferFunction::Srgb.linear(0.5) - 0.214_041).abs() < 1e-5);
}

/// A JPEG with an EXIF block that says how it was held.
fn held(image: &DynamicImage, orientation: u8) -> Vec<u8> {
    let mut jpeg = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut jpeg), ImageFormat::Jpeg).unwrap();
    let tiff =
        [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".as_slice(), &[orientation], b"\0\0\0\0\0\0"]
            .concat();
    let mut block = vec![0xFF, 0xE1];
    block.extend(u16::try_from(2 + 6 + tiff.len()).unwrap().to_be_bytes());
    block.extend(b"Exif\0\0");
    block.extend(tiff);
    jpeg.splice(2..2, block);
    jpeg
}

#[test]
fn exif_turns_the_image_upright() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("held.jpg");
    let bright_top = ImageBuffer::from_fn(32, 16, |_, y| Rgb([if y < 8 { 240 } else { 16 }; 3]));
    let upright = DynamicImage::ImageRgb8(bright_top);
    for (orientation, stored) in
        [(1, upright.clone()), (3, upright.rotate180()), (6, upright.rotate270()), (8, upright.rotate90())]
    {
        std::fs::write(&path, held(&stored, orientation)).unwrap();
        let ldr = LdrPanorama::read(&path).unwrap();
        assert_eq!(ldr.grid(), Equirect::new(32, 16), "{orientation}");
        assert!(ldr.values()[40][1] > 0.8 && ldr.values()[32 * 14][1] < 0.2, "{orientation}");
    }
    std::fs::write(&path, held(&upright, 6)).unwrap();
    assert!(LdrPanorama::read(&path).unwrap_err().to_string().contains("16 × 32"));
}

#[test]
fn damaged_oversized_and_foreign_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, content: &[u8], words: &[&str]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = LdrPanorama::read(&path).map(|ldr| ldr.grid()).unwrap_err().to_string();
        words.iter().chain(&[name]).for_each(|w| assert!(error.contains(w), "{name}: no '{w}' in {error}"));
    };
    let mut whole = Vec::new();
    let large = DynamicImage::ImageRgb8(ImageBuffer::from_fn(64, 32, |x, y| Rgb([(x * y) as u8; 3])));
    for (format, name) in
        [(ImageFormat::Png, "PNG"), (ImageFormat::Jpeg, "JPEG"), (ImageFormat::WebP, "WebP")]
    {
        whole.clear();
        large.write_to(&mut std::io::Cursor::new(&mut whole), format).unwrap();
        refused("cut", &whole[..whole.len() / 2], &[name]);
        refused("short", &whole[..20], &[name]);
    }
    // a header that claims 2³⁰ pixels: refused by the claim, not by running out of memory or data
    whole.clear();
    large.write_to(&mut std::io::Cursor::new(&mut whole), ImageFormat::Png).unwrap();
    whole[16..24].copy_from_slice(&[0, 0, 0xB5, 0x06, 0, 0, 0x5A, 0x83]);
    let checksum = crc(&whole[12..29]);
    whole[29..33].copy_from_slice(&checksum.to_be_bytes());
    refused("huge.png", &whole, &["46342 × 23171", "limit"]);
    refused("wide.png", &png(6, 2), &["6 × 2", "twice"]);
    refused("b.avif", b"\0\0\0\x20ftypavis\0\0\0\0mif1", &["Animated AVIF", "convert"]);
    refused("a.tif", b"II*\0rest of it", &["TIFF", "convert"]);
    refused("a.jxl", b"\0\0\0\x0CJXL \r\n\x87\n", &["JPEG XL", "convert"]);
    refused("a.pfm", b"PF\n8 4\n-1.0\n", &["PFM", "convert"]);
    refused("a.png", b"version https://git-lfs.github.com/spec/v1\n", &["Git LFS", "git lfs pull"]);
    refused("b.png", b"<!DOCTYPE html>\n", &["web page", "download"]);
    refused("a.wav", b"RIFF\0\0\0\0WAVEfmt ", &["neither"]);
    refused("nothing", b"", &["empty"]);
    assert!(LdrPanorama::read(folder.path()).unwrap_err().to_string().contains("folder"));
    assert!(!LdrPanorama::recognise(folder.path().join("b.avif")).unwrap());
    let error = Panorama::read(folder.path().join("b.avif")).unwrap_err().to_string();
    assert!(error.contains("AVIF") && error.contains("convert"), "{error}");
    if cfg!(not(feature = "avif")) {
        refused(
            "a.avif",
            b"\0\0\0\x20ftypavif\0\0\0\0mif1",
            &["built without the feature avif", "AVIF", "convert"],
        );
    }
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = DynamicImage::ImageRgb8(ImageBuffer::new(width, height));
    image.write_to(&mut std::io::Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
    bytes
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}
