//! AVIF photographs. With feature `avif` they are read, without it refused by name.

use crate::util::Dir;

/// 64 × 32: red grows along the rows, green down the columns.
const PICTURE: &[u8] =
    include_bytes!("../../crates/veni-image/src/read/avif/files/8-bit-420-bt601-limited.avif");

fn folder() -> Dir {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("in")).unwrap();
    dir.write("in/street.avif", PICTURE);
    dir
}

const PREPARE: [&str; 9] = ["prepare", "in", "-o", "data", "--size", "64", "--val", "0", "-q"];

const ENCODE: [&str; 4] = ["encode", "in/street.avif", "-o", "code.json"];

#[cfg(not(feature = "avif"))]
#[test]
fn a_program_without_a_decoder_says_how_to_build_one() {
    let dir = folder();
    let run = dir.run(&PREPARE);
    assert_ne!(run.code, Some(0), "{run:?}");
    let said = format!("{}{}", run.out, run.err);
    assert!(said.contains("in/street.avif") && said.contains("the feature avif"), "{said}");
    // a program without a model asks for one first
    if cfg!(feature = "pretrained") {
        dir.refused(&ENCODE, &["in/street.avif", "the feature avif"]);
    }
}

#[cfg(feature = "avif")]
#[test]
fn avif_photographs_become_panoramas() {
    use veni_image::Panorama;
    use veni_image::tonemap::srgb_to_linear;
    let dir = folder();
    dir.ok(&PREPARE);
    let found = Panorama::read(dir.path("data/train/street.exr")).unwrap();
    assert_eq!((found.grid().width, found.grid().height), (64, 32));
    for (x, y) in [(10, 16), (30, 8), (50, 20)] {
        let stored = [x as f32 / 63.0, y as f32 / 31.0, 128.0 / 255.0];
        for (a, b) in found.pixel(x, y).iter().zip(stored.map(srgb_to_linear)) {
            assert!((a - b).abs() < 0.03, "{x}, {y}: {a} is not {b}");
        }
    }
    // half of one is an error that names it, and takes nothing along
    dir.write("in/half.avif", &PICTURE[..PICTURE.len() / 2]);
    let again = [&PREPARE[..], &["--force"]].concat();
    let run = dir.run(&again);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(format!("{}{}", run.out, run.err).contains("in/half.avif"), "{run:?}");
    assert!(dir.path("data/train/street.exr").is_file());
}

#[cfg(all(feature = "avif", feature = "pretrained"))]
#[test]
fn what_holds_the_range_of_a_display_is_fitted_and_not_encoded() {
    let dir = folder();
    let args = ["fit", "in/street.avif", "--steps", "20", "-o", "code.json"];
    let [found] = &dir.json(&args)[..] else { panic!("one object") };
    assert!(found["loss"].as_f64().unwrap().is_finite(), "{found}");
    let code: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path("code.json")).unwrap()).unwrap();
    assert!(code["n"].as_u64().is_some(), "{code}");
    std::fs::remove_file(dir.path("code.json")).unwrap();
    // radiance is in none of its values: refused, and what helps is said
    dir.refused(&ENCODE, &["in/street.avif", "AVIF holds no high dynamic range", "veni-cli prepare"]);
}
