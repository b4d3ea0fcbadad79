//! Folders against the engines' conventions, written down here once more as the engines see them: six directions with a colour each,
//! and a sun.

use std::path::Path;

use veni_light::light::EnvironmentMap;
use veni_light::progress::Silent;
use veni_light::sphere::{CubeFace, Equirect};

use super::*;
use crate::texture::from_rgbd;

/// Radiance that tells every direction from every other.
fn colour(d: [f32; 3]) -> [f32; 3] {
    d.map(|v| 2.0 + 1.5 * v)
}

fn panorama() -> Panorama {
    Panorama::from_fn(Equirect::new(256, 128), colour)
}

fn sun() -> CompactLight {
    CompactLight::new([0.48, 0.64, 0.6], [6.0, 5.0, 4.0], CompactLight::SUN_RADIUS)
}

/// Writes a folder and hands it to a check.
fn folder(engine: Engine, split: bool, check: impl FnOnce(&Path)) {
    let panorama = panorama();
    let map = EnvironmentMap::new(panorama.grid(), panorama.pixels()).unwrap();
    let size = 32;
    let levels: Vec<Levels> = engine.levels(size).into_iter().collect();
    let prefilter = Prefilter::new(map, &levels);
    let sky = Sky {
        prefilter: &prefilter,
        panorama: &panorama,
        sh: &Sh::of(map),
        background: &panorama,
        sun: split.then(sun),
        size,
        exposure: 1000.0,
        sampling: None,
    };
    let place = tempfile::tempdir().unwrap();
    let target = place.path().join(engine.name());
    let files = write(engine, &sky, &target, Overwrite::Refuse, &Silent).unwrap();
    let listed = std::fs::read_dir(&target).unwrap().count();
    assert_eq!(files.len(), listed, "{engine:?}: {files:?}");
    assert!(files.iter().all(|f| f.is_file()));
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1, "nothing else stays");
    // once more is refused, and replaced if asked to, with the same bytes
    assert!(matches!(
        write(engine, &sky, &target, Overwrite::Refuse, &Silent),
        Err(crate::Error::Exists { .. })
    ));
    let bytes = |f: &PathBuf| std::fs::read(f).unwrap();
    let before: Vec<_> = files.iter().map(bytes).collect();
    write(engine, &sky, &target, Overwrite::Replace, &Silent).unwrap();
    assert_eq!(before, files.iter().map(bytes).collect::<Vec<_>>(), "{engine:?}: other bytes");
    check(&target);
}

fn text(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// The numbers behind a word of a text, up to three.
fn numbers(text: &str, after: &str) -> [f32; 3] {
    let at = text.find(after).unwrap_or_else(|| panic!("{after:?} is not in {text}")) + after.len();
    let mut found = text[at..]
        .split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | 'e')))
        .filter_map(|word| word.parse().ok());
    std::array::from_fn(|_| found.next().unwrap_or(f32::NAN))
}

fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4 * y.abs().max(1.0))
}

/// The first level of a cube against the lookup vectors that an engine has for the centre, the left quarter and the top of the
/// panorama; `texel` reads it at (face, row, column).
fn looks_up(
    name: &str,
    [centre, left, top]: [[f64; 3]; 3],
    size: usize,
    texel: impl Fn(usize, usize, usize) -> [f32; 3],
) {
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    for face in CubeFace::ALL {
        for k in 0..size * size {
            let (row, column) = (k / size, k % size);
            let at = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
            let v = face.lookup(at(column), at(row));
            let length = dot(v, v).sqrt();
            // native: the centre is +x, the left quarter +y, the top +z
            let native = [dot(v, centre), dot(v, left), dot(v, top)].map(|c| (c / length) as f32);
            let found = texel(face as usize, row, column);
            for (a, b) in found.into_iter().zip(colour(native)) {
                assert!(
                    (a - b).abs() < 0.08,
                    "{name}, {face:?} ({column}, {row}): {found:?} in direction {native:?}"
                );
            }
        }
    }
}

