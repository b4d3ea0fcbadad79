//! Files as other programs wrote them (`files/cases`), through the whole program: values, or a refusal by name.

use crate::readers;
use crate::util::{Dir, file};

fn case(name: &str) -> String {
    file(&format!("cases/{name}"))
}

/// The radiance of every pixel, as the program takes it.
fn pixels(dir: &Dir, name: &str, more: &[&str]) -> Vec<[f32; 3]> {
    let args = ["light", &case(name), "--sun", "none", "--residual", "taken.exr", "-q", "-f"];
    dir.ok(&[&args, more].concat());
    readers::exr(&dir.path("taken.exr")).pixels
}

fn mean(pixels: &[[f32; 3]]) -> [f64; 3] {
    let sum = |c: usize| pixels.iter().map(|p| f64::from(p[c])).sum::<f64>();
    [0, 1, 2].map(|c| sum(c) / pixels.len() as f64)
}

fn near(found: [f64; 3], wanted: [f64; 3], share: f64) {
    let off = |c: usize| (found[c] / wanted[c] - 1.0).abs();
    assert!((0..3).all(|c| off(c) < share), "{found:?} for {wanted:?}");
}

/// Every one shows the panorama of ref.exr: a file of Blender in ACEScg, one with a name of that space alone, layers of Houdini and
/// of several parts, and one that is half transparent throughout.
#[test]
fn other_words_for_the_same_panorama_give_the_same_panorama() {
    let dir = Dir::new();
    let wanted = mean(&pixels(&dir, "ref.exr", &[]));
    // what is beyond Rec. 709 ends at its edge: 765 values of 24,576
    for (name, more, share) in [
        ("acescg.exr", &[][..], 2e-3),
        ("interop_ap1.exr", &[], 0.08),
        ("hdr_prefix_normal.exr", &[], 1e-6),
        ("karma_C.exr", &[], 1e-6),
        ("mp_C_albedo.exr", &[], 1e-6),
        ("mp_left_right.exr", &["--layer", "left"], 1e-6),
        ("premult_half.exr", &[], 1e-6),
    ] {
        near(mean(&pixels(&dir, name, more)), wanted, share);
    }
    // 10⁻⁸ of it
    near(mean(&pixels(&dir, "dark_1e-08.exr", &[])).map(|v| v * 1e8), wanted, 1e-3);
    // an sRGB curve on what was linear: brighter lights, darker shadows
    assert!(mean(&pixels(&dir, "interop_srgbtex.exr", &[]))[0] > 10.0 * wanted[0]);
    for (name, words) in [
        ("mp_left_right.exr", ["left", "right"]),
        ("multi_2layers.exr", ["ViewLayer.Combined", "--layer NAME"]),
    ] {
        dir.refused(&["encode", &case(name), "-q"], &words);
    }
}

#[test]
fn radiance_headers_mean_what_they_say() {
    let dir = Dir::new();
    // FreeImage's EXPOSURE=0 and lines that end in CR LF
    let wanted = pixels(&dir, "exp0.hdr", &[]);
    for name in ["crlf.hdr", "crlf_lfres.hdr"] {
        assert_eq!(pixels(&dir, name, &[]), wanted, "{name}");
    }
    let run = dir.run(&["light", &case("exp0.hdr")]);
    assert!(run.err.contains("EXPOSURE=0"), "{}", run.err);
    // means after the conversion; colours beyond Rec. 709 end at 0 and leave red a little more
    near(mean(&pixels(&dir, "primaries.hdr", &[])), [0.364, 0.484, 0.619], 0.03);
}

#[test]
fn transfer_curves_of_png_are_applied() {
    let dir = Dir::new();
    let found = pixels(&dir, "p16_cicp_pq.png", &[]);
    let whole = mean(&found).iter().sum::<f64>() / 3.0;
    let largest = found.as_flattened().iter().fold(0f32, |a, b| a.max(*b));
    assert!((whole / 0.362 - 1.0).abs() < 0.01 && (largest / 20.5 - 1.0).abs() < 0.01, "{whole}, {largest}");
    // of a display's range: as `fit` takes it
    let args = ["fit", &case("p16_gama1.png"), "--steps", "1", "--starts", "1", "-q", "-o", "f.json"];
    dir.ok(&[&args[..], &["--completed", "seen.exr", "--size", "128"]].concat());
    let whole = mean(&readers::exr(&dir.path("seen.exr")).pixels).iter().sum::<f64>() / 3.0;
    assert!((whole / 0.316 - 1.0).abs() < 0.01, "{whole}");
}

#[test]
fn what_is_transparent_or_not_stored_is_unknown() {
    let dir = Dir::new();
    for (name, share) in
        [("alpha_nadir.exr", "12.5 %"), ("crop_upper.exr", "50.0 %"), ("transparent.exr", "63.3 %")]
    {
        let run = dir.run(&["encode", &case(name), "-o", "x.json", "-f"]);
        assert!(
            run.code == Some(0) && run.err.contains(share) && run.err.contains("unknown"),
            "{name}: {run:?}"
        );
        let run = dir.run(&["prepare", &case(name), "-o", "set", "--size", "64x32", "-q"]);
        assert!(
            run.code != Some(0) && format!("{}{}", run.out, run.err).contains("unknown"),
            "{name}: {run:?}"
        );
    }
}
