//! `-` and pipes in place of files, and text as other programs write it.

use std::io::Write;
use std::process::Stdio;

use crate::util::{Dir, Run};

/// Runs with `input` on standard input; what came out is bytes.
fn piped(dir: &Dir, args: &[&str], input: &[u8]) -> (Option<i32>, Vec<u8>, String) {
    let mut command = dir.command(args);
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    // a command that refuses does not read it all
    let writer = std::thread::spawn(move || drop(stdin.write_all(&input)));
    let ended = child.wait_with_output().unwrap();
    writer.join().unwrap();
    (ended.status.code(), ended.stdout, String::from_utf8(ended.stderr).unwrap())
}

fn sky(dir: &Dir) -> (Vec<u8>, String) {
    dir.ok(&["bake", "--seed", "5", "--size", "64", "--device", "cpu", "-q", "-o", "sky.exr"]);
    let latent = dir.ok(&["encode", "sky.exr", "-q"]);
    dir.write("sky.json", &latent);
    (std::fs::read(dir.path("sky.exr")).unwrap(), latent)
}

#[test]
fn panoramas_and_latents_come_through_pipes() {
    let dir = Dir::new();
    let (exr, latent) = sky(&dir);
    for name in ["-", "/dev/stdin"] {
        let (code, out, err) = piped(&dir, &["encode", name, "-q"], &exr);
        assert_eq!(code, Some(0), "{err}");
        let out = String::from_utf8(out).unwrap();
        assert_eq!(out.replace("\"stdin\"", "\"sky.exr\""), latent, "{name}");
        let (code, out, err) = piped(&dir, &["inspect", name], &exr);
        let out = String::from_utf8(out).unwrap();
        let shown = if name == "-" { "stdin" } else { name };
        assert!(code == Some(0) && out.starts_with(&format!("{shown}: OpenEXR image")), "{out}{err}");
        let (code, _, err) = piped(
            &dir,
            &["bake", name, "-o", "x.exr", "--size", "64", "--device", "cpu", "-f", "-q"],
            latent.as_bytes(),
        );
        assert_eq!(code, Some(0), "{err}");
        let (code, _, err) = piped(
            &dir,
            &["fit", name, "--steps", "2", "--resolution", "16", "-o", "f.json", "-f", "-q"],
            &exr,
        );
        assert_eq!(code, Some(0), "{err}");
        let (code, _, err) =
            piped(&dir, &["render-probe", name, "-o", "p.png", "--size", "16", "-f", "-q"], &exr);
        assert_eq!(code, Some(0), "{err}");
    }
    // what is wrong is said of the pipe, not of a copy
    let (code, _, err) = piped(&dir, &["encode", "-", "-q"], b"no image");
    assert!(code == Some(2) && err.starts_with("veni-cli: stdin: "), "{err}");
    let (code, _, err) = piped(&dir, &["encode", "-", "-", "-q", "--out-dir", "o"], &exr);
    assert!(code == Some(2) && err.contains("twice"), "{err}");
    let (code, out, err) = piped(&dir, &["encode", "-", "--out-dir", "o", "--json", "-q"], &exr);
    assert_eq!(code, Some(0), "{err}");
    let out: serde_json::Value = serde_json::from_slice(&out).unwrap();
    assert_eq!((out["panorama"].as_str(), out["output"].as_str()), (Some("stdin"), Some("o/stdin.json")));
}

#[cfg(unix)]
#[test]
fn named_pipes_are_read_like_files() {
    let dir = Dir::new();
    let (_, latent) = sky(&dir);
    let script = format!("'{}' encode <(cat sky.exr) -q", env!("CARGO_BIN_EXE_veni-cli"));
    let mut command = std::process::Command::new("bash");
    let Run { code, out, err } = crate::util::finish(command.args(["-c", &script]).current_dir(dir.path("")));
    assert_eq!(code, Some(0), "{err}");
    let source = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap()["vectors"].clone();
    assert_eq!(source(&out), source(&latent));
    // of a set only files are read: nobody may ever write into a pipe
    std::fs::create_dir(dir.path("in")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(dir.path("in/a.exr")).status().unwrap().success());
    std::fs::copy(dir.path("sky.exr"), dir.path("in/b.exr")).unwrap();
    let run = dir.run(&["prepare", "in", "-o", "set", "--size", "32", "-q"]);
    assert!(run.code == Some(0) && run.out.contains("1 panoramas"), "{}{}", run.out, run.err);
    let run = dir.run(&["prepare", "in/a.exr", "-o", "other", "-q"]);
    assert!(run.code == Some(2) && run.err.contains("pipe"), "{}", run.err);
}