#[test]
fn bevy_sees_what_is_there() {
    folder(Engine::Bevy, true, |folder| {
        // centre at −z, left at −x, right at +x, seam at +z, and z negated before the lookup
        let v = [[0., 0., 1.], [-1., 0., 0.], [0., 1., 0.]];
        for (file, levels, size, contrast) in
            [("specular.ktx2", 3, 32, 1.0), ("diffuse.ktx2", 1, 32, 2.0 / 3.0), ("skybox.ktx2", 1, 64, 1.0)]
        {
            // what Bevy's loader asks of a file: no supercompression, six faces, a format that it knows
            let bytes = std::fs::read(folder.join(file)).unwrap();
            let reader = ktx2::Reader::new(&bytes[..]).unwrap();
            let header = reader.header();
            assert_eq!((header.level_count, header.pixel_width, header.pixel_height), (levels, size, size));
            assert_eq!((header.face_count, header.layer_count, header.pixel_depth), (6, 0, 0), "{file}");
            assert_eq!(header.supercompression_scheme, None, "{file}");
            assert_eq!(header.format, Some(ktx2::Format::E5B9G9R9_UFLOAT_PACK32), "{file}");
            for (k, level) in reader.levels().enumerate() {
                assert_eq!(level.data.len(), 4 * 6 * (size as usize >> k).pow(2), "{file}, level {k}");
            }
            let level = reader.levels().next().unwrap().data.to_vec();
            let size = size as usize;
            looks_up(file, v, size, |face, row, column| {
                let at = 4 * ((face * size + row) * size + column);
                let texel = level[at..at + 4].try_into().unwrap();
                // light of a single band is diffused by the factor of that band
                crate::texture::decode_e5b9g9r9(u32::from_le_bytes(texel)).map(|c| 2.0 + (c - 2.0) / contrast)
            });
        }
        let code = text(folder, "sky.rs");
        // s = (0.48, 0.64, 0.6) native is (−0.64, 0.6, −0.48) in Bevy; light looks along −s
        assert!(close(numbers(&code, "looking_to(Vec3::new("), [0.64, -0.6, 0.48]), "{code}");
        let y = crate::luminance([6.0, 5.0, 4.0]);
        assert!((numbers(&code, "illuminance: ")[0] - 1000.0 * y).abs() < 0.1);
        assert!(close(numbers(&code, "linear_rgb("), [6.0 / y, 5.0 / y, 4.0 / y]));
        assert!(code.contains("insert_resource(GlobalAmbientLight::NONE)"), "{code}");
    });
}

#[test]
fn three_sees_what_is_there() {
    folder(Engine::Three, true, |folder| {
        let bytes = std::fs::read(folder.join("sky.ktx2")).unwrap();
        let reader = ktx2::Reader::new(&bytes[..]).unwrap();
        let level = reader.levels().next().unwrap().data.to_vec();
        // centre at +x, left at −z, right at +z, seam at −x, and x negated before the lookup
        let v = [[-1., 0., 0.], [0., 0., -1.], [0., 1., 0.]];
        looks_up("three", v, 32, |face, row, column| {
            let at = 8 * ((face * 32 + row) * 32 + column);
            [0, 2, 4].map(|k| half::f16::from_le_bytes([level[at + k], level[at + k + 1]]).to_f32())
        });
        let code = text(folder, "sky.js");
        // native (x, y, z) is (x, z, −y)
        assert!(close(numbers(&code, "sun.position.set("), [0.48, 0.6, -0.64]), "{code}");
        assert!(close(numbers(&code, "new THREE.Color("), [1.0, 5.0 / 6.0, 4.0 / 6.0]));
        let json: serde_json::Value = serde_json::from_str(&text(folder, "sun.json")).unwrap();
        assert_eq!(json["intensity"], 6.0);
    });
}

