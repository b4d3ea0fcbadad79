//! Files made by code, each a little beyond a limit, and beside it one a little within.

use std::io::Cursor;

use super::*;

fn chunk(name: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let mut chunk = (body.len() as u32).to_be_bytes().to_vec();
    chunk.extend(name);
    chunk.extend(body);
    // checksums are the decoder's business
    chunk.extend([0; 4]);
    chunk
}

/// A PNG of 16 × 8 pixels with these chunks between its header and its end.
fn png(depth: u8, colour: u8, chunks: &[Vec<u8>]) -> Vec<u8> {
    let header = [&[0, 0, 0, 16, 0, 0, 0, 8, depth, colour, 0, 0, 0][..]].concat();
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    file.extend(chunk(b"IHDR", &header));
    file.extend(chunks.concat());
    file.extend(chunk(b"IEND", &[]));
    file
}

fn look(format: ImageFormat, file: Vec<u8>) -> Result<Size> {
    ldr(&mut Cursor::new(file), Path::new("a"), format)
}

fn refused(found: Result<Size>, words: &[&str]) {
    let error = found.unwrap_err();
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "'{word}' is missing in: {text}");
    }
    assert!(matches!(error, Error::TooLarge { .. }) == words.contains(&"limit"), "{text}");
}

#[test]
fn palettes_are_whole_entries_that_indices_reach() {
    let palette =
        |depth, bytes: usize| look(ImageFormat::Png, png(depth, 3, &[chunk(b"PLTE", &vec![1; bytes])]));
    for (depth, bytes) in [(8, 3), (8, 768), (4, 48), (1, 6)] {
        assert_eq!(palette(depth, bytes).unwrap(), Some([16, 8]), "{bytes} bytes");
    }
    for (depth, bytes) in [(8, 0), (8, 4), (8, 5), (8, 771)] {
        refused(palette(depth, bytes), &["palette", &format!("{bytes} bytes")]);
    }
    refused(palette(1, 9), &["3 entries", "1 bits"]);
    // a suggested palette of a coloured image may have any number
    assert!(look(ImageFormat::Png, png(8, 2, &[chunk(b"PLTE", &[0; 768])])).is_ok());
}

#[test]
fn indices_lie_within_the_palette() {
    let image = |depth: ::png::BitDepth, entries: usize, index: u8| {
        let mut out = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut out, 5, 2);
        encoder.set_color(::png::ColorType::Indexed);
        encoder.set_depth(depth);
        encoder.set_palette(vec![9; 3 * entries]);
        let mut writer = encoder.write_header().unwrap();
        // two pixels to a byte, the last half of a row unused
        let data = match depth {
            ::png::BitDepth::Four => vec![0x01, 0x10, 0x0F, 0x01, index << 4, 0x1F],
            _ => vec![0, 1, 1, 0, 0, 0, 1, index, 0, 0],
        };
        writer.write_image_data(&data).unwrap();
        drop(writer);
        look(ImageFormat::Png, out)
    };
    for depth in [::png::BitDepth::Four, ::png::BitDepth::Eight] {
        assert_eq!(image(depth, 3, 2).unwrap(), Some([5, 2]));
        refused(image(depth, 3, 3), &["colour 3", "palette of 3"]);
        assert!(image(depth, 4, 3).is_ok());
    }
}

#[test]
fn profiles_are_measured_without_being_kept() {
    let profile = |bytes: usize| {
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(&vec![7; bytes], 1);
        let body = [&b"name\0\0"[..], &packed].concat();
        assert!(body.len() < 1 << 20, "a small chunk: {}", body.len());
        look(ImageFormat::Png, png(8, 2, &[chunk(b"iCCP", &body)]))
    };
    assert!(profile(MAX_PROFILE_BYTES as usize).is_ok());
    refused(profile(MAX_PROFILE_BYTES as usize + 1), &["colour profile", "limit"]);
    // damaged and cut ones are the decoder's
    assert!(look(ImageFormat::Png, png(8, 2, &[chunk(b"iCCP", b"name\0\0nothing")])).is_ok());
    assert!(look(ImageFormat::Png, png(8, 2, &[chunk(b"iCCP", b"name")])).is_ok());
}

