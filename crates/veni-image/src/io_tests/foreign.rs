//! What other software writes.

use exr::meta::attribute::EnvironmentMap;
use exr::prelude::*;

use super::super::*;
use super::{assert_close, exr_file, folder, plane, rgb, sky};
use crate::Error;
use veni_light::sphere::Equirect;

#[test]
fn every_compression_tiles_and_line_orders() {
    let dir = folder();
    let image = sky(80, 40);
    let path = dir.path().join("c.exr");
    let tiles = Blocks::Tiles(Vec2(32, 24));
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
    ] {
        for (blocks, line_order) in [
            (Blocks::ScanLines, LineOrder::Increasing),
            (Blocks::ScanLines, LineOrder::Decreasing),
            (tiles, LineOrder::Increasing),
            (tiles, LineOrder::Unspecified),
        ] {
            exr_file(&path, (80, 40), rgb(&image), Encoding { compression, blocks, line_order }, |_, _| ());
            // PXR24 keeps 16 bits of a float's significand; the others are lossless for floats
            let tolerance = if compression == Compression::PXR24 { 2e-5 } else { 0.0 };
            assert_close(&image, &Panorama::read(&path).unwrap(), tolerance);
        }
    }
}

/// Lossy: what the library that wrote it reads again is what is there. Sizes that are no multiples of the transform's blocks, alpha
/// in the run-length part, values that compress well and that do not.
#[test]
fn dwa_is_read_as_its_writer_reads_it() {
    let dir = folder();
    let path = dir.path().join("dwa.exr");
    for (width, height) in [(80, 40), (52, 26), (6, 3)] {
        let mut stream = veni_light::random::Stream::from_seed(7);
        let mut noisy = sky(width, height);
        noisy.pixels_mut().as_flattened_mut().iter_mut().for_each(|v| *v *= (stream.normal() as f32).exp());
        for image in [sky(width, height), noisy] {
            let half = |c| FlatSamples::F16(plane(&image, c).into_iter().map(f16::from_f32).collect());
            let float = |c| FlatSamples::F32(plane(&image, c));
            let alpha = || FlatSamples::F16(vec![f16::ONE; width * height]);
            let halves = || vec![("A", alpha()), ("B", half(2)), ("G", half(1)), ("R", half(0))];
            let floats = || vec![("B", float(2)), ("G", float(1)), ("R", float(0))];
            for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
                for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 24))] {
                    for channels in [halves(), floats()] {
                        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
                        exr_file(&path, (width, height), channels, encoding, |_, _| ());
                        let ours = Panorama::read(&path).unwrap();
                        let theirs = read_first_flat_layer_from_file(&path).unwrap();
                        let channels = &theirs.layer_data.channel_data.list;
                        for (c, name) in ["R", "G", "B"].iter().enumerate() {
                            let channel = channels.iter().find(|k| k.name.eq(name)).unwrap();
                            let expected: Vec<f32> = channel.sample_data.values_as_f32().collect();
                            assert_eq!(
                                plane(&ours, c),
                                expected,
                                "{width} x {height}, {compression:?}, {name}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn windows_channels_layers_and_primaries_of_other_software() {
    let dir = folder();
    let path = dir.path().join("x.exr");
    let image = sky(16, 8);
    let plain = Encoding::FAST_LOSSLESS;
    // a display window elsewhere, equal to the data window
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(10, -20);
        shared.display_window.position = Vec2(10, -20);
    });
    assert_eq!(Panorama::read(&path).unwrap().pixels(), image.pixels());
    // a data window inside a larger display window: black around it
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(3, 2);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(24, 12));
    });
    let padded = Panorama::read(&path).unwrap();
    assert_eq!(padded.grid(), Equirect::new(24, 12));
    assert_eq!((padded.pixel(3, 2), padded.pixel(18, 9)), (image.pixel(0, 0), image.pixel(15, 7)));
    assert_eq!((padded.pixel(2, 2), padded.pixel(19, 9)), ([0.0; 3], [0.0; 3]));
    // overscan: a data window larger than the display window is cut, in tiles too
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(-4, -2);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(8, 4));
    });
    let cut = Panorama::read(&path).unwrap();
    assert_eq!((cut.pixel(0, 0), cut.pixel(7, 3)), (image.pixel(4, 2), image.pixel(11, 5)));
    // mixed sample types and an alpha that is ignored
    let uint = plane(&image, 2).iter().map(|v| v.round() as u32).collect::<Vec<_>>();
    let half = plane(&image, 0).iter().map(|&v| f16::from_f32(v)).collect::<Vec<_>>();
    let channels = vec![
        ("A", FlatSamples::F16(vec![f16::ZERO; 128])),
        ("R", FlatSamples::F16(half)),
        ("G", FlatSamples::F32(plane(&image, 1))),
        ("B", FlatSamples::U32(uint)),
    ];
    exr_file(&path, (16, 8), channels, plain, |_, _| ());
    let [r, g, b] = Panorama::read(&path).unwrap().pixel(9, 4);
    let [x, y, z] = image.pixel(9, 4);
    assert!((r - x).abs() < 5e-4 * x && g == y && b == z.round());
    // luminance alone
    exr_file(&path, (16, 8), vec![("Y", FlatSamples::F32(plane(&image, 1)))], plain, |_, _| ());
    assert_eq!(Panorama::read(&path).unwrap().pixel(5, 5), [image.pixel(5, 5)[1]; 3]);
    // no colour at all
    exr_file(&path, (16, 8), vec![("Z", FlatSamples::F32(plane(&image, 1)))], plain, |_, _| ());
    assert!(Panorama::read(&path).unwrap_err().to_string().contains("among: Z"));
    // a named main layer beside another; and two that nothing tells apart
    let named = |a: &'static str, b: &'static str| {
        let mut channels = Vec::new();
        for (layer, offset) in [(a, 0.0), (b, 1000.0)] {
            for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
                let samples = plane(&image, i).iter().map(|v| v + offset).collect();
                channels.push((format!("{layer}.{name}"), FlatSamples::F32(samples)));
            }
        }
        let channels: Vec<_> = channels.iter().map(|(n, s)| (n.as_str(), s.clone())).collect();
        exr_file(&path, (16, 8), channels, plain, |_, _| ());
    };
    named("View.Combined", "View.Diffuse");
    assert_eq!(Panorama::read(&path).unwrap().pixels(), image.pixels());
    named("left", "right");
    assert!(Panorama::read(&path).unwrap_err().to_string().contains("\"left\", \"right\""));
    let pick = ReadOptions { layer: Some("left".into()), ..ReadOptions::default() };
    assert_eq!(Panorama::read_with(&path, &pick).unwrap().pixels(), image.pixels());
    // other primaries are converted, white stays white
    let grey = Panorama::new(image.grid(), vec![[0.5; 3]; 128]);
    exr_file(&path, (16, 8), rgb(&grey), plain, |shared, _| {
        let xy = [Vec2(0.713, 0.293), Vec2(0.165, 0.830), Vec2(0.128, 0.044), Vec2(0.321_68, 0.337_67)];
        let [red, green, blue, white] = xy;
        shared.chromaticities = Some(attribute::Chromaticities { red, green, blue, white });
    });
    assert_close(&grey, &Panorama::read(&path).unwrap(), 1e-5);
    // a cube map is not a panorama
    exr_file(&path, (16, 8), rgb(&image), plain, |_, own| own.environment_map = Some(EnvironmentMap::Cube));
    assert!(
        matches!(Panorama::read(&path), Err(Error::Unsupported { message, .. }) if message.contains("cube"))
    );
}

