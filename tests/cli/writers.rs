//! Every writer by every reader: what each command writes is read by each command that takes it, and gives what the same
//! light gives in single precision.

use std::path::Path;

use serde_json::Value;
use veni_image::{Panorama, ReadOptions};

use crate::readers::{self, Image};
use crate::util::{Dir, panorama};

/// A file with the same sky as `sky.exr`, and the relative error that its format is allowed.
struct Written {
    name: &'static str,
    error: f64,
}

const SKIES: [Written; 6] = [
    Written { name: "sky.exr", error: 1e-6 },
    Written { name: "half.exr", error: 5e-4 },
    // of the brightest channel
    Written { name: "sky.hdr", error: 2e-2 },
    Written { name: "completed.exr", error: 1e-5 },
    Written { name: "completed.hdr", error: 2e-2 },
    Written { name: "set/train/sky.exr", error: 5e-4 },
];

fn image(path: &Path) -> Image {
    if path.extension().is_some_and(|e| e == "hdr") { readers::hdr(path) } else { readers::exr(path) }
}

fn one(dir: &Dir, args: &[&str]) -> Value {
    let [value] = &dir.json(args)[..] else { panic!("one object of {args:?}") };
    value.clone()
}

/// The largest difference of two images, as a part of the brightest channel.
fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let of = |(a, b): (&[f32; 3], &[f32; 3])| {
        let top = b.iter().fold(f32::MIN_POSITIVE, |top, v| top.max(v.abs()));
        a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs() / top)).fold(0.0, f64::max)
    };
    a.iter().zip(b).map(of).fold(0.0, f64::max)
}

fn numbers(latent: &Value) -> Vec<f64> {
    let rows = latent["vectors"].as_array().unwrap().iter();
    let all = rows.flat_map(|v| v.as_array().unwrap()).map(|v| v.as_f64().unwrap());
    all.chain([latent["exposure"].as_f64().unwrap()]).collect()
}

/// All that writes radiance of a panorama.
fn write_skies(dir: &Dir) {
    let bake = |out: &str, how: &[&str]| {
        dir.ok(&[&["bake", "--seed", "3", "--size", "128", "-q", "-o", out], how].concat());
    };
    bake("sky.exr", &["--float"]);
    bake("half.exr", &["--half"]);
    bake("sky.hdr", &[]);
    bake("sky.png", &[]);
    let fit = ["fit", "sky.exr", "--steps", "1", "-q", "-o"];
    dir.ok(&[&fit[..], &["fitted.json", "--completed", "completed.exr"]].concat());
    dir.ok(&[&fit[..], &["again.json", "--completed", "completed.hdr"]].concat());
    dir.ok(&["prepare", "sky.exr", "-o", "set", "--val", "0", "-q"]);
}

