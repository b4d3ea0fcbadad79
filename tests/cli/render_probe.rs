//! `render-probe`: rendered images, their normals and masks, and what is refused.

use std::path::Path;

use crate::readers::{self, Image};
use crate::util::{Dir, model, panorama};

/// A panorama of one radiance for the upper half and another below, written by another library.
fn sky(path: &Path, upper: [f32; 3], lower: [f32; 3]) {
    exr::prelude::write_rgb_file(path, 128, 64, |_, y| {
        let [r, g, b] = if y < 32 { upper } else { lower };
        (r, g, b)
    })
    .unwrap();
}

/// A cube with one colour of normal per side; `normals`: with `vn` lines.
fn cube(normals: bool) -> String {
    let mut text = String::new();
    for k in 0..8 {
        let sign = |bit: i32| if (k >> bit) & 1 == 1 { 1 } else { -1 };
        text += &format!("v {} {} {}\n", sign(0), sign(1), sign(2));
    }
    let faces = [
        ([1, 3, 7, 5], [-1, 0, 0]),
        ([2, 6, 8, 4], [1, 0, 0]),
        ([1, 5, 6, 2], [0, -1, 0]),
        ([3, 4, 8, 7], [0, 1, 0]),
        ([1, 2, 4, 3], [0, 0, -1]),
        ([5, 7, 8, 6], [0, 0, 1]),
    ];
    for (_, [x, y, z]) in faces.iter().filter(|_| normals) {
        text += &format!("vn {x} {y} {z}\n");
    }
    for (at, (corners, _)) in faces.iter().enumerate() {
        text += "f";
        for c in corners {
            text += &if normals { format!(" {c}//{}", at + 1) } else { format!(" {c}") };
        }
        text += "\n";
    }
    text
}

fn centre(image: &Image) -> [f32; 3] {
    image.pixels[(image.height / 2) * image.width + image.width / 2]
}

#[test]
fn a_sphere_in_a_furnace_shows_its_albedo_on_every_output() {
    let dir = Dir::new();
    sky(&dir.path("sky.exr"), [2.0; 3], [2.0; 3]);
    let outputs =
        ["-o", "ball.exr", "-o", "ball.hdr", "-o", "ball.png", "--normals", "n.exr", "--mask", "m.png"];
    let args = ["render-probe", "sky.exr", "--size", "48x40", "--albedo", "0.5,0.25,1", "--exposure", "1"];
    let result = &dir.json(&[&args[..], &outputs].concat())[0];
    let [exr, hdr] = [readers::exr(&dir.path("ball.exr")), readers::hdr(&dir.path("ball.hdr"))];
    let normals = readers::exr(&dir.path("n.exr"));
    let mask = image::open(dir.path("m.png")).unwrap().to_luma8();
    let png = image::open(dir.path("ball.png")).unwrap().to_rgb8();
    let mut seen = 0;
    for k in 0..48 * 40 {
        let (x, y) = ((k % 48) as u32, (k / 48) as u32);
        let length = normals.pixels[k].iter().map(|v| v * v).sum::<f32>();
        if mask.get_pixel(x, y).0[0] == 0 {
            assert_eq!((exr.pixels[k], length), ([0.0; 3], 0.0));
            assert_eq!(png.get_pixel(x, y).0, [0; 3]);
            continue;
        }
        seen += 1;
        assert!((length - 1.0).abs() < 1e-5);
        for (v, albedo) in exr.pixels[k].iter().zip([0.5, 0.25, 1.0]) {
            assert!((v - 4.0 * albedo).abs() < 5e-3, "2 by one stop is 4: {:?}", exr.pixels[k]);
        }
        assert!(hdr.pixels[k].iter().zip(exr.pixels[k]).all(|(a, b)| (a - b).abs() < 0.02));
        assert!(png.get_pixel(x, y).0[2] > 250);
    }
    assert_eq!(result["pixels"], seen);
    assert!(seen > 1000, "the sphere fills the height: {seen}");
    // the sphere faces the camera, which looks along +x
    assert!((centre(&normals)[0] + 1.0).abs() < 0.01);
    assert!(!exr.attributes.contains_key("envmap"), "a rendered image is not a panorama");
    for image in [&exr, &normals] {
        let camera = veni_fit::shade::Camera::from_json(&image.attributes["veni:camera"]).unwrap();
        assert_eq!(camera.forward, [1.0, 0.0, 0.0]);
    }
}