/// Halves are exact in every lossless compression; B44 and PXR24 keep what their definitions keep of them.
#[test]
fn halves_of_every_compression_come_back_to_the_bit() {
    let dir = folder();
    let path = dir.path().join("h.exr");
    let image = sky(80, 40);
    let half = |v: f32| f16::from_f32(v);
    let channels = || -> Vec<(&'static str, FlatSamples)> {
        let plane = |c: usize| FlatSamples::F16(plane(&image, c).into_iter().map(half).collect());
        ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| (name, plane(c))).collect()
    };
    let rounded: Vec<_> = image.pixels().iter().map(|p| p.map(|v| half(v).to_f32())).collect();
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 24))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            exr_file(&path, (80, 40), channels(), encoding, |_, _| ());
            assert_eq!(Panorama::read(&path).unwrap().pixels(), rounded, "{compression:?}, {blocks:?}");
        }
    }
}

/// Of a file with smaller levels the largest is read.
#[test]
fn mip_levels_do_not_disturb() {
    let dir = folder();
    let path = dir.path().join("mip.exr");
    let image = sky(32, 16);
    let levels = |channel: usize| {
        let plane = plane(&image, channel);
        let level = |shift: usize| {
            let (width, height) = ((32 >> shift).max(1), (16usize >> shift).max(1));
            let at = |k: usize| plane[((k / width) << shift).min(15) * 32 + ((k % width) << shift).min(31)];
            FlatSamples::F32(
                (0..width * height).map(|k| if shift == 0 { plane[k] } else { 7.0 * at(k) }).collect(),
            )
        };
        Levels::Mip { rounding_mode: exr::math::RoundingMode::Down, level_data: (0..6).map(level).collect() }
    };
    let list = [("B", 2), ("G", 1), ("R", 0)].map(|(name, c)| AnyChannel::new(name, levels(c)));
    let encoding = Encoding { blocks: Blocks::Tiles(Vec2(16, 16)), ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new(
        (32, 16),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(list.into_iter().collect()),
    );
    Image::from_layer(layer).write().to_file(&path).unwrap();
    assert_eq!(Panorama::read(&path).unwrap().pixels(), image.pixels());
}

/// Two parts: each by its name, and the one that is called like a picture without.
#[test]
fn parts_are_layers() {
    let dir = folder();
    let path = dir.path().join("parts.exr");
    let images =
        [sky(16, 8), Panorama::from_fn(Equirect::new(16, 8), |[x, y, z]| [2.0 + x, 3.0 + y, 4.0 + z])];
    let write = |names: [&str; 2]| {
        let layer = |(image, name): (&Panorama, &str)| {
            let channels = rgb(image).into_iter().map(|(n, s)| AnyChannel::new(n, s)).collect();
            Layer::new(
                (16, 8),
                LayerAttributes::named(name),
                Encoding::FAST_LOSSLESS,
                AnyChannels::sort(channels),
            )
        };
        let layers: Vec<_> = images.iter().zip(names).map(layer).collect();
        let attributes = ImageAttributes::with_size((16, 8));
        Image::from_layers(attributes, layers).write().to_file(&path).unwrap();
    };
    let named = |name: &str| ReadOptions { layer: Some(name.to_owned()), ..ReadOptions::default() };
    write(["left", "right"]);
    for (image, name) in images.iter().zip(["left", "right"]) {
        assert_eq!(Panorama::read_with(&path, &named(name)).unwrap().pixels(), image.pixels(), "{name}");
    }
    let Err(Error::Layers { path: of, wanted, layers }) = Panorama::read(&path) else { panic!("two layers") };
    assert_eq!((of, wanted, layers), (path.clone(), None, vec!["left".to_owned(), "right".to_owned()]));
    let missing = Panorama::read_with(&path, &named("middle")).unwrap_err();
    assert!(matches!(&missing, Error::Layers { wanted: Some(w), .. } if w == "middle"), "{missing}");
    write(["albedo", "C"]);
    assert_eq!(Panorama::read(&path).unwrap().pixels(), images[1].pixels());
    write(["N", "radiance"]);
    assert_eq!(Panorama::read(&path).unwrap().pixels(), images[1].pixels());
}
