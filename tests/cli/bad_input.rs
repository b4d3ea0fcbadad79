//! Every kind of bad input: exit code 2, one line that names the file and a remedy, nothing left behind.

use std::path::Path;
use std::process::Command;

use crate::util::{Dir, finish, model, panorama, panoramas, text, train_args};

/// A flat (uncompressed) Radiance file of one colour, whatever the header claims.
fn hdr(width: usize, height: usize, rgbe: [u8; 4], pixels: usize) -> Vec<u8> {
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    file.extend(rgbe.repeat(pixels));
    file
}

/// An EXR file, written by another library, with every value `value`.
fn exr(path: &Path, width: usize, height: usize, value: f32) {
    exr::prelude::write_rgb_file(path, width, height, |_, _| (value, value, value)).unwrap();
}

/// The same file with both windows claiming another size.
fn claim(path: &Path, width: i32, height: i32) {
    let mut bytes = std::fs::read(path).unwrap();
    for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap() + name.len() + 4;
        for (k, v) in [0, 0, width - 1, height - 1].into_iter().enumerate() {
            bytes[at + 4 * k..][..4].copy_from_slice(&v.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

/// All commands that read a panorama refuse `file` with `words`.
fn refused_everywhere(dir: &Dir, file: &str, words: &[&str]) {
    let words = [&[file], words].concat();
    dir.refused(&["bake", file, "--model", model(), "-o", "out.exr", "-q"], &words);
    dir.refused(&["encode", file, "--model", model(), "-o", "out.json", "-q"], &words);
    dir.refused(&["inspect", file], &words);
    dir.refused(&train_args(file, "run", "1"), &words);
}

#[test]
fn images_that_are_no_panoramas() {
    let dir = Dir::new();
    dir.write("empty.exr", "");
    refused_everywhere(&dir, "empty.exr", &["empty"]);
    dir.write("noise.exr", b"\x76\x2f\x31\x01 this is not what an EXR file looks like");
    refused_everywhere(&dir, "noise.exr", &[]);
    dir.write("zero.hdr", hdr(0, 0, [0; 4], 0));
    refused_everywhere(&dir, "zero.hdr", &["0"]);
    dir.write("wide.hdr", hdr(6, 2, [128, 128, 128, 129], 12));
    refused_everywhere(&dir, "wide.hdr", &["6 × 2", "twice"]);
    dir.write("black.hdr", hdr(4, 2, [0; 4], 8));
    refused_everywhere(&dir, "black.hdr", &["black"]);
    exr(&dir.path("nan.exr"), 8, 4, f32::NAN);
    refused_everywhere(&dir, "nan.exr", &["positive and finite"]);
}

#[test]
fn headers_that_lie() {
    let dir = Dir::new();
    exr(&dir.path("zero.exr"), 8, 4, 1.0);
    claim(&dir.path("zero.exr"), 0, 0);
    refused_everywhere(&dir, "zero.exr", &[]);
    // 44,722 × 22,361 is 10⁹ pixels, or 12 GB
    exr(&dir.path("huge.exr"), 8, 4, 1.0);
    claim(&dir.path("huge.exr"), 44_722, 22_361);
    refused_everywhere(&dir, "huge.exr", &[]);
    dir.write("huge.hdr", hdr(44_722, 22_361, [128; 4], 3));
    refused_everywhere(&dir, "huge.hdr", &["44722 × 22361", "limit"]);
}

#[test]
fn truncated_files() {
    let dir = Dir::new();
    for name in ["cut.exr", "cut.hdr"] {
        dir.ok(&["bake", "--seed", "1", "--model", model(), "--size", "64", "-o", name]);
        let whole = std::fs::read(dir.path(name)).unwrap();
        for part in [whole.len() - 1, whole.len() / 2, 40] {
            dir.write(name, &whole[..part]);
            // what is left of a baked EXR may still hold the whole latent, in its header: only pixels are lost
            dir.refused(&["inspect", name], &[name]);
            if part == 40 {
                refused_everywhere(&dir, name, &[]);
            }
        }
    }
    let whole = std::fs::read(panorama()).unwrap();
    dir.write("real.exr", &whole[..whole.len() / 2]);
    refused_everywhere(&dir, "real.exr", &[]);
}

#[test]
fn low_dynamic_range_images_name_the_command_that_expands_them() {
    let dir = Dir::new();
    image::RgbImage::from_pixel(8, 4, image::Rgb([90, 120, 200])).save(dir.path("sky.png")).unwrap();
    let words = ["sky.png", "PNG", "prepare"];
    dir.refused(&["bake", "sky.png", "--model", model(), "-o", "out.exr", "-q"], &words);
    dir.refused(&["encode", "sky.png", "--model", model(), "-o", "out.json", "-q"], &words);
    dir.refused(&train_args("sky.png", "run", "1"), &words);
    // which is said of the picture all the same
    assert!(dir.ok(&["inspect", "sky.png"]).contains("a display's range"));
}

#[test]
fn latents_of_another_model() {
    let dir = Dir::new();
    let bake = |file: &str, words: &[&str]| {
        dir.refused(&["bake", file, "--model", model(), "-o", "out.exr"], &[&[file], words].concat());
    };
    dir.write("n.json", r#"{"format":1,"n":2,"vectors":[[1,2,3],[4,5,6]],"exposure":0}"#);
    bake("n.json", &["2 vectors", "has 4", "--model"]);
    let vectors = "[1,2,3],[4,5,6],[1,0,0],[0,1,0]";
    dir.write(
        "hash.json",
        format!(r#"{{"format":1,"model":"0123456789abcdef","n":4,"vectors":[{vectors}],"exposure":0}}"#),
    );
    bake("hash.json", &["0123456789abcdef", "--model"]);
    dir.write("future.json", format!(r#"{{"format":99,"n":4,"vectors":[{vectors}],"exposure":0}}"#));
    bake("future.json", &["99"]);
    dir.write("broken.json", "{\"format\":1,");
    bake("broken.json", &["not a latent"]);
    dir.write("infinite.json", format!(r#"{{"format":1,"n":4,"vectors":[{vectors}],"exposure":1e39}}"#));
    bake("infinite.json", &["finite"]);
}

#[test]
fn models_that_are_none() {
    let dir = Dir::new();
    let whole = std::fs::read(model()).unwrap();
    dir.write("cut.safetensors", &whole[..whole.len() / 2]);
    dir.write("text.safetensors", "not a model");
    for file in ["cut.safetensors", "text.safetensors", "missing.safetensors"] {
        dir.refused(&["bake", "--seed", "1", "--model", file, "-o", "out.exr"], &[file]);
        dir.refused(&["sample", "--model", file, "-o", "out.png"], &[file]);
        dir.refused(&["encode", &panorama(), "--model", file, "-o", "out.json"], &[file]);
    }
    std::fs::create_dir(dir.path("folder")).unwrap();
    dir.refused(
        &["bake", "--seed", "1", "--model", "folder", "-o", "out.exr"],
        &["folder", "model.safetensors"],
    );
}

#[test]
fn files_that_are_not_there() {
    let dir = Dir::new();
    refused_everywhere(&dir, "nothing.exr", &["No such file"]);
    dir.refused(
        &["bake", "nothing.json", "--model", model(), "-o", "out.exr"],
        &["nothing.json", "No such file"],
    );
}

#[test]
fn outputs_are_checked_before_the_work() {
    let dir = Dir::new();
    let old = dir.write("old.exr", "precious");
    dir.write("old.json", "precious");
    dir.write("old.png", "precious");
    let (m, p) = (model(), panorama());
    let bake =
        |out: &str, words: &[&str]| dir.refused(&["bake", "--seed", "1", "--model", m, "-o", out], words);
    bake("old.exr", &["old.exr", "--force"]);
    bake("sky.jpg", &["sky.jpg", ".exr"]);
    bake("sky", &["sky", ".exr"]);
    bake("missing/sky.exr", &["missing", "create"]);
    bake("old.exr/sky.exr", &["old.exr", "name another"]);
    dir.refused(&["bake", "--seed", "1", "--model", m, "-o", "a.exr", "-o", "a.exr"], &["a.exr", "twice"]);
    dir.refused(
        &["bake", "--seed", "1", "--model", m, "-o", "a.exr", "-o", "old.png"],
        &["old.png", "--force"],
    );
    dir.refused(&["encode", &p, "--model", m, "-o", "old.json"], &["old.json", "--force"]);
    dir.refused(
        &["encode", &p, "--model", m, "-o", "a.json", "--preview", "old.png"],
        &["old.png", "--force"],
    );
    dir.refused(&["sample", "--model", m, "-o", "old.png"], &["old.png", "--force"]);
    assert_eq!(std::fs::read(&old).unwrap(), b"precious");
    dir.ok(&["bake", "--seed", "1", "--model", m, "-o", "old.exr", "--size", "16", "--force"]);
    assert!(std::fs::metadata(&old).unwrap().len() > 100, "--force replaces");
}

#[cfg(target_os = "linux")]
#[test]
fn folders_that_cannot_be_written_to() {
    // /proc takes no files from anybody, the superuser included
    let dir = Dir::new();
    dir.refused(
        &["bake", "--seed", "1", "--model", model(), "-o", "/proc/sky.exr"],
        &["/proc", "another folder"],
    );
    dir.refused(
        &["encode", &panorama(), "--model", model(), "-o", "/proc/a.json"],
        &["/proc", "another folder"],
    );
    dir.refused(&train_args(&text(panoramas()), "/proc/run", "1"), &["/proc/run"]);
}

/// A file-size limit stands in for a full disk: the same failure half-way through writing.
#[cfg(unix)]
#[test]
fn a_write_that_fails_half_way_leaves_nothing() {
    let dir = Dir::new();
    let binary = env!("CARGO_BIN_EXE_veni-cli");
    for out in ["sky.exr", "sky.hdr", "sky.png"] {
        let script = format!(
            "trap '' XFSZ; ulimit -f 8; exec '{binary}' bake --seed 1 --float -m '{}' -o {out}",
            model()
        );
        let run = finish(Command::new("sh").args(["-c", &script]).current_dir(dir.path("")));
        assert_eq!(run.code, Some(2), "{out}: {}", run.err);
        assert_eq!(run.err.lines().count(), 1, "{}", run.err);
        let remedy = ["smaller size", "free space"].iter().any(|r| run.err.contains(r));
        assert!(run.err.contains(out) && run.err.contains("File too large") && remedy, "{}", run.err);
        assert!(dir.files().is_empty(), "{:?}", dir.files());
    }
}

#[test]
fn wrong_usage_is_explained() {
    let dir = Dir::new();
    for (args, word) in [
        (vec!["bake", "-o", "a.exr"], "--seed"),
        (vec!["bake", "--seed", "1"], "--output"),
        (vec!["bake", "--seed", "1", "x.json", "-o", "a.exr"], "cannot be used with"),
        (vec!["bake", "--seed", "1", "-o", "a.exr", "--half", "--float"], "cannot be used with"),
        (vec!["bake", "--seed", "1", "-o", "a.exr", "--size", "0x0"], "at least 1"),
        (vec!["bake", "--seed", "1", "-o", "a.exr", "--turn", "NaN"], "finite"),
        (vec!["bake", "--seed", "1", "-o", "a.exr", "--exposure", "200"], "64 stops"),
        (vec!["frobnicate"], "unrecognized"),
    ] {
        let run = dir.run(&args);
        assert_eq!((run.code, run.out.as_str()), (Some(2), ""), "{args:?}");
        assert!(run.err.contains(word), "{args:?}: '{word}' is missing in {}", run.err);
    }
    dir.refused(
        &["bake", "--seed", "1", "-m", model(), "-o", "a.exr", "--size", "300x100"],
        &["300x100", "300x150"],
    );
}

#[test]
fn what_is_replaced_is_said() {
    let dir = Dir::new();
    let write = |name: &str, bad: f32| {
        let value = |x: usize, y: usize| if (x, y) == (3, 4) { bad } else { 1.0 + x as f32 };
        exr::prelude::write_rgb_file(dir.path(name), 16, 8, |x, y| (value(x, y), 1.0, 1.0)).unwrap();
    };
    let said = |command: &[&str]| {
        let run = dir.run(&[command, &["-o", "z.json", "--model", model(), "--force"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.err);
        run.err
    };
    for (name, bad, encoded, fitted) in [
        ("ringing.exr", -0.25, "1 values are negative: they count as 0", "1 negative values count as black"),
        ("hole.exr", f32::NAN, "1 values are not a number", "1 pixels are not numbers"),
        ("dark.exr", 0.0, "", ""),
    ] {
        write(name, bad);
        for (command, says) in [(&["encode", name][..], encoded), (&["fit", name, "--steps", "1"], fitted)] {
            let err = said(command);
            let expected = if says.is_empty() {
                !err.contains("values")
            } else {
                err.contains(&format!("{name}: {says}"))
            };
            assert!(expected, "{command:?}: {err}");
        }
    }
}
