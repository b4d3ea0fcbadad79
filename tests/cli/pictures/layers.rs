//! Which pixels of a picture are meant: parts of panoramas, layers, holes.

use super::*;

#[test]
fn parts_of_panoramas_are_placed_or_refused() {
    let dir = Dir::new();
    for name in ["gpano_crop.jpg", "gpano_full.jpg"] {
        dir.write(name, file(name));
    }
    let (none, run) = prepared(&dir, "gpano_crop.jpg", "128x64", &[]);
    assert!(none.is_none() && run.code != Some(0), "{run:?}");
    assert!(format!("{}{}", run.out, run.err).contains("75 % of it are unknown"), "{run:?}");
    assert!(prepared(&dir, "gpano_full.jpg", "128x64", &[]).0.is_some());
    let fitted = |name: &str| one(&dir, &["fit", name, "--steps", "5"])["known_share"].as_f64().unwrap();
    assert!((fitted("gpano_full.jpg") - 1.0).abs() < 1e-3);
    // half of the circle between 45° above and below: sin 45° / 2
    let share = fitted("gpano_crop.jpg");
    assert!((share - 0.5f64.sqrt() / 2.0).abs() < 0.01, "{share}");
    let run = dir.run(&["fit", "gpano_crop.jpg", "--steps", "2"]);
    assert!(run.err.contains("is a part, at (64, 32), of a panorama of 256 × 128"), "{run:?}");
    // what a photograph says of itself is not asked
    let run = dir.run(&["fit", "gpano_crop.jpg", "--fov", "60", "--steps", "2"]);
    assert!(run.code == Some(0) && run.err.contains("ignored"), "{run:?}");
    let facts = one(&dir, &["inspect", "gpano_crop.jpg"]);
    assert!((facts["unknown"].as_f64().unwrap() - 0.75).abs() < 1e-9, "{facts}");
}

#[test]
fn layers_are_chosen_by_name_and_vectors_are_none() {
    let dir = Dir::new();
    let stereo = || vec![layer("left", rgb("", 1.0), |_| ()), layer("right", rgb("", 3.0), |_| ())];
    exr(&dir.path("stereo.exr"), stereo(), (WIDTH, HEIGHT));
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let vector = |prefix: &str| ["X", "Y", "Z"].map(|n| (format!("{prefix}{n}"), vec![0.5; WIDTH * HEIGHT]));
    plain(
        &dir.path("karma.exr"),
        [rgb("C.", 1.0), rgb("albedo.", 9.0), vector("N.").to_vec()].concat(),
        |_| (),
    );
    plain(
        &dir.path("blender.exr"),
        [rgb("View.Combined.", 1.0), rgb("View.Diffuse.", 9.0), vector("View.Normal.").to_vec()].concat(),
        |_| (),
    );
    plain(
        &dir.path("prefix.exr"),
        [rgb("HDR.", 1.0), rgb("N.", 9.0), vector("Position.").to_vec()].concat(),
        |_| (),
    );
    plain(&dir.path("views.exr"), [rgb("A.Combined.", 1.0), rgb("B.Combined.", 3.0)].concat(), |_| ());
    plain(&dir.path("vectors.exr"), vector("N.").to_vec(), |_| ());
    let expected = mean(&dir, &["ref.exr"]);
    let is = |args: &[&str], factor: f64| {
        let found = mean(&dir, args);
        assert!((found / expected / factor - 1.0).abs() < 1e-4, "{args:?}: {found} for {expected}");
    };
    for name in ["karma.exr", "blender.exr", "prefix.exr"] {
        is(&[name], 1.0);
    }
    is(&["stereo.exr", "--layer", "right"], 3.0);
    is(&["views.exr", "--layer", "B.Combined"], 3.0);
    // every command names the layers and the option, and has it
    for (args, more) in [
        (&["encode", "stereo.exr"][..], &[][..]),
        (&["fit", "stereo.exr"], &["--steps", "2"]),
        (&["inspect", "stereo.exr"], &[]),
        (&["bake", "stereo.exr", "-o", "b.exr"], &["--size", "16", "--device", "cpu"]),
        (&["render-probe", "stereo.exr", "-o", "p.exr"], &["--size", "16"]),
    ] {
        dir.refused(&[args, more, &["-q"]].concat(), &["stereo.exr", "\"left\", \"right\"", "--layer NAME"]);
        dir.refused(
            &[args, more, &["--layer", "middle", "-q"]].concat(),
            &["\"middle\"", "\"left\", \"right\""],
        );
        dir.ok(&[args, more, &["--layer", "left", "-q"]].concat());
    }
    let run = prepared(&dir, "stereo.exr", "64x32", &[]).1;
    assert!(format!("{}{}", run.out, run.err).contains("--layer NAME"), "{run:?}");
    let [r, ..] = means(&prepared(&dir, "stereo.exr", "64x32", &["--layer", "right"]).0.unwrap());
    let [wanted, ..] = means(&prepared(&dir, "ref.exr", "64x32", &[]).0.unwrap());
    assert!((r / wanted / 3.0 - 1.0).abs() < 0.01);
    dir.refused(&["encode", "vectors.exr", "-q"], &["vectors.exr", "N.X, N.Y, N.Z", "vectors"]);
}

