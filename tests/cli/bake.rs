//! `bake` and `sample`, read back through independent readers.

use serde_json::Value;

use crate::readers::{exr, hdr};
use crate::util::{Dir, model, panorama};

const SIZE: [&str; 2] = ["--size", "64x32"];

fn bake(dir: &Dir, args: &[&str]) {
    dir.ok(&[&["bake", "--model", model(), "--quiet"], &SIZE[..], args].concat());
}

#[test]
fn a_seed_gives_the_same_sky_in_every_format() {
    let dir = Dir::new();
    bake(&dir, &["--seed", "7", "-o", "float.exr", "-o", "sky.hdr", "-o", "sky.png", "--float"]);
    bake(&dir, &["--seed", "7", "-o", "half.exr", "--half"]);
    let (float, half, rgbe) =
        (exr(&dir.path("float.exr")), exr(&dir.path("half.exr")), hdr(&dir.path("sky.hdr")));
    assert_eq!((float.width, float.height), (64, 32));
    assert!(float.pixels.iter().flatten().all(|v| v.is_finite() && *v > 0.0));
    // half: 11 significant bits; RGBE: 8 bits of the largest of three
    assert!(float.difference(&half) <= 0.5f32.powi(11) * 1.01, "{}", float.difference(&half));
    for (a, b) in float.pixels.iter().zip(&rgbe.pixels) {
        let largest = a.iter().copied().fold(0.0, f32::max);
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= largest / 128.0), "{a:?} against {b:?}");
    }
    let png = image::open(dir.path("sky.png")).unwrap().to_rgb8();
    assert_eq!(png.dimensions(), (64, 32));
    let mean = png.pixels().map(|p| f64::from(p.0[1])).sum::<f64>() / 2048.0;
    assert!((40.0..220.0).contains(&mean), "a preview is neither black nor white: {mean}");
    bake(&dir, &["--seed", "8", "-o", "other.exr", "--float"]);
    assert!(float.difference(&exr(&dir.path("other.exr"))) > 0.01, "another seed is another sky");
    bake(&dir, &["--seed", "7", "-o", "again.exr", "--float"]);
    assert_eq!(std::fs::read(dir.path("again.exr")).unwrap(), std::fs::read(dir.path("float.exr")).unwrap());
}

#[test]
fn an_exr_says_what_it_is() {
    let dir = Dir::new();
    bake(&dir, &["--seed", "7", "-o", "sky.exr"]);
    let attributes = exr(&dir.path("sky.exr")).attributes;
    assert!(!attributes.contains_key("envmap"), "samples are not on the edges");
    assert_eq!(attributes["colorInteropID"], "lin_rec709_scene");
    assert_eq!(attributes["chromaticities"], "chromaticities");
    assert!(attributes["software"].starts_with("veni 0."), "{}", attributes["software"]);
    assert_eq!(attributes["veni:frame"], "blender");
    let latent: Value = serde_json::from_str(&attributes["veni:latent"]).unwrap();
    assert_eq!((latent["n"].as_u64(), latent["source"].as_str()), (Some(4), Some("seed 7")));
    assert_eq!(latent["model"].as_str().unwrap(), attributes["veni:model"]);
}

#[test]
fn a_baked_image_is_its_own_latent() {
    let dir = Dir::new();
    bake(&dir, &["--seed", "3", "--turn", "33", "--exposure", "1.5", "-o", "a.exr", "-o", "a.hdr"]);
    for from in ["a.exr", "a.hdr"] {
        bake(&dir, &[from, "-o", "b.exr", "-o", "b.hdr", "--force"]);
        for format in ["exr", "hdr"] {
            let [a, b] = ["a", "b"].map(|n| std::fs::read(dir.path(format!("{n}.{format}"))).unwrap());
            assert!(a == b, "{from} baked again to {format} differs");
        }
    }
    let latent = dir.json(&["inspect", "a.exr"])[0]["latent"].to_string();
    dir.write("a.json", latent);
    bake(&dir, &["a.json", "-o", "c.exr"]);
    assert_eq!(std::fs::read(dir.path("a.exr")).unwrap(), std::fs::read(dir.path("c.exr")).unwrap());
}

#[test]
fn rotating_is_rolling_columns_and_exposure_is_doubling() {
    let dir = Dir::new();
    bake(&dir, &["--seed", "5", "--float", "-o", "plain.exr"]);
    let plain = exr(&dir.path("plain.exr"));
    for (degrees, columns) in [("90", 16), ("-90", 48), ("5.625", 1), ("180", 32), ("360", 0)] {
        bake(&dir, &["--seed", "5", "--float", "--turn", degrees, "-o", "rotated.exr", "--force"]);
        let rotated = exr(&dir.path("rotated.exr"));
        // rotated counter-clockwise, what was in column i appears further to the left
        let difference = rotated.difference(&plain.rolled(columns));
        assert!(difference < 1e-4, "{degrees} degrees: {difference}");
    }
    bake(&dir, &["--seed", "5", "--float", "--turn", "90", "-o", "rotated.exr", "--force"]);
    assert!(exr(&dir.path("rotated.exr")).difference(&plain.rolled(17)) > 1e-3, "the test can fail");
    bake(&dir, &["--seed", "5", "--float", "--exposure", "-2", "-o", "dark.exr"]);
    let mut dark = exr(&dir.path("dark.exr"));
    dark.pixels.iter_mut().flatten().for_each(|v| *v *= 4.0);
    assert!(dark.difference(&plain) < 1e-5, "{}", dark.difference(&plain));
}

