//! Nothing raw to the terminal: names and attributes may hold escape sequences, which are shown and not obeyed.

use std::os::unix::ffi::OsStrExt;

use crate::util::{Dir, Run};

/// What a hostile name does: colours, another title, the line overwritten, the text turned round.
const NAME: &str = "sky\u{1b}[31m\u{1b}]0;owned\u{7}\r\u{9b}2J\u{202e}\u{7f}\n.exr";

fn is_clean(run: &Run, args: &[&str]) {
    for (stream, text) in [("stdout", &run.out), ("stderr", &run.err)] {
        let raw = text.chars().find(|c| (c.is_control() && *c != '\n' && *c != '\t') || *c == '\u{202e}');
        assert_eq!(raw, None, "{args:?}, {stream}: {text:?}");
        assert!(
            !text.lines().any(|line| line.starts_with(".exr")),
            "{args:?}, {stream}: a name began a line"
        );
    }
}

#[test]
fn names_are_escaped_in_every_output() {
    let dir = Dir::new();
    dir.ok(&["bake", "--seed", "1", "--size", "32", "--device", "cpu", "-q", "-o", NAME]);
    let commands: &[&[&str]] = &[
        &["inspect", NAME],
        &["encode", NAME],
        &["encode", NAME, "-o", "a.json", "-f"],
        &["bake", NAME, "-o", NAME],
        &["bake", NAME, "-o", NAME, "-f", "--size", "32", "--device", "cpu"],
        &["fit", NAME, "--steps", "2", "--resolution", "16", "-o", "f.json", "-f"],
        &["render-probe", NAME, "-o", "p.exr", "--size", "16", "-f"],
        &["prepare", ".", "-o", "set", "--size", "16", "-f"],
        &["prepare", "\u{1b}missing", "-o", "set"],
        &["inspect", "missing\u{1b}[31m.exr"],
        &["bake", "--seed", "x\u{1b}[31m", "-o", "b.exr"],
        &["bake", "--see\u{1b}[31md", "-o", "b.exr"],
    ];
    for command in commands {
        for json in [&[][..], &["--json"]] {
            let args = [command, json].concat();
            let run = dir.run(&args);
            is_clean(&run, &args);
        }
    }
    let md = std::fs::read_to_string(dir.path("set/report.md")).unwrap();
    assert!(!md.contains('\u{1b}') && md.contains("\\u{1b}[31m") | !md.contains("sky"), "{md:?}");
    // in JSON the name is still the name
    let shown = dir.json(&["inspect", NAME]);
    assert_eq!(shown[0]["file"], NAME);
    let raw = std::ffi::OsStr::from_bytes(b"\xff\x1b[31m.exr");
    let run = crate::util::finish(dir.command(&["inspect"]).arg(raw));
    is_clean(&run, &["inspect", "no UTF-8"]);
}

#[test]
fn attributes_are_escaped() {
    let dir = Dir::new();
    let mut hdr = b"#?RADIANCE\nSOFTWARE=good\x1b[2Jbad\x07\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec();
    hdr.extend([128, 128, 128, 129].repeat(32));
    dir.write("a.hdr", hdr);
    for args in [&["inspect", "a.hdr"][..], &["inspect", "a.hdr", "--json"]] {
        let run = dir.run(args);
        assert_eq!(run.code, Some(0), "{}", run.err);
        is_clean(&run, args);
        assert!(run.out.contains("1b"), "it is shown: {}", run.out);
    }
    let json = dir.json(&["inspect", "a.hdr"]);
    assert_eq!(json[0]["attributes"]["SOFTWARE"], "good\u{1b}[2Jbad\u{7}");
}
