//! `prepare --expand-with`: networks of the user's own. With feature `onnx` they are run, without it refused.

use crate::util::Dir;

#[cfg(not(feature = "onnx"))]
#[test]
fn a_program_without_the_runtime_says_how_to_build_one() {
    let dir = Dir::new();
    dir.write("net.onnx", "whatever");
    std::fs::create_dir(dir.path("in")).unwrap();
    let args = ["prepare", "in", "-o", "data", "--expand-with", "net.onnx"];
    dir.refused(&args, &["--expand-with net.onnx", "--features onnx"]);
}

#[cfg(feature = "onnx")]
mod with_runtime {
    use image::{Rgb, RgbImage};
    use serde_json::Value;
    use veni_image::Panorama;
    use veni_image::tonemap::srgb_to_linear;

    use super::Dir;
    use crate::onnx_file::OnnxFile;

    const WHITE: usize = 40;

    /// A picture of 64 × 32: a gradient, and columns 0 to 7 and 60 to 63 of rows 4 to 11 white: across the seam.
    fn picture(dir: &Dir, name: &str, shift: u32) {
        let image = RgbImage::from_fn(64, 32, |x, y| match (x, y) {
            (0..8 | 60..64, 4..12) => Rgb([255; 3]),
            _ => Rgb([(30 + x + shift) as u8, (40 + 2 * y) as u8, (60 + (x * y + shift) % 50) as u8]),
        });
        image.save(dir.path("in").join(name)).unwrap();
    }

    fn folder() -> Dir {
        let dir = Dir::new();
        std::fs::create_dir(dir.path("in")).unwrap();
        picture(&dir, "a.png", 0);
        picture(&dir, "b.png", 90);
        dir
    }

    fn report(dir: &Dir, out: &str) -> Value {
        serde_json::from_slice(&std::fs::read(dir.path(out).join("report.json")).unwrap()).unwrap()
    }

    /// 40 times linear radiance, as radiance or its logarithm; `size` 0 × 0 is free.
    fn network(log: bool, size: [u64; 2]) -> Vec<u8> {
        if !log {
            return OnnxFile::times(WHITE as f32, size).bytes();
        }
        let file = OnnxFile::image(size).constant("white", &[], &[WHITE as f32]);
        // a little light, so that black has a logarithm
        let file = file.constant("light", &[], &[1e-6]).node("Mul", &["x", "white"], "bright", &[]);
        file.node("Add", &["bright", "light"], "z", &[]).node("Log", &["z"], "y", &[]).bytes()
    }

