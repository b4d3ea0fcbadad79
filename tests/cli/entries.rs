//! One bad entry never ends the whole: links to nowhere and in circles, folders that cannot be read.

#![cfg(unix)]

use std::os::unix::fs::symlink;

use crate::util::{Dir, panorama};

fn library() -> Dir {
    let dir = Dir::new();
    std::fs::create_dir_all(dir.path("lib/a")).unwrap();
    std::fs::copy(panorama(), dir.path("lib/a/ref.exr")).unwrap();
    dir
}

/// One panorama is kept, and what is wrong with `entry` is said everywhere.
fn is_listed(dir: &Dir, entry: &str, reason: &str) {
    let run = dir.run(&["prepare", "lib", "-o", "out"]);
    assert_eq!(run.code, Some(1), "{}{}", run.out, run.err);
    assert!(run.out.contains("1 panoramas") && run.out.contains("1 refused"), "{}", run.out);
    assert!(run.err.contains(entry) && run.err.contains(reason), "{}", run.err);
    let read = |name: &str| std::fs::read_to_string(dir.path("out").join(name)).unwrap();
    let markdown = read("report.md");
    let refused = markdown.split("## Refused").nth(1).unwrap();
    assert!(refused.contains(entry) && refused.contains(reason), "{markdown}");
    let report: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    let files = report["files"].as_array().unwrap();
    let fate = files.iter().find(|file| file["source"].as_str().unwrap().contains(entry)).unwrap();
    assert_eq!(fate["fate"], "refused");
    std::fs::remove_dir_all(dir.path("out")).unwrap();
}

#[test]
fn a_link_to_nowhere_is_listed() {
    let dir = library();
    symlink("/nonexistent/x.exr", dir.path("lib/dangling.exr")).unwrap();
    // the locks of an editor are nobody's panoramas
    symlink("someone@nowhere", dir.path("lib/.#ref.exr")).unwrap();
    is_listed(&dir, "lib/dangling.exr", "not there");
}

#[test]
fn a_link_that_goes_round_is_listed() {
    let dir = library();
    symlink("..", dir.path("lib/a/loop")).unwrap();
    is_listed(&dir, "lib/a/loop", "which it is in");
    std::fs::remove_file(dir.path("lib/a/loop")).unwrap();
    symlink("self.exr", dir.path("lib/self.exr")).unwrap();
    is_listed(&dir, "lib/self.exr", "link");
}

#[test]
fn a_folder_that_cannot_be_read_is_listed() {
    use std::os::unix::fs::PermissionsExt;
    let dir = library();
    std::fs::create_dir(dir.path("lib/closed")).unwrap();
    std::fs::set_permissions(dir.path("lib/closed"), std::fs::Permissions::from_mode(0o0)).unwrap();
    // to the superuser nothing is closed
    if std::fs::read_dir(dir.path("lib/closed")).is_ok() {
        return;
    }
    is_listed(&dir, "lib/closed", "ermission");
    std::fs::set_permissions(dir.path("lib/closed"), std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[cfg(feature = "pretrained")]
#[test]
fn other_commands_go_on_with_the_rest() {
    let dir = library();
    symlink("/nonexistent/x.exr", dir.path("lib/dangling.exr")).unwrap();
    for args in [
        &["encode", "lib/dangling.exr", "lib/a/ref.exr", "--out-dir", "codes", "-q"][..],
        &[
            "fit",
            "lib/dangling.exr",
            "lib/a/ref.exr",
            "--out-dir",
            "fits",
            "--steps",
            "2",
            "--resolution",
            "16",
            "-q",
        ],
        &["bake", "lib/dangling.exr", "lib/a/ref.exr", "--out-dir", "skies", "--size", "16", "-q"],
        &["inspect", "lib/dangling.exr", "lib/a/ref.exr"],
    ] {
        let run = dir.run(args);
        assert!(run.code == Some(2) && run.out.contains("ref"), "{args:?}: {}{}", run.out, run.err);
        assert!(
            run.err.contains("lib/dangling.exr") && run.err.lines().count() == 1,
            "{args:?}: {}",
            run.err
        );
    }
}