#[test]
fn panoramas_of_every_writer_are_read_by_every_reader() {
    let dir = Dir::new();
    write_skies(&dir);
    let truth = readers::exr(&dir.path("sky.exr"));
    let encode = |name: &str| numbers(&one(&dir, &["encode", name])["latent"]);
    // single vectors of a fit hang on the last bit, what it reaches does not
    let fit = |name: &str| {
        let fit = one(&dir, &["fit", name, "--steps", "5", "--resolution", "32"]);
        [fit["loss"].as_f64().unwrap().ln(), fit["latent"]["exposure"].as_f64().unwrap()]
    };
    let probe = |name: &str, to: &str| {
        dir.ok(&["render-probe", name, "-o", to, "--size", "16", "--force", "-q"]);
        readers::exr(&dir.path(to)).pixels
    };
    let (code, fitted, lit) = (encode("sky.exr"), fit("sky.exr"), probe("sky.exr", "lit.exr"));
    let facts = one(&dir, &["inspect", "sky.exr"]);
    for Written { name, error } in SKIES {
        // another program, then each command
        assert!(difference(&image(&dir.path(name)).pixels, &truth.pixels) <= error, "{name} read elsewhere");
        assert!(
            difference(Panorama::read(dir.path(name)).unwrap().pixels(), &truth.pixels) <= error,
            "{name}"
        );
        let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst(&encode(name), &code) <= 2.0 * error, "encode {name}: {}", worst(&encode(name), &code));
        let [loss, exposure] = std::array::from_fn(|k| (fit(name)[k] - fitted[k]).abs());
        assert!(loss < 0.1 && exposure < 5.0 * error.max(1e-3), "fit {name}: {loss} {exposure}");
        assert!(difference(&probe(name, "other.exr"), &lit) <= error, "render-probe {name}");
        let mean = |v: &Value| v["radiance"]["mean"].as_f64().unwrap();
        let of = one(&dir, &["inspect", name]);
        assert!((mean(&of) / mean(&facts) - 1.0).abs() <= error, "inspect {name}");
        let to = format!("again-{}", name.replace(['/', '.'], "-"));
        dir.ok(&["prepare", name, "-o", &to, "--val", "0", "-q"]);
        let stem = Path::new(name).file_stem().unwrap().to_str().unwrap();
        let prepared = readers::exr(&dir.path(format!("{to}/train/{stem}.exr"))).pixels;
        assert!(difference(&prepared, &truth.pixels) <= error + 5e-4, "prepare {name}");
        // baked images carry their latent, the others are encoded
        let baked = one(&dir, &["bake", name, "--float", "--size", "128", "-o", "again.exr", "--force"]);
        let carries = ["sky.exr", "half.exr", "sky.hdr"].contains(&name);
        assert_eq!(baked["latent"]["source"] == "seed 3", carries, "bake {name}");
        let pixels = readers::exr(&dir.path("again.exr")).pixels;
        if carries {
            assert_eq!(pixels, truth.pixels, "bake {name}");
        } else {
            assert_eq!(numbers(&baked["latent"]), encode(name), "bake {name}");
        }
    }
    // a preview is no radiance: taken where pictures of limited range are, refused by name elsewhere
    for command in ["encode", "render-probe"] {
        dir.refused(
            &[command, "sky.png", "-o", if command == "encode" { "no.json" } else { "no.exr" }],
            &["sky.png"],
        );
    }
    dir.refused(&["bake", "sky.png", "-o", "no.exr"], &["sky.png"]);
    dir.ok(&["fit", "sky.png", "--steps", "5", "--resolution", "32", "-o", "preview.json", "-q"]);
    dir.ok(&["prepare", "sky.png", "-o", "previews", "--val", "0", "-q"]);
}

#[test]
fn latents_of_every_writer_are_read_by_every_reader() {
    let dir = Dir::new();
    write_skies(&dir);
    dir.ok(&["encode", "sky.exr", "-o", "encoded.json", "-q"]);
    dir.ok(&[
        "sample",
        "--seed",
        "3",
        "-n",
        "1",
        "--size",
        "32",
        "-o",
        "sheet.png",
        "--latents",
        "codes",
        "-q",
    ]);
    for name in ["encoded.json", "fitted.json", "codes/sky-3.json"] {
        let stored: Value = serde_json::from_slice(&std::fs::read(dir.path(name)).unwrap()).unwrap();
        let baked = one(&dir, &["bake", name, "--float", "--size", "128", "-o", "baked.exr", "--force"]);
        assert_eq!(baked["latent"], stored, "{name}");
        let facts = one(&dir, &["inspect", name]);
        let exposure = |v: &Value| v.as_f64().unwrap() as f32;
        assert_eq!(exposure(&facts["exposure"]["log"]), exposure(&stored["exposure"]), "{name}");
        // the light of a latent is the light of what it bakes
        let probe = |from: &str, to: &str| {
            dir.ok(&["render-probe", from, "-o", to, "--size", "16", "--force", "-q"]);
            readers::exr(&dir.path(to)).pixels
        };
        assert!(difference(&probe(name, "a.exr"), &probe("baked.exr", "b.exr")) < 1e-5, "{name}");
    }
    let sampled = std::fs::read(dir.path("codes/sky-3.json")).unwrap();
    let sampled: Value = serde_json::from_slice(&sampled).unwrap();
    assert_eq!(one(&dir, &["inspect", "half.exr"])["latent"], sampled, "sample and bake name one sky");
}