#[test]
fn what_is_transparent_or_not_stored_is_unknown() {
    let dir = Dir::new();
    let below = |y: usize| y >= 28;
    // an eighth is transparent at the nadir; the rest is stored times its alpha of a half
    let alpha: Vec<f32> = (0..WIDTH * HEIGHT).map(|at| if below(at / WIDTH) { 0.0 } else { 0.5 }).collect();
    let mut channels = rgb("", 1.0);
    for (_, values) in &mut channels {
        values.iter_mut().zip(&alpha).for_each(|(v, a)| *v *= a);
    }
    channels.push(("A".to_owned(), alpha));
    plain(&dir.path("alpha.exr"), channels, |_| ());
    exr(
        &dir.path("crop.exr"),
        vec![layer("", rgb("", 1.0), |own| own.layer_position = Vec2(32, 0))],
        (128, 64),
    );
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    for (name, percent) in [("alpha.exr", "12"), ("crop.exr", "75")] {
        let (none, run) = prepared(&dir, name, "64x32", &[]);
        let said = format!("{}{}", run.out, run.err);
        assert!(none.is_none() && said.contains(&format!("{percent} % of it are unknown")), "{name}: {said}");
        for args in [&["encode", name][..], &["render-probe", name, "-o", "p.exr", "--size", "16", "--force"]]
        {
            let run = dir.run(args);
            assert!(run.code == Some(0) && run.err.contains("% of it are unknown"), "{run:?}");
        }
        let share = one(&dir, &["fit", name, "--steps", "2"])["known_share"].as_f64().unwrap();
        assert!(share < 0.99, "{name}: {share}");
        assert!(one(&dir, &["inspect", name])["unknown"].as_f64().unwrap() > 0.12);
    }
    // divided by alpha: the sky is as bright as the whole one, and what is filled is no black hole
    let exposure = |name: &str| one(&dir, &["encode", name])["latent"]["exposure"].as_f64().unwrap();
    assert!((exposure("alpha.exr") - exposure("ref.exr")).abs() < 0.02);
    // less than one pixel in a hundred is filled
    let mut channels = rgb("", 1.0);
    channels.push(("A".to_owned(), (0..WIDTH * HEIGHT).map(|at| if at < 16 { 0.0 } else { 1.0 }).collect()));
    plain(&dir.path("hole.exr"), channels, |_| ());
    let filled = prepared(&dir, "hole.exr", "64x32", &[]).0.unwrap();
    assert!(filled.pixel(3, 0)[0] > 0.1, "{:?}", filled.pixel(3, 0));
}

#[test]
fn a_damaged_palette_costs_its_own_file_only() {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("in")).unwrap();
    dir.write("plte4.png", file("plte4.png"));
    dir.write("in/plte4.png", file("plte4.png"));
    plain(&dir.path("in/ref.exr"), rgb("", 1.0), |_| ());
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let words = ["plte4.png", "palette of 4 bytes"];
    dir.refused(&["fit", "plte4.png", "-q"], &words);
    dir.refused(&["fit", "ref.exr", "--mask", "plte4.png", "-q"], &words);
    dir.refused(&["fit", "ref.exr", "--normals", "plte4.png", "-o", "light.json", "-q"], &words);
    let run = dir.run(&["prepare", "in", "-o", "data", "--size", "64x32", "--val", "0"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(run.err.contains("palette of 4 bytes") && dir.path("data/train/ref.exr").is_file(), "{run:?}");
}