    #[test]
    fn pictures_are_expanded_by_it() {
        let dir = folder();
        dir.write("linear.onnx", network(false, [0, 0]));
        dir.write("log.onnx", network(true, [0, 0]));
        dir.write("fixed.onnx", network(false, [32, 64]));
        let base = ["prepare", "in", "--size", "64", "--val", "0", "-q"];
        for (out, model, options) in [
            ("linear", "linear.onnx", &[][..]),
            ("log", "log.onnx", &["--expand-input", "linear", "--expand-output", "log"]),
            ("fixed", "fixed.onnx", &[]),
        ] {
            dir.ok(&[&base[..], &["-o", out, "--expand-with", model], options].concat());
            let image = Panorama::read(dir.path(out).join("train/a.exr")).unwrap();
            let source = image::open(dir.path("in/a.png")).unwrap().to_rgb8();
            for (k, pixel) in image.pixels().iter().enumerate() {
                let stored = source.get_pixel(k as u32 % 64, k as u32 / 64).0;
                let linear = stored.map(|v| srgb_to_linear(f32::from(v) / 255.0));
                let expected = if stored == [255; 3] { [WHITE as f32; 3] } else { linear };
                for (a, b) in pixel.iter().zip(expected) {
                    // half precision
                    assert!((a / b - 1.0).abs() < 1e-3, "{out}, pixel {k}: {a} is not {b}");
                }
            }
            let report = report(&dir, out);
            let settings = &report["settings"]["network"];
            let file =
                report["files"].as_array().unwrap().iter().find(|f| f["source"] == "in/a.png").unwrap();
            let by = &file["expanded"]["network"];
            assert_eq!((&settings["model"], &by["model"]), (&model.into(), &model.into()), "{report}");
            assert_eq!((&settings["sha256"], by["sha256"].as_str().map(str::len)), (&by["sha256"], Some(16)));
            let markdown = std::fs::read_to_string(dir.path(out).join("report.md")).unwrap();
            assert!(markdown.matches(&format!("by {model}")).count() == 3, "{markdown}");
        }

        // the same network in a renamed file goes on, another one does not
        std::fs::rename(dir.path("linear.onnx"), dir.path("renamed.onnx")).unwrap();
        let again = ["prepare", "in", "--size", "64", "--val", "0", "-o", "linear", "--expand-with"];
        let run = dir.run(&[&again[..], &["renamed.onnx"]].concat());
        assert!(run.code == Some(0) && run.err.contains("2 of 2 files were examined before"), "{}", run.err);
        for other in [&["fixed.onnx"][..], &["renamed.onnx", "--expand-scale", "match"]] {
            dir.refused(&[&again[..], other].concat(), &["other settings", "linear.onnx", "--force"]);
        }
        dir.refused(&again[..again.len() - 1], &["other settings", "linear.onnx"]);

        // options that are not the network's are noticed
        dir.write("dim.onnx", OnnxFile::times(0.5, [0, 0]).bytes());
        let dim = ["prepare", "in", "--size", "64", "--val", "0", "-o", "dim", "--expand-with", "dim.onnx"];
        let run = dir.run(&dim);
        assert!(run.code == Some(0) && run.err.contains("100 % of the clipped values"), "{}", run.err);
    }

    #[test]
    fn networks_that_do_not_fit_are_refused() {
        let dir = folder();
        let with =
            |model: &'static str| vec!["prepare", "in", "--size", "64", "-o", "data", "--expand-with", model];
        dir.refused(&with("none.onnx"), &["none.onnx", "cannot open"]);
        dir.write("text.onnx", "no network");
        dir.refused(&with("text.onnx"), &["text.onnx", "not an ONNX model"]);
        let grey = OnnxFile::default().value(11, "x", 1, &[1, 1, 0, 0]).value(12, "y", 1, &[]);
        dir.write("grey.onnx", grey.node("Relu", &["x"], "y", &[]).bytes());
        dir.refused(&with("grey.onnx"), &["grey.onnx", "1 x 1 x", "1 x 3 x H x W"]);
        dir.write("fixed.onnx", network(false, [32, 64]));
        let sized = |size| [with("fixed.onnx"), vec!["--expand-size", size]].concat();
        dir.refused(&sized("128"), &["fixed.onnx", "64 × 32", "128 × 64"]);
        dir.refused(&sized("128x60"), &["--expand-size 128x60", "128x64"]);
        dir.refused(&[with("fixed.onnx"), vec!["--expand", "off"]].concat(), &["--expand off", "fixed.onnx"]);

        // one that fits, and then gives what is not radiance: the picture is refused, and both are named
        let nan = OnnxFile::image([0, 0]).constant("two", &[], &[2.0]).node("Sub", &["x", "two"], "z", &[]);
        dir.write("nan.onnx", nan.node("Sqrt", &["z"], "y", &[]).bytes());
        let run = dir.run(&[with("nan.onnx"), vec!["--json"]].concat());
        let value: Value = serde_json::from_str(&run.out).unwrap();
        assert_eq!((run.code, &value["refused"]), (Some(1), &2.into()), "{value}");
        for word in ["in/a.png: ", "nan.onnx", "not numbers"] {
            assert!(run.err.contains(word), "{}", run.err);
        }
    }
}