#[test]
fn images_go_to_standard_output() {
    let dir = Dir::new();
    let (_, latent) = sky(&dir);
    let bake = ["bake", "sky.json", "--size", "64", "--device", "cpu"];
    for (format, start) in [("exr", &b"\x76\x2f\x31\x01"[..]), ("hdr", b"#?RADIANCE"), ("png", b"\x89PNG")] {
        let file = format!("file.{format}");
        dir.ok(&[&bake[..], &["-o", &file, "-q"]].concat());
        let (code, out, err) = piped(&dir, &[&bake[..], &["-o", "-", "--format", format]].concat(), b"");
        assert_eq!(code, Some(0), "{err}");
        assert!(out.starts_with(start) && out == std::fs::read(dir.path(&file)).unwrap(), "{format}");
        assert!(err.contains("-: 64 x 32"), "the result is beside the image: {err}");
    }
    let (code, exr, err) =
        piped(&dir, &["bake", "-", "-o", "-", "--size", "64", "--device", "cpu", "-q"], latent.as_bytes());
    assert!(code == Some(0) && err.is_empty(), "{err}");
    assert_eq!(exr, std::fs::read(dir.path("file.exr")).unwrap());
    let sheet = ["sample", "-n", "2", "--size", "32", "--device", "cpu", "-q", "-o"];
    dir.ok(&[&sheet[..], &["sheet.png"]].concat());
    let (_, out, _) = piped(&dir, &[&sheet[..], &["-"]].concat(), b"");
    assert_eq!(out, std::fs::read(dir.path("sheet.png")).unwrap());
    let (_, out, _) = piped(&dir, &["encode", "sky.exr", "-o", "-", "-q"], b"");
    assert_eq!(String::from_utf8(out).unwrap(), latent);
    dir.refused(&[&bake[..], &["-o", "-", "-o", "b.exr"]].concat(), &["one image"]);
    dir.refused(&[&bake[..], &["-o", "b.exr", "--format", "png"]].concat(), &["--format"]);
    assert!(!dir.path("-.exr").exists());
}

/// Windows PowerShell writes UTF-16 behind a mark, editors put a mark before UTF-8.
#[test]
fn byte_order_marks_are_read() {
    let dir = Dir::new();
    let (_, latent) = sky(&dir);
    let utf16 = |mark: [u8; 2], bytes: fn(u16) -> [u8; 2]| {
        [mark.to_vec(), latent.encode_utf16().flat_map(bytes).collect()].concat()
    };
    let little = utf16([0xff, 0xfe], u16::to_le_bytes);
    let files = [
        ("bom.json", [b"\xef\xbb\xbf", latent.as_bytes()].concat()),
        ("u16.json", little.clone()),
        ("u16be.json", utf16([0xfe, 0xff], u16::to_be_bytes)),
        ("u16.txt", little),
    ];
    let bake = |file: &str, out: &str| {
        dir.ok(&["bake", file, "-o", out, "--size", "32", "--device", "cpu", "-q", "-f"]);
        std::fs::read(dir.path(out)).unwrap()
    };
    let expected = bake("sky.json", "expected.exr");
    for (name, bytes) in files {
        dir.write(name, bytes);
        assert_eq!(bake(name, "out.exr"), expected, "{name}");
        let shown = dir.ok(&["inspect", name]);
        assert!(shown.contains("latent") && shown.contains("9 (D = "), "{shown}");
    }
    dir.write("cut.json", [0xff, 0xfe, b'{']);
    dir.refused(&["inspect", "cut.json"], &["cut.json", "UTF-16"]);
}

