//! `prepare`: a dirty folder of real panoramas becomes a training set, and nothing is lost on the way.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use image::{ImageFormat, Rgb, RgbImage};
use serde_json::Value;
use veni_image::tonemap::srgb;
use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};

use crate::util::{Dir, panoramas, text, train_args};

fn original(name: &str) -> PathBuf {
    let sides = ["train", "val"].map(|side| panoramas().join(side).join(format!("{name}.exr")));
    sides.into_iter().find(|p| p.is_file()).unwrap_or_else(|| panic!("no panorama {name}"))
}

fn exr(panorama: &Panorama, path: &Path) {
    panorama.write(path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
}

/// As a display would show it, with the brightest tenth clipped.
fn picture(name: &str) -> RgbImage {
    let panorama = Panorama::read(original(name)).unwrap();
    let white = veni_image::tonemap::quantile(panorama.pixels().as_flattened(), 0.9);
    let grid = panorama.grid();
    RgbImage::from_fn(grid.width as u32, grid.height as u32, |x, y| {
        let pixel = panorama.pixel(x as usize, y as usize);
        Rgb(pixel.map(|v| (srgb((v / white).min(1.0)) * 255.0).round() as u8))
    })
}

/// Every kind of file that a folder off the internet has.
fn dirty(dir: &Dir) {
    std::fs::create_dir_all(dir.path("in/deep/er")).unwrap();
    let copy = |name: &str, to: &str| std::fs::copy(original(name), dir.path(to)).map(drop).unwrap();
    copy("mud_road_puresky", "in/mud_road_puresky.exr");
    copy("canary_wharf", "in/deep/canary_wharf_1k.exr");
    copy("canary_wharf", "in/deep/er/same bytes.exr");
    copy("chinese_garden", "in/no_extension");
    copy("forest_slope", "in/stem.exr");
    copy("garden_nook", "in/deep/stem.exr");
    let rotated = Panorama::read(original("forest_slope")).unwrap().rotated(1.3);
    exr(&rotated, &dir.path("in/turned.exr"));
    let mut bright = Panorama::read(original("garden_nook")).unwrap().mirror();
    bright.scale(8.0);
    exr(&bright, &dir.path("in/bright_mirror.exr"));
    picture("snowy_field").save_with_format(dir.path("in/snow.png"), ImageFormat::Png).unwrap();
    picture("venice_sunset").save_with_format(dir.path("in/venice_ev-1.jpg"), ImageFormat::Jpeg).unwrap();
    picture("rainforest_trail").save_with_format(dir.path("in/forest_0.webp"), ImageFormat::WebP).unwrap();
    // what cannot be used
    let whole = std::fs::read(original("ninomaru_teien")).unwrap();
    dir.write("in/cut.exr", &whole[..whole.len() / 2]);
    dir.write("in/text.hdr", "this is not a Radiance file");
    dir.write("in/empty.exr", "");
    exr::prelude::write_rgb_file(dir.path("in/nan.exr"), 128, 64, |_, _| (f32::NAN, 1.0, 1.0)).unwrap();
    exr::prelude::write_rgb_file(dir.path("in/wide.exr"), 192, 64, |x, _| (x as f32, 1.0, 1.0)).unwrap();
    exr::prelude::write_rgb_file(dir.path("in/small.exr"), 64, 32, |x, _| (x as f32, 1.0, 1.0)).unwrap();
    dir.write("in/photo.avif", b"\0\0\0\x20ftypavif\0\0\0\0mif1");
    // what is not an image
    dir.write("in/notes.txt", "remember");
    dir.write("in/.hidden.exr", "");
}

const REFUSED: [(&str, &str); 7] = [
    ("in/cut.exr", "truncated"),
    ("in/empty.exr", "empty"),
    ("in/nan.exr", "not numbers"),
    ("in/photo.avif", "AVIF"),
    ("in/small.exr", "64 × 32"),
    ("in/text.hdr", "neither"),
    ("in/wide.exr", "192 × 64"),
];

fn report(dir: &Dir, out: &str) -> Value {
    serde_json::from_slice(&std::fs::read(dir.path(out).join("report.json")).unwrap()).unwrap()
}

/// What the report says of each source.
fn fates(report: &Value) -> BTreeMap<String, Value> {
    let files = report["files"].as_array().unwrap();
    files.iter().map(|f| (f["source"].as_str().unwrap().to_owned(), f.clone())).collect()
}

fn contents(dir: &Dir, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let below = dir.path(folder);
    let files = dir.files().into_iter().filter(|p| p.starts_with(&below) && p.is_file());
    files.map(|p| (p.clone(), std::fs::read(&p).unwrap())).collect()
}

#[test]
fn a_dirty_folder_becomes_a_training_set() {
    let dir = Dir::new();
    dirty(&dir);
    let before = contents(&dir, "in");
    let run = dir.run(&["prepare", "in", "-o", "data", "--val", "0.2", "--seed", "1"]);
    assert_eq!(run.code, Some(1), "files were refused: {}{}", run.out, run.err);
    assert!(run.out.contains("10 panoramas") && run.out.contains("7 refused"), "{}", run.out);
    assert_eq!(contents(&dir, "in"), before, "sources are left alone");

    let report_1 = report(&dir, "data");
    let fates_1 = fates(&report_1);
    let listed: Vec<_> = before.keys().map(|p| text(p.strip_prefix(dir.path("")).unwrap())).collect();
    assert_eq!(
        fates_1.keys().cloned().collect::<Vec<_>>(),
        listed,
        "every file is in the report, and no other"
    );
    for (source, reason) in REFUSED {
        let fate = &fates_1[source];
        assert!(fate["fate"] == "refused" && fate["reason"].as_str().unwrap().contains(reason), "{fate}");
        assert!(run.err.contains(source), "{source} is not named on stderr: {}", run.err);
    }
    assert_eq!(fates_1["in/notes.txt"]["fate"], "ignored");
    assert_eq!(fates_1["in/deep/er/same bytes.exr"]["of"], "in/deep/canary_wharf_1k.exr");

    // near-duplicates share a side and are named as such
    let split = |source: &str| fates_1[source]["split"].as_str().unwrap().to_owned();
    assert_eq!(split("in/turned.exr"), split("in/stem.exr"));
    assert_eq!(split("in/bright_mirror.exr"), split("in/deep/stem.exr"));
    let alike = report_1["near_duplicates"].as_array().unwrap();
    let rotated = alike.iter().find(|a| a["second"] == "in/turned.exr").unwrap();
    let degrees = rotated["rotation_degrees"].as_f64().unwrap();
    assert!(rotated["first"] == "in/stem.exr" && (degrees - 1.3f64.to_degrees()).abs() < 3.0, "{rotated}");
    assert!(alike.iter().any(|a| a["first"] == "in/bright_mirror.exr" && a["mirrored"] == true));
    assert_eq!(alike.len(), 2, "{alike:?}");

    // names that clash are told apart; files are where the report says, at the size asked for
    assert_ne!(fates_1["in/stem.exr"]["file"], fates_1["in/deep/stem.exr"]["file"]);
    let counts = &report_1["counts"];
    assert!(counts["val"].as_u64().unwrap() >= 1 && counts["expanded"] == 3, "{counts}");
    for fate in fates_1.values().filter(|f| f["fate"] == "kept") {
        let image = Panorama::read(dir.path("data").join(fate["file"].as_str().unwrap())).unwrap();
        assert_eq!((image.grid().width, image.grid().height), (128, 64));
    }
    // what was clipped is brighter than white again, and the rest as it was
    let venice =
        Panorama::read(dir.path("data").join(fates_1["in/venice_ev-1.jpg"]["file"].as_str().unwrap()))
            .unwrap();
    assert!(venice.pixels().iter().flatten().any(|v| *v > 4.0));
    let markdown = std::fs::read_to_string(dir.path("data/report.md")).unwrap();
    for word in ["## Refused", "in/cut.exr: ", "## Near-duplicates", "## Expanded", "in/notes.txt"] {
        assert!(markdown.contains(word), "{word} is missing in {markdown}");
    }
    assert!(image::open(dir.path("data/contact.png")).unwrap().width() > 256);

    // again: nothing is examined, nothing changes, the refused ones are still reported
    let after = contents(&dir, "data");
    let again = dir.run(&["prepare", "in", "-o", "data", "--val", "0.2", "--seed", "1"]);
    assert!(
        again.code == Some(1) && again.err.contains("18 of 18 files were examined before"),
        "{}",
        again.err
    );
    let strip = |mut all: BTreeMap<PathBuf, Vec<u8>>| {
        all.retain(|p, _| !p.ends_with("records.jsonl"));
        all
    };
    assert_eq!(strip(contents(&dir, "data")), strip(after));

    // and it can be trained on at once
    let data = text(&dir.path("data"));
    let [value] = &dir.json(&train_args(&data, "run", "2")[..13])[..] else { panic!("one object") };
    assert_eq!(value["finished"], true);
}

#[test]
fn runs_go_on_where_they_stopped_and_take_in_what_is_new() {
    let dir = Dir::new();
    dirty(&dir);
    for (broken, _) in REFUSED {
        std::fs::remove_file(dir.path(broken)).unwrap();
    }
    dir.ok(&["prepare", "in", "-o", "whole", "-q"]);
    // a stopped run: the last record is torn, nothing was placed
    dir.ok(&["prepare", "in/deep", "-o", "parts", "-q"]);
    let log = dir.path("parts/.prepare/records.jsonl");
    let lines = std::fs::read_to_string(&log).unwrap();
    std::fs::write(&log, &lines[..lines.len() - 40]).unwrap();
    let run = dir.run(&["prepare", "in", "-o", "parts"]);
    assert!(run.code == Some(0) && run.err.contains("2 of 11 files"), "{}", run.err);
    let sides = |out: &str| {
        let list = |side: &str| {
            let Ok(entries) = std::fs::read_dir(dir.path(out).join(side)) else { return vec![] };
            let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
            names.sort();
            names
        };
        ["train", "val", "test"].map(list)
    };
    assert_eq!(sides("parts"), sides("whole"));
    let images = |out: &str| {
        let all = contents(&dir, out).into_iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "exr"));
        all.map(|(p, bytes)| (p.strip_prefix(dir.path(out)).unwrap().to_owned(), bytes))
            .collect::<BTreeMap<_, _>>()
    };
    assert_eq!(images("parts"), images("whole"), "to the byte");

    // a source that changes is examined again, an image that was lost is made again
    let lost = dir.path("whole").join(images("whole").keys().next().unwrap());
    std::fs::remove_file(&lost).unwrap();
    std::fs::copy(original("kloppenheim_05"), dir.path("in/snow.png")).unwrap();
    let run = dir.run(&["prepare", "in", "-o", "whole"]);
    assert!(run.code == Some(0) && run.err.contains("9 of 11 files"), "{}", run.err);
    assert!(lost.is_file() && fates(&report(&dir, "whole"))["in/snow.png"]["expanded"].is_null());

    // another seed moves files, and none is lost or left behind
    let count = |out: &str| sides(out).iter().map(Vec::len).sum::<usize>();
    let other = (1..9).find(|seed| {
        dir.ok(&[
            "prepare",
            "in",
            "-o",
            "whole",
            "-q",
            "--val",
            "0.4",
            "--test",
            "0.2",
            "--seed",
            &seed.to_string(),
        ]);
        assert_eq!(count("whole"), 10);
        sides("whole")[1] != sides("parts")[1]
    });
    assert!(other.is_some());

    // other settings and foreign folders are refused; --force starts over and spares what is not its own
    let refused =
        |args: &[&str], words: &[&str]| dir.refused(&[&["prepare", "in", "-q"], args].concat(), words);
    refused(&["-o", "whole", "--size", "64"], &["whole", "128x64", "--force"]);
    std::fs::create_dir(dir.path("mine")).unwrap();
    dir.write("mine/precious.txt", "mine");
    refused(&["-o", "mine"], &["mine", "precious.txt", "--force"]);
    refused(&["-o", "in/snow.png"], &["snow.png", "folder"]);
    refused(&["-o", "new", "--val", "0.7", "--test", "0.5"], &["leave nothing"]);
    refused(&["-o", "new", "--size", "100x60"], &["100x50"]);
    dir.refused(&["prepare", "nowhere", "-o", "new"], &["nowhere"]);
    dir.refused(&["prepare", "mine", "-o", "new"], &["mine", "no image"]);
    dir.write("whole/train/mine.txt", "mine");
    dir.ok(&["prepare", "in", "-o", "whole", "-q", "--size", "64", "--force"]);
    assert_eq!(count("whole"), 11, "ten panoramas and what is not ours");
    let first = images("whole").keys().next().unwrap().clone();
    assert_eq!(Panorama::read(dir.path("whole").join(first)).unwrap().grid().width, 64);
}