#[test]
fn metadata_is_counted() {
    let text = vec![chunk(b"tEXt", b"a\0b"); MAX_METADATA_PIECES + 1];
    assert!(look(ImageFormat::Png, png(8, 2, &text[1..])).is_ok());
    refused(look(ImageFormat::Png, png(8, 2, &text)), &["chunks of metadata", "limit"]);
    // the file need not have what its chunks claim
    let mut claim = png(8, 2, &[]);
    claim.truncate(claim.len() - 12);
    claim.extend([4, 0, 0, 1]);
    claim.extend(b"zTXt");
    refused(look(ImageFormat::Png, claim), &["67108865 bytes of metadata", "limit"]);

    let jpeg =
        |segments: &[u8]| look(ImageFormat::Jpeg, [&[0xFF, 0xD8][..], segments, &[0xFF, 0xD9]].concat());
    let frame = [0xFF, 0xC2, 0, 8, 8, 0, 5, 0, 9, 0];
    let scan = [0xFF, 0xDA, 0, 2, 17, 0xFF, 0, 0xFF, 0xD0, 3];
    assert_eq!(jpeg(&[&frame[..], &scan.repeat(MAX_SCANS)].concat()).unwrap(), Some([9, 5]));
    refused(jpeg(&[&frame[..], &scan.repeat(MAX_SCANS + 1)].concat()), &["scans", "limit"]);
    let application = [0xFF, 0xE1, 0, 2].repeat(MAX_METADATA_PIECES + 1);
    assert!(jpeg(&application[4..]).is_ok());
    refused(jpeg(&application), &["segments of metadata", "limit"]);
    let other = [0xFF, 0xC2, 0, 8, 8, 0, 5, 0, 10, 0];
    refused(jpeg(&[frame, other].concat()), &["two frames"]);
}

#[test]
fn webp_chunks_lie_within_the_file() {
    let webp = |size: u32, chunks: &[u8]| {
        let head = [&b"RIFF"[..], &size.to_le_bytes(), b"WEBP"].concat();
        look(ImageFormat::WebP, [&head, chunks].concat())
    };
    let lossless = [&b"VP8L\x06\0\0\0\x2f"[..], &(15_u32 | 7 << 14).to_le_bytes(), &[0]].concat();
    assert_eq!(webp(18, &lossless).unwrap(), Some([16, 8]));
    // what follows the container does not matter
    assert!(webp(18, &[&lossless[..], b"EXIF\xff\xff\xff\xff"].concat()).is_ok());
    refused(webp(30, &[&lossless[..], b"EXIF\xff\xff\xff\xff"].concat()), &["truncated WebP"]);
    let extended = [&b"VP8X\x0a\0\0\0"[..], &[0; 4], &[15, 0, 0, 7, 0, 0]].concat();
    assert_eq!(webp(22, &extended).unwrap(), Some([16, 8]));
}

#[test]
fn radiance_headers_end() {
    let look = |text: Vec<u8>| hdr(&mut Cursor::new(text), Path::new("a"));
    let file = |lines: &str| format!("#?RADIANCE\n{lines}\n-Y 8 +X 16\n").into_bytes();
    assert_eq!(look(file("FORMAT=32-bit_rle_rgbe\n")).unwrap(), Some([16, 8]));
    assert!(look(file(&"A=1\n".repeat(MAX_HDR_HEADER_LINES - 10))).is_ok());
    refused(look(file(&"A=1\n".repeat(MAX_HDR_HEADER_LINES + 1))), &["lines of header", "limit"]);
    let mut endless = b"#?RADIANCE\n".to_vec();
    endless.resize(MAX_HDR_HEADER_BYTES as usize + 10, b'A');
    refused(look(endless.clone()), &["bytes of header", "limit"]);
    // within the limits, what is no header is the reader's business
    endless.truncate(1000);
    assert_eq!(look(endless).unwrap(), None);
}

use crate::limits::{
    MAX_EXR_ATTRIBUTES, MAX_EXR_HEADER_BYTES, MAX_HDR_HEADER_BYTES, MAX_HDR_HEADER_LINES,
    MAX_METADATA_PIECES, MAX_PROFILE_BYTES, MAX_SCANS,
};

#[test]
fn exr_headers_are_walked() {
    let attribute = |name: &str, kind: &str, length: u32, value: &[u8]| {
        [name.as_bytes(), &[0], kind.as_bytes(), &[0], &length.to_le_bytes(), value].concat()
    };
    let look = |version: u32, attributes: &[u8]| {
        let file = [&[0x76, 0x2f, 0x31, 1][..], &version.to_le_bytes(), attributes].concat();
        exr(&mut Cursor::new(file), Path::new("a"))
    };
    let window = |right: i32, bottom: i32| -> Vec<u8> {
        [0, 0, right, bottom].iter().flat_map(|n| n.to_le_bytes()).collect()
    };
    let small = attribute("dataWindow", "box2i", 16, &window(15, 7));
    let large = attribute("displayWindow", "box2i", 16, &window(31, 15));
    assert_eq!(look(2, &[&small[..], &large, &[0]].concat()).unwrap(), Some([32, 16]));
    // the pixels of a file of one part are no second part
    let many = attribute("a", "int", 0, &[]).repeat(MAX_EXR_ATTRIBUTES);
    assert!(look(2, &[&small[..], &[0], &many, &many].concat()).is_ok());
    assert!(look(2, &many).is_ok());
    refused(look(2, &[&small[..], &many].concat()), &["attributes of a part", "limit"]);
    let claim = attribute("a", "string", MAX_EXR_HEADER_BYTES as u32, &[]);
    refused(look(2, &claim), &["bytes of header", "limit"]);
    let parts = [&small[..], &[0]].concat().repeat(257);
    refused(look(2 | 1 << 12, &[&parts[..], &small].concat()), &["parts", "limit"]);
    assert!(look(2 | 1 << 12, &parts[..parts.len() / 257 * 256]).is_ok());
}
