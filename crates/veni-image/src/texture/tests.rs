//! Files read back: KTX2 by the crate that Bevy uses, the others by their own rules.

use veni_light::light::CubeMap;

use super::*;

/// Levels whose texels all differ.
fn levels(size: usize, count: usize) -> Vec<CubeMap> {
    (0..count)
        .map(|k| {
            let size = size >> k;
            let texels = (0..6 * size * size).map(|t| [1.0 + t as f32 / 64.0, (k + 1) as f32, 0.25]);
            CubeMap::new(size, texels.collect())
        })
        .collect()
}

#[test]
fn a_ktx2_file_is_what_another_reader_reads() {
    for (format, vk, descriptor) in [
        (TexelFormat::E5B9G9R9, ::ktx2::Format::E5B9G9R9_UFLOAT_PACK32, 0x7c),
        (TexelFormat::Rgba16F, ::ktx2::Format::R16G16B16A16_SFLOAT, 0x5c),
    ] {
        let levels = levels(8, 4);
        let file = super::ktx2(&levels, format).unwrap();
        assert_eq!(file, super::ktx2(&levels, format).unwrap());
        let reader = ::ktx2::Reader::new(&file[..]).unwrap();
        let header = reader.header();
        assert_eq!(header.format, Some(vk));
        assert_eq!(
            (header.pixel_width, header.pixel_height, header.face_count, header.level_count),
            (8, 8, 6, 4)
        );
        assert_eq!((header.pixel_depth, header.layer_count, header.supercompression_scheme), (0, 0, None));
        assert_eq!(header.index.dfd_byte_length, descriptor);
        for (level, data) in levels.iter().zip(reader.levels()) {
            assert_eq!(data.data.len(), level.texels().len() * format.bytes());
            for (texel, bytes) in level.texels().iter().zip(data.data.chunks_exact(format.bytes())) {
                let found = match format {
                    TexelFormat::E5B9G9R9 => decode_e5b9g9r9(u32::from_le_bytes(bytes.try_into().unwrap())),
                    _ => [0, 2, 4].map(|k| half::f16::from_le_bytes([bytes[k], bytes[k + 1]]).to_f32()),
                };
                for (a, b) in found.into_iter().zip(texel) {
                    assert!((a - b).abs() < texel[0].max(texel[1]) / 500.0, "{found:?} for {texel:?}");
                }
            }
        }
        let keys: Vec<_> = reader.key_value_data().collect();
        assert_eq!(keys.len(), 2);
        assert_eq!(keys[0], ("KTXorientation", &b"rd\0"[..]));
        assert_eq!(reader.dfd_blocks().len(), 1);
        // a file cut short is refused
        assert!(::ktx2::Reader::new(&file[..file.len() - 1]).is_err());
        let own = Ktx2Header::read(&file).unwrap();
        assert_eq!((own.vk_format, own.width, own.faces, own.levels), (vk.value(), 8, 6, 4));
    }
}

#[test]
fn a_ktx1_file_is_laid_out_as_the_format_says() {
    let levels = levels(4, 3);
    let file = ktx1(&levels, &[("sh", "1 2 3\n")]).unwrap();
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
    assert_eq!(&file[1..7], b"KTX 11");
    assert_eq!(
        [word(12), word(16), word(28), word(36), word(52), word(56)],
        [0x0403_0201, 0x8C3B, 0x8C3A, 4, 6, 3]
    );
    let mut at = 64 + word(60) as usize;
    assert_eq!(&file[68..77], b"sh\x001 2 3\n");
    for level in &levels {
        let face = word(at) as usize;
        assert_eq!(face, level.size() * level.size() * 4);
        at += 4;
        for (k, texel) in level.texels().iter().enumerate() {
            let found = decode_r11g11b10(word(at + 4 * k));
            for (a, b) in found.into_iter().zip(texel) {
                assert!((a - b).abs() < b / 60.0, "{found:?} for {texel:?}");
            }
        }
        at += 6 * face;
    }
    assert_eq!(at, file.len());
}

#[test]
fn rgbd_keeps_radiance_to_a_percent_or_two() {
    for v in [0.01f32, 0.2, 0.99, 1.0, 1.5, 7.0, 100.0, 254.0] {
        let found = from_rgbd(rgbd([v, 0.7 * v, 0.5 * v]));
        for (a, b) in found.into_iter().zip([v, 0.7 * v, 0.5 * v]) {
            assert!((a - b).abs() < 0.03 * v + 1e-3, "{b} became {a}");
        }
    }
    assert_eq!(rgbd([0.5, 0.0, 0.0])[3], 255);
    assert!(rgbd_png(1, &[[256.0, 0.0, 0.0]]).unwrap_err().to_string().contains("255"));
}

#[test]
fn an_env_file_holds_six_images_per_level() {
    let levels = levels(8, 4);
    let irradiance = std::array::from_fn(|k| [k as f32 + 0.5, 1.0, -0.25]);
    let file = env(&levels, &irradiance).unwrap();
    let header = EnvHeader::read(&file).unwrap();
    assert_eq!((header.version, header.width, header.specular.mipmaps.len()), (1, 8, 24));
    let json = file.iter().position(|b| *b == 0).unwrap();
    let value: serde_json::Value = serde_json::from_slice(&file[8..json]).unwrap();
    assert_eq!(value["irradiance"]["xy"], serde_json::json!([8.5, 1, -0.25]));
    for (k, image) in header.specular.mipmaps.iter().enumerate() {
        let bytes = &file[json + 1 + image.position as usize..][..image.length as usize];
        // upside down, as Babylon.js uploads it
        let decoded = image::load_from_memory(bytes).unwrap().flipv().to_rgba8();
        let level = &levels[k / 6];
        assert_eq!(decoded.width() as usize, level.size());
        let area = level.size() * level.size();
        for (pixel, texel) in decoded.pixels().zip(&level.texels()[k % 6 * area..][..area]) {
            for (a, b) in from_rgbd(pixel.0).into_iter().zip(texel) {
                assert!((a - b).abs() < 0.03 * texel[0].max(texel[1]), "{a} for {b}");
            }
        }
    }
    let last = header.specular.mipmaps[23];
    assert_eq!(json as u64 + 1 + last.position + last.length, file.len() as u64);
}

#[test]
fn damaged_headers_are_refused() {
    assert!(Ktx2Header::read(b"KTX").is_err());
    let file = super::ktx2(&levels(2, 1), TexelFormat::E5B9G9R9).unwrap();
    assert!(Ktx2Header::read(&file[..40]).unwrap_err().to_string().contains("40 bytes"));
    let mut odd = file.clone();
    odd[36] = 5;
    assert!(Ktx2Header::read(&odd).unwrap_err().to_string().contains("5 faces"));
    let file = env(&levels(2, 2), &[[0.0; 3]; 9]).unwrap();
    assert!(EnvHeader::read(&file[..30]).unwrap_err().to_string().contains("does not end"));
    assert!(EnvHeader::read(b"{}").is_err());
}
