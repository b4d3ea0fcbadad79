//! `fit`: what is known though it is black, below black, or not a number in the mask.

use image::{Rgb, RgbImage};
use serde_json::Value;

use crate::readers;
use crate::util::Dir;

const WIDTH: usize = 128;
const HEIGHT: usize = 64;

/// A panorama, written by another library.
fn write(dir: &Dir, name: &str, pixel: impl Fn(usize, usize) -> [f32; 3] + Sync) {
    exr::prelude::write_rgb_file(dir.path(name), WIDTH, HEIGHT, |x, y| pixel(x, y).into()).unwrap();
}

fn one(dir: &Dir, args: &[&str]) -> Value {
    let [value] = &dir.json(args)[..] else { panic!("one object of {args:?}") };
    value.clone()
}

/// One update on a small grid: what is written of what is known does not depend on it.
fn quick(dir: &Dir, args: &[&str]) -> Value {
    one(dir, &[&["fit", "-o", "o.json", "-f", "--steps", "1", "--resolution", "16x8"], args].concat())
}

/// Mean radiance over the sphere.
fn mean(pixels: &[[f32; 3]]) -> [f64; 3] {
    let (mut sum, mut whole) = ([0.0; 3], 0.0);
    for (at, pixel) in pixels.iter().enumerate() {
        let area = (std::f64::consts::PI * ((at / WIDTH) as f64 + 0.5) / HEIGHT as f64).sin();
        (0..3).for_each(|c| sum[c] += area * f64::from(pixel[c]));
        whole += area;
    }
    sum.map(|v| v / whole)
}