/// A cube far from the origin, with every freedom that the format has, is the cube at the origin.
#[test]
fn meshes_in_other_words_and_far_away_are_the_same() {
    let dir = Dir::new();
    let corners = |at: [f64; 3]| {
        let corner = |k: usize| {
            let [x, y, z] = std::array::from_fn(|c| at[c] + ((k >> c) & 1) as f64 - 0.5);
            format!("v {x} {y} {z}\n")
        };
        (0..8).map(corner).collect::<String>()
    };
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let plain = corners([0.0; 3]) + faces;
    let wordy = plain.replace("f 1 3 4 2", "f 1 3 \\\n 4 2 # the first").replace('\n', "\r\n");
    let utf16: Vec<u8> =
        [0xfeff].into_iter().chain(wordy.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let far = corners([5_000_000.0, 4_000_000.0, 300.0]) + faces;
    dir.write("plain.obj", &plain);
    let render = |file: &str| {
        let args =
            ["render-probe", "--seed", "3", "--mesh", file, "--up", "z", "-o", "out.exr", "--size", "48"];
        let camera =
            dir.json(&[&args[..], &["--azimuth", "30", "--elevation", "20", "-f"]].concat())[0]["camera"]
                .clone();
        (crate::readers::exr(&dir.path("out.exr")).pixels, camera)
    };
    let (expected, near) = render("plain.obj");
    assert!(expected.iter().any(|p| p[0] > 0.0));
    for (name, bytes) in [
        ("wordy.obj", [b"\xef\xbb\xbf", wordy.as_bytes()].concat()),
        ("utf16.obj", utf16),
        ("far.obj", far.into_bytes()),
    ] {
        dir.write(name, bytes);
        let (pixels, camera) = render(name);
        assert_eq!(pixels, expected, "{name}");
        let moved = camera["position"][0].as_f64().unwrap() - near["position"][0].as_f64().unwrap();
        let distance = if name == "far.obj" { 5_000_000.0 } else { 0.0 };
        assert!((moved - distance).abs() < 1e-6, "{name}: the camera is where the file says: {moved}");
    }
}

/// Whatever names a file takes `-`, and says the same as with a file.
#[test]
fn every_input_comes_through_a_pipe() {
    let dir = Dir::new();
    let (exr, _) = sky(&dir);
    dir.ok(&["light", "sky.exr", "-o", "light.json", "-q"]);
    let probe = ["render-probe", "sky.exr", "-o", "ball.exr", "--size", "24", "-q"];
    dir.ok(&[&probe[..], &["--normals", "normals.exr", "--mask", "mask.png"]].concat());
    dir.write("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
    let fit = ["--steps", "2", "--resolution", "16", "--starts", "1", "-q", "-o", "out.json", "-f"];
    let ball = [&["fit", "ball.exr", "--normals", "normals.exr", "--mask", "mask.png"], &fit[..]].concat();
    let albedo =
        [&["fit", "ball.exr", "--normals", "normals.exr", "--albedo-map", "ball.exr"], &fit[..]].concat();
    let cases: [(Vec<&str>, &str); 8] = [
        (vec!["light", "sky.exr", "-o", "out.json", "-f"], "sky.exr"),
        ([&["fit", "ball.exr", "--fov", "60", "--mask", "mask.png"], &fit[..]].concat(), "mask.png"),
        (ball.clone(), "normals.exr"),
        (ball, "mask.png"),
        (albedo, "normals.exr"),
        ([&["fit", "--target-sh", "light.json"], &fit[..]].concat(), "light.json"),
        ([&["fit", "--target-irradiance", "light.json"], &fit[..]].concat(), "light.json"),
        (
            vec![
                "render-probe",
                "sky.exr",
                "--mesh",
                "cube.obj",
                "--size",
                "24",
                "-o",
                "out.exr",
                "-f",
                "-q",
            ],
            "cube.obj",
        ),
    ];
    for (args, name) in cases {
        let out = if args.contains(&"out.exr") { "out.exr" } else { "out.json" };
        dir.ok(&args);
        let expected = std::fs::read(dir.path(out)).unwrap();
        let dashed: Vec<_> = args.iter().map(|arg| if *arg == name { "-" } else { *arg }).collect();
        let (code, _, err) = piped(&dir, &dashed, &std::fs::read(dir.path(name)).unwrap());
        assert_eq!(code, Some(0), "{args:?}: {err}");
        // a latent says what it was found in
        let same = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace("\"stdin\"", &format!("\"{name}\""));
        assert_eq!(same(&std::fs::read(dir.path(out)).unwrap()), same(&expected), "{args:?}");
    }
    let (code, _, err) =
        piped(&dir, &["ibl", "-", "--engine", "gltf", "-o", "ibl", "--size", "16", "-q"], &exr);
    assert!(code == Some(0) && dir.path("ibl").is_dir(), "{err}");
}

#[test]
fn every_output_goes_to_standard_output() {
    let dir = Dir::new();
    sky(&dir);
    let fit =
        ["fit", "sky.exr", "--steps", "2", "--resolution", "16", "--starts", "2", "-q", "-f", "-o", "a.json"];
    let probe = ["render-probe", "sky.exr", "-o", "ball.exr", "--size", "24", "-q", "-f"];
    let light = ["light", "--seed", "19", "--size", "64", "-q", "-f"];
    for (args, option, name) in [
        (&["encode", "sky.exr", "-q", "-f", "-o", "a.json"][..], "--preview", "out.png"),
        (&fit, "--completed", "out.exr"),
        (&fit, "--uncertainty", "out.exr"),
        (&probe, "--normals", "out.exr"),
        (&probe, "--mask", "out.png"),
        (&light, "--residual", "out.exr"),
        (&light, "--sharpened", "out.exr"),
        (&light, "-o", "out.json"),
        (&["synth", "-n", "2", "--size", "32", "-q", "-f"], "--sheet", "out.png"),
    ] {
        dir.ok(&[args, &[option, name]].concat());
        let (code, out, err) = piped(&dir, &[args, &[option, "-"]].concat(), b"");
        assert_eq!(code, Some(0), "{args:?}: {err}");
        assert!(out == std::fs::read(dir.path(name)).unwrap(), "{args:?} {option}");
    }
    assert!(!dir.path("-").exists());
}

/// One option each takes standard input and output; what is a folder, or is to be found again by its name, never does.
#[test]
fn dashes_that_cannot_be_are_one_clear_error() {
    let dir = Dir::new();
    sky(&dir);
    for (args, words) in [
        (&["fit", "-", "--mask", "-"][..], ["PICTURE and --mask", "read only once"]),
        (&["bake", "-", "--model", "-", "-o", "a.exr"], ["LATENT and --model", "read only once"]),
        (&["encode", "-", "-", "--out-dir", "o"], ["PANORAMA names - twice", "read only once"]),
        (&["render-probe", "sky.exr", "-o", "-", "--mask", "-"], ["--output and --mask", "name files"]),
        (&["fit", "sky.exr", "-o", "-", "--completed", "-"], ["--output and --completed", "name files"]),
        (&["fit", "sky.exr", "--completed", "-"], ["standard output too", "-o"]),
        (&["encode", "sky.exr", "--preview", "-"], ["standard output too", "-o"]),
        (&["bake", "--seed", "1", "--out-dir", "-"], ["--out-dir -", "./-"]),
        (&["sample", "-o", "a.png", "--latents", "-"], ["--latents -", "./-"]),
        (&["synth", "-o", "-"], ["--output -", "./-"]),
        (&["day", "--place", "48,11", "--date", "2026-06-21", "-o", "-"], ["--output -", "./-"]),
        (&["ibl", "sky.exr", "--engine", "gltf", "-o", "-"], ["--output -", "./-"]),
        (&["prepare", "-", "-o", "set"], ["INPUT -", "./-"]),
        (&["prepare", ".", "-o", "set", "--expand-with", "-"], ["--expand-with -", "./-"]),
        (&["man", "-"], ["DIR -", "./-"]),
    ] {
        dir.refused(args, &words);
    }
    // a second name of standard input
    #[cfg(target_os = "linux")]
    {
        let exr = std::fs::read(dir.path("sky.exr")).unwrap();
        let (code, _, err) = piped(&dir, &["fit", "-", "--mask", "/dev/stdin", "-o", "a.json", "-q"], &exr);
        assert!(code == Some(2) && err.contains("read only once"), "{err}");
    }
}

/// A process that is killed outright cannot remove the copy of what came in; the next one does.
#[cfg(unix)]
#[test]
fn what_a_killed_process_kept_of_a_pipe_is_swept_by_the_next() {
    use std::io::Write as _;
    let dir = Dir::new();
    sky(&dir);
    let temporary = dir.path("tmp");
    std::fs::create_dir(&temporary).unwrap();
    let kept = || std::fs::read_dir(&temporary).unwrap().count();
    let begin = || {
        let mut command = dir.command(&["encode", "-", "-q"]);
        let command = command.env("TMPDIR", &temporary).stdin(Stdio::piped()).stdout(Stdio::null());
        let mut child = command.spawn().unwrap();
        // more is to come
        child.stdin.as_mut().unwrap().write_all(b"#?RADIANCE\n").unwrap();
        child
    };
    let mut killed = begin();
    while kept() == 0 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(kept(), 1);
    let bake = ["bake", "--seed", "1", "--size", "16", "-q", "-o", "next.exr"];
    let mut next = dir.command(&bake);
    assert_eq!(crate::util::finish(next.env("TMPDIR", &temporary)).code, Some(0));
    assert_eq!(kept(), 0);
    // one that is alive keeps its own
    let mut alive = begin();
    while kept() == 0 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    // its lock comes a moment after its folder
    std::thread::sleep(std::time::Duration::from_millis(300));
    let mut next = dir.command(&[&bake[..], &["-f"]].concat());
    assert_eq!(crate::util::finish(next.env("TMPDIR", &temporary)).code, Some(0));
    assert_eq!(kept(), 1);
    // and removes it when it is asked to end
    assert!(std::process::Command::new("kill").arg(alive.id().to_string()).status().unwrap().success());
    alive.wait().unwrap();
    assert_eq!(kept(), 0);
}
