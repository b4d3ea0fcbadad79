//! What is wrong is named: latents that cannot be decoded, files whose names say something else, devices.

use crate::readers;
use crate::util::Dir;

/// A small panorama of high dynamic range.
fn sky(dir: &Dir, name: &str) {
    let pixel = |x: usize, y: usize| (0.5, 0.6 + x as f32 / 64.0, 0.7 + y as f32 / 32.0);
    exr::prelude::write_rgb_file(dir.path(name), 64, 32, pixel).unwrap();
}

#[test]
fn a_latent_that_cannot_be_decoded_is_named_with_its_value() {
    let dir = Dir::new();
    dir.ok(&["sample", "--count", "1", "--seed", "3", "--latents", ".", "-o", "s.png", "--size", "16", "-q"]);
    let text = std::fs::read_to_string(dir.path("sky-3.json")).unwrap();
    let good: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut far = good.clone();
    far["vectors"][0] = serde_json::json!([1e5, 0.0, 0.0]);
    dir.write("far.json", far.to_string());
    let mut bright = good.clone();
    bright["exposure"] = 200.into();
    dir.write("bright.json", bright.to_string());
    for (file, words) in [
        ("far.json", ["latent vector 0 is [100000.0, 0.0, 0.0]", "65536"]),
        ("bright.json", ["the exposure is 200", "from -87 to 87"]),
    ] {
        let words = [&[file], &words[..]].concat();
        for out in ["o.exr", "o.hdr", "o.png"] {
            dir.refused(&["bake", file, "-o", out, "--size", "16", "-q"], &words);
        }
        dir.refused(&["light", file, "-q"], &words);
        dir.refused(&["render-probe", file, "-o", "o.exr", "--size", "16", "-q"], &words);
    }
    // together with what the command line adds
    bright["exposure"] = 86.into();
    dir.write("bright.json", bright.to_string());
    let args = ["bake", "bright.json", "-o", "o.hdr", "--size", "16", "--exposure", "4", "-q"];
    dir.refused(&args, &["radiance", "the exposure is too high"]);
}

#[test]
fn content_decides_what_a_file_is() {
    let dir = Dir::new();
    sky(&dir, "sky.exr");
    std::fs::copy(dir.path("sky.exr"), dir.path("sky.json")).unwrap();
    let light = |name: &str| dir.json(&["light", name]).remove(0);
    assert_eq!(light("sky.json"), light("sky.exr"));
    image::RgbImage::from_pixel(8, 4, image::Rgb([9; 3])).save(dir.path("grey.png")).unwrap();
    std::fs::rename(dir.path("grey.png"), dir.path("grey.json")).unwrap();
    dir.refused(&["light", "grey.json", "-q"], &["grey.json: PNG holds no high dynamic range"]);
    dir.write("cut.json", "[1, 2");
    dir.refused(&["light", "cut.json", "-q"], &["cut.json: not a latent"]);
}

#[test]
fn a_format_that_is_not_read_is_told_those_that_are() {
    let dir = Dir::new();
    dir.write("sky.png", b"\x1f\x8b\x08 compressed once more");
    dir.refused(&["fit", "sky.png", "-q"], &["sky.png: neither an OpenEXR", ".hdr", "PNG", "JPEG", "WebP"]);
    // where those would be of no use, nothing is said of them
    let run = dir.run(&["light", "sky.png", "-q"]);
    assert!(run.err.contains("neither an OpenEXR nor a Radiance .hdr file"), "{}", run.err);
}

/// One that has no end would fill the disk.
#[cfg(target_os = "linux")]
#[test]
fn devices_are_no_files_and_pipes_are() {
    let dir = Dir::new();
    sky(&dir, "sky.exr");
    for device in ["/dev/zero", "/dev/null", "/dev/urandom"] {
        dir.refused(&["light", device, "-q"], &[device, "is a device, not a file"]);
    }
    dir.refused(&["fit", "sky.exr", "--mask", "/dev/zero", "-q"], &["/dev/zero", "is a device, not a file"]);
    let direct = dir.json(&["light", "sky.exr"]).remove(0);
    for input in ["-", "/dev/stdin"] {
        let mut command = dir.command(&["light", input, "--json", "-q"]);
        command.stdin(std::process::Stdio::from(std::fs::File::open(dir.path("sky.exr")).unwrap()));
        let run = crate::util::finish(&mut command);
        assert_eq!(run.code, Some(0), "{}", run.err);
        assert_eq!(serde_json::from_str::<serde_json::Value>(&run.out).unwrap(), direct);
    }
    let fifo = dir.path("fifo.exr");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let bytes = std::fs::read(dir.path("sky.exr")).unwrap();
    let writer = std::thread::spawn(move || std::fs::write(fifo, bytes).unwrap());
    assert_eq!(dir.json(&["light", "fifo.exr"]).remove(0), direct);
    writer.join().unwrap();
}

/// An L of three squares on the ground, seen from above, and a cube of a file whose lines end as they once did.
#[test]
fn concave_faces_and_old_line_ends_are_read() {
    let dir = Dir::new();
    sky(&dir, "sky.exr");
    let corners = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n";
    let seen = |text: &str| {
        dir.write("l.obj", text);
        let args = ["render-probe", "sky.exr", "--mesh", "l.obj", "--up", "z", "--elevation", "80"];
        let out = ["-o", "l.exr", "--mask", "m.png", "--size", "64", "-f", "-q"];
        dir.ok(&[&args[..], &out[..]].concat());
        (image::open(dir.path("m.png")).unwrap().to_luma8(), readers::exr(&dir.path("l.exr")).pixels)
    };
    let (shape, light) = seen(&format!("{corners}f 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 6\n"));
    for face in ["f 1 2 3 4 5 6\n", "f 2 3 4 5 6 1\n", "f 3 4 5 6 1 2\n", "f 5 6 1 2 3 4\n"] {
        let whole = format!("{corners}{face}");
        for text in [whole.replace('\n', "\r\n"), whole.replace('\n', "\r"), whole] {
            let found = seen(&text);
            assert_eq!(found.0, shape, "{text:?}");
            let pairs = found.1.iter().flatten().zip(light.iter().flatten());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{text:?}");
        }
    }
}
