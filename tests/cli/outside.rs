//! Nothing outside its own folder: a folder may come from somebody else, and what is written in it is only believed as far
//! as it leads into it.

use std::path::Path;

use crate::util::{Dir, panoramas, text};

/// A panorama to prepare, and a file that is nobody's business.
fn start() -> Dir {
    let dir = Dir::new();
    std::fs::create_dir_all(dir.path("in")).unwrap();
    std::fs::copy(panoramas().join("val/mud_road_puresky.exr"), dir.path("in/a.exr"))
        .or_else(|_| std::fs::copy(crate::util::panorama(), dir.path("in/a.exr")))
        .unwrap();
    dir.write("victim.txt", "precious");
    dir.write("victim.exr", "precious");
    dir
}

/// Both survive, whatever `prepare` is asked to do with the set.
fn survives(dir: &Dir, word: &str) {
    for force in [&[][..], &["--force"]] {
        let before = dir.files();
        let run = dir.run(&[&["prepare", "in", "-o", "set", "-q"], force].concat());
        assert_eq!(run.code, Some(2), "{word}, {force:?}: {}{}", run.out, run.err);
        assert!(run.err.contains(word), "{word}, {force:?}: {}", run.err);
        for victim in ["victim.txt", "victim.exr"] {
            assert_eq!(std::fs::read_to_string(dir.path(victim)).unwrap(), "precious", "{word}, {force:?}");
        }
        let left: Vec<_> = before.difference(&dir.files()).cloned().collect();
        assert!(left.is_empty(), "{word}, {force:?}: {left:?} went");
    }
}

fn plan(dir: &Dir, plan: &str) {
    std::fs::create_dir_all(dir.path("set/.prepare")).unwrap();
    dir.write("set/.prepare/plan.json", plan);
}

/// The case file, and every other way out that a plan's text has.
#[test]
fn a_plan_that_names_other_files_is_refused_by_name() {
    let dir = start();
    plan(&dir, "{\"0000\":[\"../victim.txt\"]}\n");
    survives(&dir, "plan.json");
    let absolute = text(&dir.path("victim.txt"));
    for place in ["../victim.txt", "train/../../victim.exr", absolute.as_str(), "../victim.exr", "notes.exr"]
    {
        plan(&dir, &serde_json::json!({ "0123456789abcdef": [place] }).to_string());
        std::fs::write(dir.path("set/notes.exr"), "precious").unwrap();
        survives(&dir, place);
        assert_eq!(std::fs::read_to_string(dir.path("set/notes.exr")).unwrap(), "precious");
    }
    // names of files are made of ids, too
    for id in ["../../../victim", "/victim", ""] {
        plan(&dir, &serde_json::json!({ id: ["train/a.exr"] }).to_string());
        survives(&dir, "not a hash");
    }
}

/// Records name images by an id.
#[test]
fn a_record_that_names_other_files_is_refused_by_name() {
    let dir = start();
    dir.ok(&["prepare", "in", "-o", "set", "-q"]);
    let log = dir.path("set/.prepare/records.jsonl");
    let lines = std::fs::read_to_string(&log).unwrap();
    let record: serde_json::Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    let id = record.pointer("/fate/fit/id").unwrap().as_str().unwrap().to_owned();
    std::fs::write(&log, lines.replace(&id, "../../../victim")).unwrap();
    let run = dir.run(&["prepare", "in", "-o", "set", "-q"]);
    assert!(run.code == Some(2) && run.err.contains("../../../victim"), "{}", run.err);
    assert_eq!(std::fs::read_to_string(dir.path("victim.exr")).unwrap(), "precious");
    assert!(dir.path("set/train/a.exr").is_file() || dir.path("set/val/a.exr").is_file());
}

