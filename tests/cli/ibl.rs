//! `ibl`: folders for engines, from a panorama, in every build.

use std::path::Path;

use serde_json::Value;
use veni_image::{HalfRange, Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::sphere::Equirect;

use crate::util::Dir;

/// What each engine takes.
const FOLDERS: [(&str, &[&str]); 11] = [
    ("bevy", &["README.txt", "diffuse.ktx2", "sky.rs", "skybox.ktx2", "specular.ktx2"]),
    ("filament", &["README.txt", "sh.txt", "sky.cpp", "sky_ibl.ktx", "sky_skybox.ktx"]),
    ("three", &["README.txt", "background.exr", "sky.js", "sky.ktx2", "sun.json"]),
    ("godot", &["README.txt", "sky.exr", "sky.tscn"]),
    ("babylon", &["README.txt", "sky.env", "sky.js"]),
    ("gltf", &["README.txt", "sky.glb"]),
    ("pbrt", &["README.txt", "sky.pbrt", "sky_equiarea.exr"]),
    ("mitsuba", &["README.txt", "sky.exr", "sky.xml"]),
    ("blender", &["README.txt", "sky.exr", "sky.py"]),
    ("usd", &["README.txt", "sky.exr", "sky.usda"]),
    (
        "any",
        &[
            "README.txt",
            "dfg.exr",
            "diffuse.exr",
            "light.bin",
            "light.json",
            "light.wgsl",
            "sky.exr",
            "specular_0.exr",
            "specular_1.exr",
            "specular_2.exr",
        ],
    ),
];

/// A clear sky with a sun of a few pixels, 37° high, to the right of the centre.
fn sunny(dir: &Dir, name: &str, glare: f32) -> Panorama {
    let sun = [0.64f32, -0.48, 0.6];
    let sky = Panorama::from_fn(Equirect::new(256, 128), |d| {
        let t: f32 = d.iter().zip(sun).map(|(a, b)| a * b).sum();
        let disc = if t > 0.9998 { glare } else { 0.0 };
        if d[2] < 0.0 { [0.1, 0.1, 0.08] } else { [0.3 + disc, 0.5 + disc, 0.9 + 0.9 * disc] }
    });
    let options = WriteOptions {
        half_range: HalfRange::Refuse,
        ..WriteOptions::new(WriteFormat::Exr(Precision::Float))
    };
    sky.write(dir.path(name), &options).unwrap();
    sky
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn upward(panorama: &Panorama) -> [f64; 3] {
    let grid = panorama.grid();
    let mut sum = [0.0; 3];
    for (k, (d, pixel)) in grid.directions().iter().zip(panorama.pixels()).enumerate() {
        let w = grid.solid_angle(k / grid.width) * f64::from(d[2].max(0.0));
        sum = [0, 1, 2].map(|c| sum[c] + w * f64::from(pixel[c]));
    }
    sum
}

#[test]
fn every_engine_gets_its_folder() {
    let dir = Dir::new();
    let sky = sunny(&dir, "sky.exr", 3e4);
    let engines = FOLDERS.map(|(name, _)| name).join(",");
    let args = ["ibl", "sky.exr", "--engine", &engines, "-o", "out", "--size", "32"];
    let lines = dir.json(&args);
    assert_eq!(lines.len(), FOLDERS.len());
    assert_eq!(names(&dir.path("out")).len(), FOLDERS.len());
    for ((name, files), line) in FOLDERS.iter().zip(&lines) {
        assert_eq!(line["engine"], *name);
        let folder = dir.path("out").join(name);
        assert_eq!(names(&folder), *files, "{name}");
        assert_eq!(line["files"].as_array().unwrap().len(), files.len(), "{name}");
        let sun = &line["sun"];
        let close = |key: &str, value: f64, within: f64| {
            assert!((sun[key].as_f64().unwrap() - value).abs() < within, "{name}: {key} {sun}");
        };
        close("elevation", 36.87, 0.5);
        close("azimuth", -36.87, 0.5);
    }
    // sun and rest together light the ground as the panorama does
    let rest = Panorama::read(dir.path("out/mitsuba/sky.exr")).unwrap();
    let sun = &lines[0]["sun"];
    let whole = upward(&sky);
    for (c, rest) in upward(&rest).into_iter().enumerate() {
        let direct = sun["irradiance"][c].as_f64().unwrap() * sun["direction"][2].as_f64().unwrap();
        assert!(direct > 0.2 * whole[c]);
        assert!(((rest + direct) / whole[c] - 1.0).abs() < 5e-3, "{rest} + {direct} for {}", whole[c]);
    }
    samples_hold_the_sky(&dir, whole);
    // an existing folder is left alone, and replaced by the same bytes if asked
    let refused = dir.run(&args);
    assert_eq!(refused.code, Some(2), "{}", refused.err);
    assert!(refused.err.contains("--force"), "{}", refused.err);
    let read = || std::fs::read(dir.path("out/bevy/specular.ktx2")).unwrap();
    let before = read();
    dir.ok(&[&args[..], &["--force"]].concat());
    assert_eq!(before, read());
}

/// What shaders sample for any renderer: densities of one in all, and with the sun the energy of the panorama.
fn samples_hold_the_sky(dir: &Dir, up: [f64; 3]) {
    let read = |name: &str| std::fs::read(dir.path("out/any").join(name)).unwrap();
    let told: Value = serde_json::from_slice(&read("light.json")).unwrap();
    let bytes = read("light.bin");
    let buffer = |name: &str| -> Vec<f32> {
        let [at, length] = [0, 1].map(|k| told["buffers"][name][k].as_u64().unwrap() as usize);
        assert!(at % 256 == 0 && at + length <= bytes.len());
        bytes[at..at + length].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    };
    let (uniform, texels) = (buffer("veni_light"), buffer("veni_light_texels"));
    let cells = buffer("veni_light_cells").len() / 2;
    assert_eq!((uniform[0], uniform[1], cells), (0.0, 1.0, (256usize * 128).next_power_of_two()));
    let grid = Equirect::new(256, 128);
    let (mut density, mut sum) = (0.0, [0.0; 3]);
    for (k, d) in grid.directions().iter().enumerate() {
        let w = grid.solid_angle(k / grid.width);
        density += w * f64::from(texels[4 * k + 3]);
        sum = [0, 1, 2].map(|c| sum[c] + w * f64::from(texels[4 * k + c] * d[2].max(0.0)));
    }
    assert!((density - 1.0).abs() < 1e-4, "{density}");
    // the first compact light: direction, radius, irradiance
    let sun = &uniform[16..];
    for (c, whole) in up.into_iter().enumerate() {
        let found = sum[c] + f64::from(sun[4 + c] * sun[2]);
        assert!((found / whole - 1.0).abs() < 5e-3, "{found} for {whole}");
    }
    let text = String::from_utf8(read("light.wgsl")).unwrap();
    assert!(
        ["fn veni_sample_light", "fn veni_light_pdf", "var<storage, read> veni_light_cells"]
            .iter()
            .all(|t| text.contains(t))
    );
}

#[test]
fn one_engine_is_the_folder_itself_and_the_sun_can_stay() {
    let dir = Dir::new();
    let sky = sunny(&dir, "sky.exr", 3e4);
    let args = ["ibl", "sky.exr", "--engine", "blender", "-o", "sky", "--sun", "keep", "--turn", "90"];
    let lines = dir.json(&args);
    assert_eq!(lines[0]["sun"], Value::Null);
    assert_eq!(names(&dir.path("sky")), ["README.txt", "sky.exr", "sky.py"]);
    let kept = Panorama::read(dir.path("sky/sky.exr")).unwrap();
    // a quarter turn moves 64 columns to the left
    for (column, row) in [(10, 20), (100, 40), (200, 90)] {
        let (a, b) = (kept.pixel(column, row), sky.pixel((column + 64) % 256, row));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-3 * b), "{a:?} {b:?}");
    }
    let json = dir.json(&["ibl", "sky.exr", "--engine", "pbrt", "-o", "rotated", "--turn", "90"]);
    // the sun rotates with the sky: azimuth −36.87° becomes 53.13°
    assert!((json[0]["sun"]["azimuth"].as_f64().unwrap() - 53.13).abs() < 0.5, "{}", json[0]);
}