#[test]
fn given_splits_are_kept_and_held_out_copies_leave_training() {
    let dir = Dir::new();
    for (side, names) in
        [("train", ["snowy_field", "venice_sunset"]), ("val", ["canary_wharf", "mud_road_puresky"])]
    {
        std::fs::create_dir_all(dir.path("in").join(side)).unwrap();
        for name in names {
            std::fs::copy(original(name), dir.path("in").join(side).join(format!("{name}.exr"))).unwrap();
        }
    }
    let leak = Panorama::read(original("canary_wharf")).unwrap().rotated(-2.0);
    exr(&leak, &dir.path("in/train/leak.exr"));
    picture("qwantani_night").save_with_format(dir.path("in/night.png"), ImageFormat::Png).unwrap();
    dir.ok(&["prepare", "in", "-o", "data", "-q", "--val", "0"]);
    let fates = fates(&report(&dir, "data"));
    for (source, split) in [
        ("in/train/snowy_field.exr", "train"),
        ("in/val/canary_wharf.exr", "val"),
        ("in/val/mud_road_puresky.exr", "val"),
        ("in/train/leak.exr", "val"),
        ("in/night.png", "train"),
    ] {
        assert_eq!(fates[source]["split"], split, "{source}");
    }
    let markdown = std::fs::read_to_string(dir.path("data/report.md")).unwrap();
    assert!(markdown.contains("in/train/leak.exr → val/leak.exr"), "{markdown}");
    // without expansion the picture is refused, and with --resplit folders say nothing
    let run = dir.run(&[
        "prepare",
        "in",
        "-o",
        "off",
        "-q",
        "--expand",
        "off",
        "--resplit",
        "--val",
        "0",
        "--json",
    ]);
    let value: Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((run.code, &value["refused"], &value["train"]), (Some(1), &1.into(), &5.into()), "{value}");
    assert_eq!(value["refusals"][0]["source"], "in/night.png");
}