#[cfg(unix)]
#[test]
fn links_in_a_set_lead_nowhere() {
    use std::os::unix::fs::symlink;
    let link = |to: &Path, at: &Path| {
        std::fs::create_dir_all(at.parent().unwrap()).unwrap();
        symlink(to, at).unwrap();
    };
    let dir = start();
    // a folder of the set is somewhere else
    plan(&dir, "{\"0123456789abcdef\":[\"train/victim.exr\"]}");
    link(&dir.path(""), &dir.path("set/train"));
    survives(&dir, "symbolic link");
    // so is the folder of what waits, or all that is remembered
    let dir = start();
    link(&dir.path(""), &dir.path("set/.prepare/images"));
    survives(&dir, "symbolic link");
    let dir = start();
    std::fs::create_dir_all(dir.path("other/images")).unwrap();
    dir.write("other/settings.json", "precious");
    link(&dir.path("other"), &dir.path("set/.prepare"));
    survives(&dir, "symbolic link");
    assert_eq!(std::fs::read_to_string(dir.path("other/settings.json")).unwrap(), "precious");
    // a log to which lines are appended
    let dir = start();
    link(&dir.path("victim.txt"), &dir.path("set/.prepare/records.jsonl"));
    let run = dir.run(&["prepare", "in", "-o", "set", "-q"]);
    assert!(run.code == Some(2) && run.err.contains("symbolic link"), "{}", run.err);
    assert_eq!(std::fs::read_to_string(dir.path("victim.txt")).unwrap(), "precious");
    // with --force the link goes, not what it names
    dir.ok(&["prepare", "in", "-o", "set", "-q", "--force"]);
    assert_eq!(std::fs::read_to_string(dir.path("victim.txt")).unwrap(), "precious");
}

#[test]
fn what_no_earlier_run_wrote_stays() {
    let dir = start();
    for folder in ["set/train", "set/val"] {
        std::fs::create_dir_all(dir.path(folder)).unwrap();
        dir.write(&format!("{folder}/a.exr"), "precious");
    }
    dir.refused(&["prepare", "in", "-o", "set", "-q"], &["holds other things"]);
    let run = dir.run(&["prepare", "in", "-o", "set", "-q", "--force"]);
    assert!(run.code == Some(2) && run.err.contains("no earlier run wrote it"), "{}", run.err);
    for folder in ["set/train", "set/val"] {
        assert_eq!(std::fs::read_to_string(dir.path(folder).join("a.exr")).unwrap(), "precious");
    }
    // sources in the very folder that is to be filled
    std::fs::copy(dir.path("in/a.exr"), dir.path("set/train/b.exr")).unwrap();
    let sources = std::fs::read(dir.path("set/train/b.exr")).unwrap();
    let run = dir.run(&["prepare", "set/train", "-o", "set", "-q", "--force"]);
    assert!(run.code == Some(2) && run.err.contains("sources would be replaced"), "{}", run.err);
    assert_eq!(std::fs::read(dir.path("set/train/b.exr")).unwrap(), sources);
}

/// A mesh names a library of materials, which may be anywhere: it is not read, and nothing is written by its name.
#[cfg(feature = "pretrained")]
#[test]
fn a_mesh_leads_nowhere() {
    let dir = start();
    let victim = text(&dir.path("victim.txt"));
    for library in ["../victim.txt", victim.as_str(), "victim.txt", "/dev/zero"] {
        dir.write("m.obj", format!("mtllib {library}\nusemtl x\nv 0 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n"));
        dir.ok(&[
            "render-probe",
            "--seed",
            "1",
            "--mesh",
            "m.obj",
            "-o",
            "m.png",
            "--size",
            "16",
            "-q",
            "-f",
        ]);
        assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
    }
}

/// The files that records are read from do not become longer lists of files to write: a latent names its source, an image
/// its camera, and neither is a path to anything.
#[cfg(feature = "pretrained")]
#[test]
fn a_latents_source_is_a_word() {
    let dir = start();
    dir.ok(&["bake", "--seed", "1", "-o", "sky.exr", "--size", "32", "--json", "-q"]);
    let latent = dir.ok(&["encode", "sky.exr", "-q"]);
    let mut latent: serde_json::Value = serde_json::from_str(&latent).unwrap();
    latent["source"] = text(&dir.path("victim.exr")).into();
    std::fs::create_dir(dir.path("out")).unwrap();
    dir.write("in/code.json", latent.to_string());
    dir.ok(&["bake", "in/code.json", "--out-dir", "out", "--size", "32", "-q", "--force"]);
    assert_eq!(std::fs::read_to_string(dir.path("victim.exr")).unwrap(), "precious");
    let names: Vec<_> = std::fs::read_dir(dir.path("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["code.exr"]);
}