#[test]
fn filament_sees_what_is_there() {
    folder(Engine::Filament, true, |folder| {
        let bytes = std::fs::read(folder.join("sky_ibl.ktx")).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let data = 64 + word(60) as usize + 4;
        // centre at +z, left at +x, right at −x, seam at −z
        let v = [[0., 0., 1.], [1., 0., 0.], [0., 1., 0.]];
        looks_up("filament", v, 32, |face, row, column| {
            crate::texture::decode_r11g11b10(word(data + 4 * ((face * 32 + row) * 32 + column)))
        });
        let code = text(folder, "sky.cpp");
        assert!(close(numbers(&code, "direction({"), [-0.64, -0.6, -0.48]), "{code}");
        // the constant of nine numbers is the mean of E/π, which is that of radiance
        let sh = text(folder, "sh.txt");
        let first = numbers(&sh, "");
        let mean =
            panorama().environment().unwrap().integral().map(|v| (v / (4.0 * std::f64::consts::PI)) as f32);
        assert!(first.iter().zip(mean).all(|(a, b)| (a - b).abs() < 1e-3), "{first:?} for {mean:?}");
        assert_eq!(sh.lines().count(), 9);
    });
}

#[test]
fn babylon_sees_what_is_there() {
    folder(Engine::Babylon, true, |folder| {
        let bytes = std::fs::read(folder.join("sky.env")).unwrap();
        let header = crate::texture::EnvHeader::read(&bytes).unwrap();
        assert_eq!(header.specular.mipmaps.len(), 6 * 6);
        let start = bytes.iter().position(|b| *b == 0).unwrap() + 1;
        let faces: Vec<_> = header.specular.mipmaps[..6]
            .iter()
            .map(|i| {
                image::load_from_memory(&bytes[start + i.position as usize..][..i.length as usize])
                    .unwrap()
                    .to_rgba8()
            })
            .collect();
        // left-handed: centre at +z, left at −x, right at +x, seam at −z
        let v = [[0., 0., 1.], [-1., 0., 0.], [0., 1., 0.]];
        looks_up("babylon", v, 32, |face, row, column| {
            // the first row of an image is the bottom of a face
            from_rgbd(faces[face].get_pixel(column as u32, 31 - row as u32).0)
        });
        let code = text(folder, "sky.js");
        // native (x, y, z) is (−y, z, x)
        assert!(close(numbers(&code, "BABYLON.Vector3("), [0.64, -0.6, -0.48]), "{code}");
        assert!((numbers(&code, "sun.intensity = ")[0] - 6.0).abs() < 1e-5);
    });
}

#[test]
fn panoramas_and_suns_of_the_others() {
    // (engine, file of the panorama, text file, words before the sun's vector, that vector)
    let cases = [
        (Engine::Blender, "sky.py", "mathutils.Vector((", [0.48, 0.64, 0.6]),
        (Engine::Mitsuba, "sky.xml", "name=\"direction\"", [-0.64, -0.6, -0.48]),
        (Engine::Pbrt, "sky.pbrt", "\"point3 from\" [", [0.48, 0.64, 0.6]),
        (Engine::Any, "light.json", "\"direction\":", [0.48, 0.64, 0.6]),
    ];
    for (engine, file, words, vector) in cases {
        folder(engine, true, |folder| {
            let code = text(folder, file);
            assert!(close(numbers(&code, words), vector), "{engine:?}: {code}");
            if engine != Engine::Pbrt {
                let read = Panorama::read(folder.join("sky.exr")).unwrap();
                assert!(
                    read.pixels()
                        .iter()
                        .zip(panorama().pixels())
                        .all(|(a, b)| (0..3).all(|k| (a[k] - b[k]).abs() < 2e-3))
                );
            }
        });
    }
    for (engine, file) in [(Engine::Godot, "sky.tscn"), (Engine::Usd, "sky.usda")] {
        folder(engine, true, |folder| {
            let code = text(folder, file);
            if engine == Engine::Godot {
                // rows of the basis: the third of each is s in Bevy's frame
                let at = code.find("Transform3D(").unwrap() + 12;
                let all: Vec<f32> = code[at..code[at..].find(')').unwrap() + at]
                    .split(", ")
                    .map(|v| v.parse().unwrap())
                    .collect();
                assert!(close([all[2], all[5], all[8]], [-0.64, 0.6, -0.48]), "{all:?}");
                assert!((numbers(&code, "light_energy = ")[0] - 6.0 / std::f32::consts::PI).abs() < 1e-4);
            } else {
                // rows are axes: the third is s
                let at = code.find("xformOp:transform = (").unwrap();
                let third = code[at..].split("), (").nth(2).unwrap();
                assert!(close(numbers(third, ""), [0.64, 0.6, 0.48]), "{code}");
            }
        });
    }
}