#[test]
fn light_comes_from_where_the_panorama_has_it() {
    let dir = Dir::new();
    // blue above, orange below; a bright patch at the centre of the panorama, which is +x
    sky(&dir.path("sky.exr"), [0.1, 0.2, 1.0], [0.5, 0.2, 0.0]);
    dir.ok(&["render-probe", "sky.exr", "-o", "ball.exr", "--size", "33"]);
    let ball = readers::exr(&dir.path("ball.exr"));
    let at = |x: usize, y: usize| ball.pixels[y * 33 + x];
    assert!(at(16, 3)[2] > 3.0 * at(16, 29)[2] && at(16, 29)[0] > 2.0 * at(16, 3)[0]);
    exr::prelude::write_rgb_file(dir.path("sun.exr"), 128, 64, |x, y| {
        let v = if (62..66).contains(&x) && (30..34).contains(&y) { 1000.0 } else { 0.001 };
        (v, v, v)
    })
    .unwrap();
    // looking along +x, the sun is behind the sphere; rotated by 90 degrees it stands at +y, on the left
    let brightest = |turn: &str, azimuth: &str| {
        dir.ok(&[
            "render-probe",
            "sun.exr",
            "-o",
            "ball.exr",
            "--size",
            "33",
            "--turn",
            turn,
            "--azimuth",
            azimuth,
            "-f",
        ]);
        let ball = readers::exr(&dir.path("ball.exr"));
        let (at, p) = ball.pixels.iter().enumerate().max_by(|a, b| a.1[0].total_cmp(&b.1[0])).unwrap();
        (at % 33, p[0])
    };
    let (behind, left, front) = (brightest("0", "0"), brightest("90", "0"), brightest("180", "0"));
    assert!(behind.1 < 0.2 * front.1, "{behind:?} {front:?}");
    assert!(left.0 < 6 && (front.0 as i32 - 16).abs() < 3, "{left:?} {front:?}");
    // the camera walks around instead: looking along -x, the sun at +x is in front
    let walked = brightest("0", "180");
    assert!((walked.1 / front.1 - 1.0).abs() < 1e-3);
}