#[test]
fn units_are_said() {
    let dir = Dir::new();
    let sky = sunny(&dir, "bright.exr", 3e6);
    let run = dir.run(&["ibl", "bright.exr", "--engine", "bevy", "-o", "a", "--size", "16", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    let line: Value = serde_json::from_str(run.out.lines().next().unwrap()).unwrap();
    let scale = line["radiance_scale"].as_f64().unwrap();
    assert!(scale < 0.05 && run.err.contains("times"), "{scale}: {}", run.err);
    // the constant makes up for it
    assert!((line["exposure"].as_f64().unwrap() * scale - 1000.0).abs() < 1e-6);
    let lux =
        dir.json(&["ibl", "bright.exr", "--engine", "any", "-o", "b", "--size", "16", "--lux", "50000"]);
    let y = upward(&sky).iter().zip([0.2126, 0.7152, 0.0722]).map(|(e, w)| e * w).sum::<f64>();
    assert!((lux[0]["exposure"].as_f64().unwrap() * y / 50000.0 - 1.0).abs() < 0.01, "{}", lux[0]);
}

#[test]
fn what_cannot_be_is_refused_before_any_work() {
    let dir = Dir::new();
    sunny(&dir, "sky.exr", 10.0);
    dir.write("file", "");
    for (args, said) in [
        (&["--engine", "bevy,bevy", "-o", "out"][..], "twice"),
        (&["--engine", "quake", "-o", "out"], "quake"),
        (&["--engine", "bevy", "-o", "out", "--size", "100"], "power of two"),
        (&["--engine", "bevy", "-o", "file"], "not a folder"),
        (&["--engine", "bevy", "-o", "out", "--lux", "0"], "more than 0"),
        (&["--engine", "bevy", "-o", "out", "--sky-size", "64x64"], "twice as wide"),
    ] {
        let run = dir.run(&[&["ibl", "sky.exr"], args].concat());
        assert_eq!(run.code, Some(2), "{args:?}");
        assert!(run.err.contains(said), "{args:?}: {}", run.err);
        assert!(!dir.path("out").exists(), "{args:?} left something");
    }
    let run = dir.run(&["ibl", "missing.exr", "--engine", "bevy", "-o", "out"]);
    assert!(run.code == Some(2) && run.err.contains("missing.exr"), "{}", run.err);
}

#[test]
fn textures_are_inspected() {
    let dir = Dir::new();
    sunny(&dir, "sky.exr", 3e3);
    dir.ok(&["ibl", "sky.exr", "--engine", "bevy,babylon", "-o", "out", "--size", "32"]);
    let ktx2 = &dir.json(&["inspect", "out/bevy/specular.ktx2"])[0];
    assert_eq!(
        (&ktx2["kind"], &ktx2["faces"], &ktx2["levels"]),
        (&"KTX2 texture".into(), &6.into(), &3.into())
    );
    assert_eq!(ktx2["size"], serde_json::json!([32, 32]));
    let env = &dir.json(&["inspect", "out/babylon/sky.env"])[0];
    assert_eq!(
        (&env["kind"], &env["size"], &env["levels"]),
        (&"Babylon.js environment".into(), &32.into(), &6.into())
    );
    let bytes = std::fs::read(dir.path("out/bevy/specular.ktx2")).unwrap();
    dir.write("short.ktx2", &bytes[..30]);
    let run = dir.run(&["inspect", "short.ktx2"]);
    assert!(run.code == Some(2) && run.err.contains("short.ktx2"), "{}", run.err);
}