#[test]
fn radiance_beyond_half_becomes_float_unless_half_was_asked_for() {
    let dir = Dir::new();
    let bright = ["--seed", "5", "--exposure", "30"];
    let args = [&["bake", "--model", model()], &SIZE[..], &bright[..], &["-o", "bright.exr"]].concat();
    let run = dir.run(&args);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("beyond half precision") && run.out.contains("float"), "{}{}", run.out, run.err);
    assert!(exr(&dir.path("bright.exr")).pixels.iter().flatten().all(|v| v.is_finite()));
    let half = [&args[..args.len() - 1], &["half.exr", "--half"]].concat();
    dir.refused(&half, &["half.exr", "65504", "float"]);
}

/// A cube map against the equirectangular image of the same sky: the centre pixel of each face looks along its axis.
#[test]
fn cube_faces_look_along_their_axes() {
    let dir = Dir::new();
    let args = ["bake", "--model", model(), "--seed", "5", "--float", "--quiet"];
    dir.ok(&[&args[..], &["--size", "1024", "-o", "sky.exr"]].concat());
    let sky = exr(&dir.path("sky.exr"));
    // native directions of the faces +X -X +Y -Y +Z -Z: z up; y up with +x kept
    let z_up = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
    let gltf = [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0], [0, 1, 0]];
    // native +x is the centre of a panorama: straight ahead in Bevy, whose cameras find it on face +Z
    let bevy = [[0, -1, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]];
    for (frame, directions) in [("blender", z_up), ("gltf", gltf), ("bevy", bevy)] {
        let out = format!("{frame}.exr");
        dir.ok(&[&args[..], &["--layout", "cubemap", "--size", "65", "--frame", frame, "-o", &out]].concat());
        let cube = exr(&dir.path(&out));
        assert_eq!((cube.width, cube.height), (65, 6 * 65));
        assert_eq!(cube.attributes["veni:frame"], frame);
        assert_eq!(cube.attributes["veni:cubeFaces"], "+X -X +Y -Y +Z -Z");
        for (face, [x, y, z]) in directions.into_iter().enumerate() {
            let centre = cube.pixels[(face * 65 + 32) * 65 + 32];
            // an axis meets the panorama at a corner of four pixels, or at a pole
            let azimuth = f64::from(y).atan2(f64::from(x));
            let column = ((0.5 - azimuth / std::f64::consts::TAU) * 1024.0) as usize;
            let at = |row: usize, column: usize| sky.pixels[row * 1024 + column % 1024];
            let around: Vec<_> = match z {
                0 => [255, 256].iter().flat_map(|r| [at(*r, column + 1023), at(*r, column)]).collect(),
                z => (0..1024).map(|c| at(if z > 0 { 0 } else { 511 }, c)).collect(),
            };
            let mean = |k: usize| around.iter().map(|p| p[k]).sum::<f32>() / around.len() as f32;
            let expected = [mean(0), mean(1), mean(2)];
            let close = centre.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02 * b);
            assert!(close, "{frame} face {face}: {centre:?}, the sky is {expected:?} there");
        }
    }
    let facts = &dir.json(&["inspect", "gltf.exr"])[0];
    assert_eq!(facts["cube_faces"], "+X -X +Y -Y +Z -Z");
    assert_eq!(facts["latent"]["source"], "seed 5");
}

#[test]
fn a_panorama_is_encoded_on_the_fly() {
    let dir = Dir::new();
    bake(&dir, &[&panorama(), "-o", "direct.exr"]);
    dir.ok(&["encode", &panorama(), "--model", model(), "-o", "code.json"]);
    bake(&dir, &["code.json", "-o", "through.exr"]);
    assert_eq!(
        std::fs::read(dir.path("direct.exr")).unwrap(),
        std::fs::read(dir.path("through.exr")).unwrap()
    );
}

#[test]
fn results_are_json_when_asked_for() {
    let dir = Dir::new();
    let args = ["bake", "--model", model(), "--seed", "1", "--size", "32", "-o", "a.exr", "-o", "a.png"];
    let [value] = &dir.json(&args)[..] else { panic!("one object") };
    assert_eq!(value["files"], serde_json::json!(["a.exr", "a.png"]));
    assert_eq!((value["width"].as_u64(), value["height"].as_u64()), (Some(32), Some(16)));
    assert_eq!((value["precision"].as_str(), value["layout"].as_str()), (Some("half"), Some("equirect")));
    assert_eq!(value["latent"]["n"], 4);
    let args = ["bake", "--model", model(), "--seed", "1", "--size", "32", "-o", "b.png", "-o", "b.hdr"];
    assert!(dir.json(&args)[0]["precision"].is_null(), "only EXR has a choice");
}