#[test]
fn a_mesh_is_read_with_and_without_normals() {
    let dir = Dir::new();
    sky(&dir.path("sky.exr"), [1.0; 3], [1.0; 3]);
    dir.write("smooth.obj", format!("mtllib missing.mtl\n{}", cube(true)));
    dir.write("flat.obj", cube(false));
    let normals = |file: &str, up: &str| {
        let args =
            ["render-probe", "sky.exr", "--mesh", file, "--up", up, "-o", "a.png", "--normals", "n.exr"];
        let run =
            dir.run(&[&args[..], &["--size", "40", "--elevation", "30", "--azimuth", "0", "-f"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.err);
        (readers::exr(&dir.path("n.exr")), run.err)
    };
    let (smooth, note) = normals("smooth.obj", "y");
    assert!(!note.contains("no normals"), "{note}");
    let (flat, note) = normals("flat.obj", "z");
    assert!(note.contains("flat.obj") && note.contains("no normals"), "{note}");
    // normals that no face names are none
    dir.write("unused.obj", format!("vn 0 0 1\n{}", cube(false)));
    let (unused, note) = normals("unused.obj", "y");
    assert!(note.contains("no normals") && unused.difference(&flat) < 1e-5, "{note}");
    // a cube is the same with either axis up: its front and its top are seen
    assert!(smooth.difference(&flat) < 1e-5);
    let count = |n: [f32; 3]| {
        let near = |p: &&[f32; 3]| p.iter().zip(n).all(|(a, b)| (a - b).abs() < 1e-5);
        flat.pixels.iter().filter(near).count()
    };
    let (front, top, none) = (count([-1.0, 0.0, 0.0]), count([0.0, 0.0, 1.0]), count([0.0; 3]));
    assert!(front > top && top > 100, "front {front}, top {top}");
    assert_eq!(front + top + none, 40 * 40, "no other side is seen, and no hole");
}

#[test]
fn any_light_that_has_a_name_will_do() {
    let dir = Dir::new();
    let m = model();
    dir.ok(&["bake", "--seed", "3", "-m", m, "-o", "sky.exr", "--size", "128", "--float", "-q"]);
    dir.ok(&["encode", &panorama(), "-m", m, "-o", "code.json", "-q"]);
    let render = |light: &[&str], out: &str| {
        let args = ["render-probe", "-o", out, "--size", "24", "--ks", "0.4", "--shininess", "30"];
        dir.ok(&[&args[..], light].concat());
        readers::exr(&dir.path(out))
    };
    let (seeded, baked) = (render(&["--seed", "3", "-m", m], "a.exr"), render(&["sky.exr"], "b.exr"));
    assert!(seeded.difference(&baked) < 1e-3, "{}", seeded.difference(&baked));
    assert!(render(&["code.json", "-m", m], "c.exr").difference(&seeded) > 0.01);
    // a panorama needs no model and is not encoded
    let direct = render(&[&panorama()], "d.exr");
    assert!(centre(&direct).iter().all(|v| *v > 0.0));
    let args = ["render-probe", "--seed", "3", "-m", m, "--size", "24", "-o", "dull.exr"];
    dir.ok(&args);
    assert!(readers::exr(&dir.path("dull.exr")).difference(&seeded) > 0.01, "--ks matters");
}

#[test]
fn bad_input_is_explained() {
    let dir = Dir::new();
    sky(&dir.path("sky.exr"), [1.0; 3], [1.0; 3]);
    let base = ["render-probe", "sky.exr", "-o", "a.exr"];
    let refused = |more: &[&str], words: &[&str]| dir.refused(&[&base[..], more].concat(), words);
    for (file, text, word) in [
        ("empty.obj", String::new(), "empty"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n".into(), "empty"),
        ("point.obj", "v 1 2 3\nf 1 1 1\n".into(), "single point"),
        ("vertex.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".into(), "vertex"),
        ("normal.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//7\n".into(), "normal"),
        ("half.obj", format!("{}f 1 2 3\n", cube(true)), "3 of 27 corners of faces lack normals"),
        ("number.obj", "v 0 zero 0\n".into(), "three numbers"),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".into(), "NaN"),
    ] {
        dir.write(file, text);
        refused(&["--mesh", file], &[file, word]);
    }
    dir.write("bytes.obj", [0xff, 0x80, 0xfe, b'\n']);
    refused(&["--mesh", "bytes.obj"], &["bytes.obj", "text"]);
    refused(&["--mesh", "missing.obj"], &["missing.obj", "No such file"]);
    refused(&["--normals", "n.png"], &["n.png", ".exr"]);
    refused(&["--mask", "m.exr"], &["m.exr", ".png"]);
    refused(&["--normals", "a.exr"], &["a.exr", "twice"]);
    refused(&["--size", "60000"], &["60000", "smaller"]);
    dir.refused(&["render-probe", "none.exr", "-o", "a.exr"], &["none.exr", "No such file"]);
    dir.ok(&["bake", "--seed", "1", "-m", model(), "-o", "cube.exr", "--layout", "cubemap", "--size", "8"]);
    dir.refused(&["render-probe", "cube.exr", "-o", "a.exr"], &["cube.exr", "cube map"]);
    for (args, word) in [
        (vec!["--albedo", "1.5"], "between 0 and 1"),
        (vec!["--ks=-0.1"], "between 0 and 1"),
        (vec!["--lights", "7"], "even"),
        (vec!["--elevation", "100"], "between -90 and 90"),
        (vec!["--seed", "1"], "cannot be used with"),
        (vec!["--up", "z"], "--mesh"),
        (vec!["--size", "0"], "at least 1"),
    ] {
        let run = dir.run(&[&base[..], &args].concat());
        assert_eq!(run.code, Some(2), "{args:?}");
        assert!(run.err.contains(word), "{args:?}: '{word}' is missing in {}", run.err);
    }
}