/// Three lamps on black: with them taken out, nothing but black is left, and without, the fit should not see a bright sky.
#[test]
fn lamps_on_black_are_fitted() {
    let dir = Dir::new();
    let lamps = |x: usize, y: usize| match (x, y) {
        (20..26, 10..16) => [10.0; 3],
        (80..86, 20..26) => [4.0, 6.0, 8.0],
        (50..54, 40..44) => [4.0; 3],
        _ => [0.0; 3],
    };
    write(&dir, "lamps.exr", lamps);
    let truth = mean(&(0..WIDTH * HEIGHT).map(|p| lamps(p % WIDTH, p / WIDTH)).collect::<Vec<_>>());
    let bake = || {
        dir.ok(&["bake", "l.json", "-o", "l.exr", "-f", "--float", "--size", "128", "--device", "cpu", "-q"]);
        readers::exr(&dir.path("l.exr")).pixels
    };
    let fit = ["fit", "lamps.exr", "-o", "l.json", "-f", "--steps", "30", "--resolution", "32x16"];
    let found = one(&dir, &[&fit[..], &["--compact-lights", "4"]].concat());
    assert!((found["known_share"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{found}");
    let baked = mean(&bake());
    for c in 0..3 {
        assert!((baked[c] / truth[c] - 1.0).abs() < 0.05, "{baked:?} for {truth:?}");
    }
    let found = one(&dir, &[&fit[..], &["--compact-lights", "0"]].concat());
    assert!((found["known_share"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{found}");
    // vectors alone make no lamps, but most of it is dark
    let baked = bake();
    let dark = baked.iter().filter(|p| f64::from(p[1]) < truth[1]).count();
    assert!(
        dark > WIDTH * HEIGHT / 2 && mean(&baked)[1] < 3.0 * truth[1],
        "{dark}, {:?} for {truth:?}",
        mean(&baked)
    );
    write(&dir, "black.exr", |_, _| [0.0; 3]);
    dir.refused(
        &["fit", "black.exr", "-q"],
        &["black.exr", "no known pixel of the picture has positive radiance"],
    );
}

#[test]
fn the_black_of_a_photograph_is_known() {
    let dir = Dir::new();
    RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |_, y| if y < 32 { Rgb([120; 3]) } else { Rgb([0; 3]) })
        .save(dir.path("half.png"))
        .unwrap();
    let found = quick(&dir, &["half.png", "--completed", "c.exr"]);
    assert!((found["known_share"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{found}");
    // half of it is at least as dark as the first step of 8 bits
    let exposure = found["latent"]["exposure"].as_f64().unwrap();
    let grey = ((120.0f64 / 255.0 + 0.055) / 1.055).powf(2.4);
    let expected = 0.5 * (grey.ln() + (1.0 / (255.0 * 12.92f64)).ln());
    assert!((exposure - expected).abs() < 0.1, "{exposure} for {expected}");
    let completed = readers::exr(&dir.path("c.exr"));
    assert_eq!(completed.pixels[WIDTH * 50 + 5], [0.0; 3]);
}

#[test]
fn negative_radiance_is_written_as_black() {
    let dir = Dir::new();
    write(&dir, "green.exr", |_, y| if y < 32 { [-0.175, 1.0, -0.08] } else { [0.3; 3] });
    for out in ["c.exr", "c.hdr"] {
        quick(&dir, &["green.exr", "--completed", out]);
        let path = dir.path(out);
        let image = if out == "c.exr" { readers::exr(&path) } else { readers::hdr(&path) };
        let [above, below] = [image.pixels[WIDTH * 5 + 7], image.pixels[WIDTH * 50 + 7]];
        // the reader takes the middle of what a byte of RGBE stands for
        let is_black = |v: f32| (0.0..0.005).contains(&v);
        assert!(
            is_black(above[0]) && (above[1] - 1.0).abs() < 0.01 && is_black(above[2]),
            "{out}: {above:?}"
        );
        assert!((below[0] - 0.3).abs() < 0.01, "{out}: {below:?}");
    }
}

#[test]
fn what_is_not_a_number_in_a_mask_is_unknown() {
    let dir = Dir::new();
    write(&dir, "sky.exr", |x, y| [0.2 + x as f32 / 200.0, 0.5, 0.3 + y as f32 / 100.0]);
    for (name, unknown) in [("nan.exr", f32::NAN), ("zero.exr", 0.0)] {
        write(&dir, name, |x, _| [if x < 64 { 1.0 } else { unknown }; 3]);
    }
    let of = |mask: &str| {
        let found = quick(&dir, &["sky.exr", "--mask", mask, "--completed", "c.exr"]);
        let half = found["known_share"].as_f64().unwrap();
        assert!((half - 0.5).abs() < 1e-3, "{mask}: {half}");
        (found["loss"].as_f64().unwrap(), readers::exr(&dir.path("c.exr")).pixels)
    };
    let (nan, zero) = (of("nan.exr"), of("zero.exr"));
    assert_eq!(nan, zero);
    assert!(nan.1.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    // truth values that were saved as they are
    image::GrayImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, _| image::Luma([u8::from(x < 64)]))
        .save(dir.path("bool.png"))
        .unwrap();
    dir.refused(&["fit", "sky.exr", "--mask", "bool.png", "-q"], &["bool.png: ", "mask", "1 of 255"]);
}

#[test]
fn normals_coded_as_colours_are_refused() {
    let dir = Dir::new();
    write(&dir, "sky.exr", |_, y| [0.2, 0.3, 0.2 + y as f32 / 50.0]);
    let size = ["--size", "24", "-q"];
    dir.ok(&[&["render-probe", "sky.exr", "-o", "ball.exr", "--normals", "n.exr"], &size[..]].concat());
    let normals = readers::exr(&dir.path("n.exr"));
    let coded = |x: usize, y: usize| {
        let [r, g, b] = normals.pixels[24 * y + x].map(|v| 0.5 * v + 0.5);
        (r, g, b)
    };
    exr::prelude::write_rgb_file(dir.path("coded.exr"), 24, 24, coded).unwrap();
    let args = ["fit", "ball.exr", "-o", "o.json", "-q", "--steps", "1", "--normals"];
    dir.refused(&[&args[..], &["coded.exr"]].concat(), &["coded.exr", "coded 0 to 1", "2v - 1"]);
    dir.ok(&[&args[..], &["n.exr"]].concat());
}