#[test]
fn a_sheet_shows_the_skies_that_bake_would_give() {
    let dir = Dir::new();
    let args =
        ["sample", "--model", model(), "--seed", "4", "--grid", "3x2", "--size", "32", "-o", "sheet.png"];
    let [value] = &dir.json(&[&args[..], &["--latents", "codes"]].concat())[..] else { panic!("one object") };
    assert_eq!((value["count"].as_u64(), value["latents"].as_array().unwrap().len()), (Some(6), 6));
    let sheet = image::open(dir.path("sheet.png")).unwrap().to_rgb8();
    assert_eq!(sheet.dimensions(), (3 * 32 + 4 * 4, 2 * 16 + 3 * 4));
    dir.ok(&["bake", "--model", model(), "--seed", "8", "--size", "64", "-o", "seed.exr"]);
    dir.ok(&["bake", "--model", model(), "codes/sky-8.json", "--size", "64", "-o", "code.exr"]);
    assert_eq!(std::fs::read(dir.path("seed.exr")).unwrap(), std::fs::read(dir.path("code.exr")).unwrap());
    let cell = |c: u32, r: u32| -> Vec<_> {
        (0..512).map(|k| sheet.get_pixel(4 + 36 * c + k % 32, 4 + 20 * r + k / 32).0).collect()
    };
    assert_ne!(cell(0, 0), cell(1, 0));
    dir.ok(&["sample", "--model", model(), "--seed", "8", "--count", "1", "--size", "32", "-o", "one.png"]);
    let one = image::open(dir.path("one.png")).unwrap().to_rgb8();
    assert_eq!(one.dimensions(), (40, 24));
    let alone: Vec<_> = (0..512).map(|k| one.get_pixel(4 + k % 32, 4 + k / 32).0).collect();
    assert_eq!(cell(1, 1), alone, "seed 8 is the second sky of the second row");
}

#[cfg(feature = "pretrained")]
#[test]
fn the_first_command_of_a_newcomer_gives_a_sky() {
    let dir = Dir::new();
    let out = dir.ok(&["bake", "--seed", "19", "-o", "sky.exr"]);
    assert!(out.contains("sky.exr") && out.contains("1024 x 512"), "{out}");
    let sky = exr(&dir.path("sky.exr"));
    assert_eq!((sky.width, sky.height), (1024, 512));
    // a sky: brighter above than below
    let mean = |rows: std::ops::Range<usize>| {
        let pixels = &sky.pixels[rows.start * 1024..rows.end * 1024];
        pixels.iter().map(|p| p[1].ln()).sum::<f32>() / pixels.len() as f32
    };
    assert!(
        mean(128..256) > mean(256..384),
        "{} above, {} below the horizon",
        mean(128..256),
        mean(256..384)
    );
}

#[cfg(feature = "pretrained-large")]
#[test]
fn models_inside_the_program_go_by_their_names() {
    let dir = Dir::new();
    for (name, vectors) in [("27", 9), ("vectors-147", 49), ("vectors-300", 100)] {
        let sky = format!("{name}.exr");
        dir.ok(&["bake", "--model", name, "--seed", "7", "--size", "32", "-o", &sky]);
        let latent = &dir.json(&["inspect", &sky])[0]["latent"];
        assert_eq!(latent["n"].as_u64(), Some(vectors), "{latent}");
        // it goes back through its own model, named or found, and through no other
        dir.ok(&["bake", &sky, "--model", name, "--size", "16", "-o", "named.exr", "--force"]);
        dir.ok(&["bake", &sky, "--size", "16", "-o", "found.exr", "--force"]);
        assert_eq!(
            std::fs::read(dir.path("named.exr")).unwrap(),
            std::fs::read(dir.path("found.exr")).unwrap()
        );
    }
    let wrong = ["bake", "vectors-300.exr", "--model", "27", "-o", "wrong.png"];
    dir.refused(&wrong, &["100 vectors", "has 9", "--model vectors-300"]);
    let both = ["bake", "27.exr", "vectors-300.exr", "--size", "16", "--out-dir", "both"];
    let run = dir.run(&both);
    assert_eq!(
        (run.code, run.err.contains("vectors-300.exr"), run.err.contains("--model vectors-300")),
        (Some(2), true, true)
    );
    let unknown = ["bake", "--model", "28", "--seed", "1", "-o", "none.png"];
    dir.refused(&unknown, &["28", "27, 147, 300, vectors-147, vectors-300"]);
    // a file of that name comes first
    std::fs::copy(model(), dir.path("vectors-147")).unwrap();
    dir.ok(&["bake", "--model", "vectors-147", "--seed", "1", "--size", "16", "-o", "file.exr"]);
    let latent = &dir.json(&["inspect", "file.exr"])[0]["latent"];
    assert_ne!(latent["n"].as_u64(), Some(49), "{latent}");
}