#[test]
fn equal_area_squares_show_the_landmarks() {
    folder(Engine::Pbrt, false, |folder| {
        let square = crate::Picture::read(folder.join("sky_equiarea.exr")).unwrap();
        let n = square.size()[0];
        // z up, the centre of the panorama at +x: the middle of the right edge
        for ((i, j), d) in [
            ((n - 1, n / 2), [1., 0., 0.]),
            ((n / 2, n - 1), [0., 1., 0.]),
            ((n / 2, 0), [0., -1., 0.]),
            ((0, n / 2), [-1., 0., 0.]),
            ((n / 2, n / 2), [0., 0., 1.]),
            ((0, 0), [0., 0., -1.]),
        ] {
            let found = square.pixels()[j * n + i];
            assert!(found.iter().zip(colour(d)).all(|(a, b)| (a - b).abs() < 0.05), "{d:?}: {found:?}");
        }
        assert!(!text(folder, "sky.pbrt").contains("distant"));
    });
}

#[test]
fn a_glb_holds_every_face_and_the_sun() {
    folder(Engine::Gltf, true, |folder| {
        let bytes = std::fs::read(folder.join("sky.glb")).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(8)), (&b"glTF"[..], bytes.len()));
        let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + word(12)]).unwrap();
        let data = &bytes[28 + word(12)..];
        assert_eq!(word(20 + word(12)), data.len());
        let light = &json["extensions"]["EXT_lights_image_based"]["lights"][0];
        assert_eq!(light["specularImages"].as_array().unwrap().len(), 2);
        // the loader's world is (−x, y, z) of glTF's: centre at −x, left at −z, right at +z, seam at +x
        let v = [[-1., 0., 0.], [0., 0., -1.], [0., 1., 0.]];
        looks_up("gltf", v, 32, |face, row, column| {
            let view = &json["bufferViews"][face];
            let at = view["byteOffset"].as_u64().unwrap() as usize;
            let png = &data[at..at + view["byteLength"].as_u64().unwrap() as usize];
            let face = image::load_from_memory(png).unwrap().to_rgba8();
            // the first row of an image is the bottom of a face
            from_rgbd(face.get_pixel(column as u32, 31 - row as u32).0)
        });
        let z: Vec<f64> = (8..11).map(|k| json["nodes"][0]["matrix"][k].as_f64().unwrap()).collect();
        assert!(z.iter().zip([0.48, 0.6, -0.64]).all(|(a, b)| (a - b).abs() < 1e-4), "{z:?}");
    });
}

#[test]
fn without_a_sun_there_is_none() {
    for engine in Engine::ALL {
        folder(engine, false, |folder| {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if let Ok(code) = std::fs::read_to_string(&path)
                    && path.file_name().is_some_and(|n| n != "README.txt")
                {
                    for word in [
                        "DirectionalLight {",
                        "new THREE.DirectionalLight",
                        "Type::SUN",
                        "DirectionalLight3D",
                        "new BABYLON.Dir",
                        "distant",
                        "directional",
                        "\"SUN\"",
                        "DistantLight",
                    ] {
                        assert!(!code.contains(word), "{}: {word}", path.display());
                    }
                }
            }
        });
    }
}