/// Rendered pictures and their normals and masks are what `fit` takes.
#[test]
fn rendered_pictures_are_read_back() {
    let dir = Dir::new();
    dir.ok(&["bake", "--seed", "3", "--size", "128", "--float", "-q", "-o", "sky.exr"]);
    let shape = ["--normals", "n.exr", "--mask", "m.png"];
    let probe =
        ["render-probe", "sky.exr", "--size", "24", "-q", "-o", "a.exr", "-o", "a.hdr", "-o", "a.png"];
    dir.ok(&[&probe[..], &shape].concat());
    let (float, rgbe) = (readers::exr(&dir.path("a.exr")), readers::hdr(&dir.path("a.hdr")));
    assert!(difference(&rgbe.pixels, &float.pixels) < 0.01);
    let any = ReadOptions { any_aspect: true, ..ReadOptions::default() };
    let mut fits = Vec::new();
    for name in ["a.exr", "a.hdr"] {
        let read = Panorama::read_with(dir.path(name), &any).unwrap();
        assert!(read.attributes()["veni:camera"].contains("field_of_view"), "{name}");
        assert!(read.attributes()["veni:material"].contains("albedo"), "{name}");
        let args =
            ["fit", name, "--normals", "n.exr", "--mask", "m.png", "--steps", "5", "-o", "f.json", "--force"];
        fits.push(numbers(&one(&dir, &args)["latent"]));
        assert_eq!(
            one(&dir, &["inspect", name])["attributes"]["veni:camera"],
            read.attributes()["veni:camera"]
        );
    }
    let worst = fits[0].iter().zip(&fits[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.2, "{worst}");
    // normals are no colours
    let normals = readers::exr(&dir.path("n.exr"));
    assert!(
        !normals.attributes.contains_key("colorInteropID")
            && !normals.attributes.contains_key("chromaticities")
    );
    assert!(float.attributes.contains_key("chromaticities"));
}

/// Generated scenes: half precision times a factor, and floats.
#[test]
fn generated_scenes_are_read_alike_in_both_precisions() {
    let dir = Dir::new();
    for (to, how) in [("half", &[][..]), ("float", &["--float"])] {
        dir.ok(&[&["synth", "-o", to, "-n", "2", "--size", "64", "-q", "--scene", "night"], how].concat());
    }
    let attributes = |k: usize| readers::exr(&dir.path(format!("half/synth-00000{k}.exr"))).attributes;
    assert!((0..2).all(|k| attributes(k).contains_key("veni:radianceScale")), "{:?}", attributes(0));
    for k in 0..2 {
        let [half, float] = ["half", "float"].map(|to| format!("{to}/synth-00000{k}.exr"));
        let encode = |name: &str| numbers(&one(&dir, &["encode", name])["latent"]);
        let worst = encode(&half).iter().zip(encode(&float)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-3, "{worst}");
        let probe = |name: &str| {
            dir.ok(&["render-probe", name, "-o", "p.exr", "--size", "16", "--force", "-q"]);
            readers::exr(&dir.path("p.exr")).pixels
        };
        assert!(difference(&probe(&half), &probe(&float)) < 1e-3);
        let mean = |name: &str| one(&dir, &["inspect", name])["radiance"]["mean"].as_f64().unwrap();
        assert!((mean(&half) / mean(&float) - 1.0).abs() < 1e-3);
    }
    for to in ["half", "float"] {
        dir.ok(&["prepare", to, "-o", &format!("set-{to}"), "--size", "64", "--val", "0", "-q"]);
    }
    let read = |to: &str| Panorama::read(dir.path(format!("set-{to}/train/synth-000001.exr"))).unwrap();
    assert!(difference(read("half").pixels(), read("float").pixels()) < 2e-3);
    // and a real one, for a factor of 1
    assert!(!readers::exr(Path::new(&panorama())).attributes.contains_key("veni:radianceScale"));
}
