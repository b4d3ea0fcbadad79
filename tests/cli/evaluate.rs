//! `evaluate`: every protocol on a tiny model, stopped and resumed, refused where the input is bad.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;

use crate::util::{Dir, model, panorama, panoramas, text};

/// Arguments that are quick on two panoramas of 64 × 32 pixels.
fn args<'a>(protocol: &'a str, data: &'a str, rest: &[&'a str]) -> Vec<&'a str> {
    args_on("2", protocol, data, rest)
}

fn args_on<'a>(images: &'a str, protocol: &'a str, data: &'a str, rest: &[&'a str]) -> Vec<&'a str> {
    let mut args = vec!["evaluate", protocol, "--model", model(), "--data", data, "--out", "eval", "--quick"];
    args.extend(["--images", images, "--size", "64", "--pairs", "20", "--frames", "3"]);
    args.extend(rest);
    args
}

/// Kept results, with the time of each file.
fn kept(dir: &Dir) -> BTreeMap<PathBuf, SystemTime> {
    let files = dir.files().into_iter().filter(|f| f.is_file());
    let files = files.filter(|f| f.strip_prefix(dir.path("eval/results")).is_ok());
    files.map(|f| (f.clone(), f.metadata().unwrap().modified().unwrap())).collect()
}

fn row<'a>(table: &'a Value, pass: &str) -> &'a Value {
    let rows = table["rows"].as_array().unwrap();
    rows.iter().find(|r| r["Pass"] == pass).unwrap_or_else(|| panic!("no {pass} in {table}"))
}

#[test]
fn reconstruction_prints_a_table_and_keeps_its_results() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let out = dir.ok(&args("reconstruction", &data, &[]));
    assert!(out.contains("| System | Pass | D |") && out.contains("no weights"), "{out}");
    assert_eq!(std::fs::read_to_string(dir.path("eval/reconstruction.md")).unwrap(), out);
    let results = kept(&dir);
    assert_eq!(results.len(), 8, "two panoramas, two passes and two bases");
    let figures: Vec<_> =
        std::fs::read_dir(dir.path("eval/figures")).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(figures.len() == 4 && figures.iter().all(|f| image::open(f).is_ok()), "{figures:?}");
    // panorama, model and two bases, of 64 pixels each
    let beside = image::open(dir.path("eval/figures/reconstruction.png")).unwrap().to_rgb8();
    let cell = |column: u32| {
        let left = beside.width() - (4 - column) * 68;
        (0..32 * 64).map(|k| beside.get_pixel(left + k % 64, 20 + k / 64).0).collect::<Vec<_>>()
    };
    assert!((1..4).all(|column| cell(column) != cell(column - 1) && cell(column) != [[255; 3]; 2048]));

    let [table] = &dir.json(&args("reconstruction", &data, &[]))[..] else { panic!("one table") };
    assert_eq!(kept(&dir), results, "nothing was computed again");
    let psnr = |pass| row(table, pass)["LDR PSNR (exp.)"].as_f64().unwrap();
    assert!(psnr("autoencoder").is_finite() && psnr("optimised").is_finite(), "{table}");
    assert_ne!(psnr("optimised"), psnr("autoencoder"), "{table}");
    assert_eq!(row(table, "optimised")["D"], 12.0);
    // every file and every number of a rerun elsewhere is the same
    let other = Dir::new();
    assert_eq!(other.json(&args("reconstruction", &data, &[]))[0], *table);
    let csv = other.ok(&args("reconstruction", &data, &["--table", "csv", "-q"]));
    assert!(csv.starts_with("System,Pass,D,") && csv.lines().count() == 5, "{csv}");
    let details = std::fs::read_to_string(other.path("eval/reconstruction-images.csv")).unwrap();
    assert_eq!(details.lines().count(), 9);
    // without baselines two rows are left
    let [bare] = &dir.json(&args("reconstruction", &data, &["--baselines", "none"]))[..] else {
        panic!("one table")
    };
    assert_eq!(bare["rows"].as_array().unwrap()[..], table["rows"].as_array().unwrap()[..2]);
}

/// Killed half-way, then run again: what was finished is not touched, and the table is that of a run left alone.
#[test]
fn a_killed_evaluation_goes_on() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let args = args_on("8", "uniqueness", &data, &[]);
    let whole = Dir::new();
    let expected = whole.json(&args);
    assert_eq!(kept_count(&whole), 8);

    let mut child = dir.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    while kept_count(&dir) < 2 {
        assert!(started.elapsed() < Duration::from_secs(60), "no result in a minute");
        assert!(child.try_wait().unwrap().is_none() || kept_count(&dir) >= 2, "it ended by itself");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = kept(&dir);
    let resumed = dir.json(&args);
    let after = kept(&dir);
    assert!(
        before.iter().filter(|(file, _)| !is_part(file)).all(|(file, time)| after.get(file) == Some(time))
    );
    assert_eq!(after.keys().filter(|f| !is_part(f)).count(), 8);
    assert_eq!(resumed, expected);
}

fn is_part(file: &std::path::Path) -> bool {
    file.extension().is_some_and(|e| e == "part")
}

fn kept_count(dir: &Dir) -> usize {
    let folder = std::fs::read_dir(dir.path("eval/results/uniqueness"));
    folder.map_or(0, |entries| entries.filter(|e| !is_part(&e.as_ref().unwrap().path())).count())
}

#[test]
fn every_protocol_runs_and_paper_runs_them_all() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let tables = dir.json(&args("paper", &data, &[]));
    let names: Vec<_> = tables.iter().map(|t| t["name"].as_str().unwrap().to_owned()).collect();
    let expected = [
        "reconstruction",
        "uniqueness",
        "consistency",
        "interpolation",
        "equivariance",
        "ablations",
        "inverse-rendering",
    ];
    assert_eq!(names, expected);
    assert_eq!(tables[0]["rows"][0]["LDR PSNR (ref.), published"], "not available");
    let results = kept(&dir);
    for (name, table) in expected.iter().zip(&tables) {
        let [alone] = &dir.json(&args(name, &data, &[]))[..] else { panic!("one table") };
        assert_eq!(alone["rows"].as_array().unwrap().len(), table["rows"].as_array().unwrap().len());
        assert!(dir.path(format!("eval/{name}.json")).is_file());
    }
    assert_eq!(kept(&dir), results, "a protocol alone finds what paper kept");
    // two models that differ in nothing but the panoramas they were trained on are made by train; one is enough here
    let [sizes] = &dir.json(&args("dataset-size", &data, &[]))[..] else { panic!("one table") };
    assert_eq!(sizes["rows"][0]["Training panoramas"], 8.0);
    assert_eq!(kept(&dir), results);
    // what the paper does not measure
    let [light] = &dir.json(&args("light", &data, &[]))[..] else { panic!("one table") };
    let error = light["rows"][0]["E error"].as_f64().unwrap();
    assert!(error > 0.1 && error < 5.0, "{light}");
    assert_eq!(kept(&dir), results);
    for figure in ["dataset-size.png", "equivariance.png"] {
        assert!(image::open(dir.path("eval/figures").join(figure)).is_ok(), "{figure}");
    }

    let name = tables[0]["rows"][0]["System"].as_str().unwrap().to_owned();
    let published = format!(r#"{{"reconstruction": {{"{name}, optimised": {{"LDR PSNR (ref.)": 20.5}}}}}}"#);
    dir.write("published.json", &published);
    let tables = dir.json(&args("paper", &data, &["--published", "published.json"]));
    assert_eq!(tables[0]["rows"][1]["LDR PSNR (ref.), published"], 20.5);
    dir.write("published.json", published.replace("optimised", "imagined"));
    let run = dir.run(&args("paper", &data, &["--published", "published.json"]));
    assert!(run.code == Some(2) && run.err.contains("imagined"), "{}", run.err);
}

#[test]
fn parts_of_the_scene_are_compared_with_training_panoramas() {
    let (dir, data, val) = (Dir::new(), text(panoramas()), text(&panoramas().join("val")));
    dir.refused(&args("photo", &panorama(), &[]), &["no train/", "--train"]);
    dir.refused(&args("light", &data, &["--train", &data]), &["--train", "evaluate photo"]);
    let run = Dir::new().run(&args("completion", &val, &["--train", &val]));
    assert!(run.code == Some(2) && run.err.contains("training panoramas"), "{}", run.err);
    // of the folder with both, and of val/ alone
    let [photo] = &dir.json(&args_on("1", "photo", &data, &[]))[..] else { panic!("one table") };
    let rows = photo["rows"].as_array().unwrap();
    assert!(
        rows.len() == 3 && rows.iter().all(|r| r["E error"].as_f64().is_some_and(|e| e < 5.0)),
        "{photo}"
    );
    let results = kept(&dir);
    assert_eq!(results.len(), 4, "a panorama, four photographs");
    let [again] = &dir.json(&args_on("1", "photo", &val, &[]))[..] else { panic!("one table") };
    assert_eq!((again, kept(&dir)), (photo, results));
    let [halves] = &dir.json(&args_on("1", "completion", &data, &[]))[..] else { panic!("one table") };
    assert_eq!(halves["rows"].as_array().unwrap().len(), 4, "{halves}");
    assert!(dir.path("eval/completion-images.json").is_file());
}

#[test]
fn models_are_compared_under_their_names() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let full = veni_light::model::Model::load(model()).unwrap();
    full.without_encoder()
        .save(dir.path("bare.safetensors"), veni_light::model::StoredType::F32, Default::default())
        .unwrap();
    let whole = format!("whole={}", model());
    let mut args = args("reconstruction", &data, &[]);
    args.splice(2..4, ["--model", &whole, "bare.safetensors"]);
    let [table] = &dir.json(&args)[..] else { panic!("one table") };
    let rows: Vec<_> = table["rows"].as_array().unwrap().iter().map(|r| (&r["System"], &r["Pass"])).collect();
    let rows: Vec<_> =
        rows.iter().map(|(s, p)| format!("{} {}", s.as_str().unwrap(), p.as_str().unwrap())).collect();
    let bases = ["SH 12 least squares", "SG 9 optimised"];
    assert_eq!(rows, [&["whole autoencoder", "whole optimised", "bare optimised"][..], &bases].concat());
    args[3] = "bare.safetensors";
    dir.refused(&args, &["bare", "NAME=FILE"]);
}

/// A safetensors file, written by hand: AlexNet's features and the heads, all weights of one value each.
fn lpips_weights(dir: &Dir, name: &str, head: Option<f32>) {
    let layers: [(usize, [usize; 4]); 5] = [
        (0, [64, 3, 11, 11]),
        (3, [192, 64, 5, 5]),
        (6, [384, 192, 3, 3]),
        (8, [256, 384, 3, 3]),
        (10, [256, 256, 3, 3]),
    ];
    let (mut header, mut data) = (serde_json::Map::new(), Vec::new());
    let mut add = |name: String, shape: &[usize], value: &dyn Fn(usize) -> f32| {
        let start = data.len();
        let count = shape.iter().product::<usize>();
        data.extend((0..count).flat_map(|k| value(k).to_le_bytes()));
        let entry =
            serde_json::json!({ "dtype": "F32", "shape": shape, "data_offsets": [start, data.len()] });
        header.insert(name, entry);
    };
    for (at, (index, shape)) in layers.iter().enumerate() {
        let scale = 1.0 / (shape[1] * shape[2] * shape[3]) as f32;
        add(format!("features.{index}.weight"), shape, &|k| scale * ((k * 37 % 101) as f32 / 25.0 - 1.0));
        add(format!("features.{index}.bias"), &shape[..1], &|_| 0.1);
        if let Some(head) = head {
            add(format!("lin{at}.model.1.weight"), &[1, shape[0], 1, 1], &|_| head);
        }
    }
    let header = serde_json::to_vec(&header).unwrap();
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header);
    file.extend(data);
    dir.write(name, file);
}

#[test]
fn lpips_comes_with_its_weights() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    lpips_weights(&dir, "weights.safetensors", Some(0.5));
    lpips_weights(&dir, "double.safetensors", Some(1.0));
    let lpips = |file: &str| {
        let [table] = &dir.json(&args("reconstruction", &data, &["--lpips", file]))[..] else {
            panic!("one table")
        };
        row(table, "autoencoder")["LPIPS (exp.)"].as_f64().unwrap()
    };
    let (single, double) = (lpips("weights.safetensors"), lpips("double.safetensors"));
    assert!(single > 0.0 && (double / single - 2.0).abs() < 1e-4, "{single} and {double}");
    lpips_weights(&dir, "features.safetensors", None);
    let refused = |file: &str, words: &[&str]| {
        dir.refused(&args("reconstruction", &data, &["--lpips", file, "-q"]), &[&[file], words].concat());
    };
    refused("features.safetensors", &["lin0.model.1.weight"]);
    dir.write("noise.pth", "PK\x03\x04 not a file of PyTorch's");
    refused("noise.pth", &["zip"]);
    dir.write("empty.pth", "");
    refused("empty.pth", &["torch.save"]);
    refused("nowhere.pth", &["open"]);
    let small = args("reconstruction", &data, &["--lpips", "weights.safetensors"]);
    let small: Vec<_> = small.iter().map(|a| if *a == "64" { "32" } else { *a }).collect();
    dir.refused(&small, &["--size 32", "62x31"]);
}

#[test]
fn bad_input_is_refused_before_anything_is_made() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    std::fs::create_dir(dir.path("empty")).unwrap();
    dir.refused(&args("reconstruction", "empty", &[]), &["empty", "no .exr or .hdr"]);
    dir.refused(&args("reconstruction", "nowhere", &[]), &["nowhere"]);
    dir.write("broken.exr", "no panorama");
    dir.refused(&args("reconstruction", "broken.exr", &[]), &["broken.exr"]);
    dir.refused(&args("reconstruction", &data, &["--published", "x.json"]), &["--published", "paper"]);
    let size = |size| {
        let args = args("reconstruction", &data, &[]);
        args.into_iter().map(|a| if a == "64" { size } else { a }).collect::<Vec<_>>()
    };
    dir.refused(&size("8"), &["--size 8", "16x8"]);
    dir.refused(&size("64x64"), &["twice as wide"]);
    dir.write("eval", "a file");
    dir.refused(&args("reconstruction", &data, &[]), &["eval", "is a file"]);
    std::fs::remove_file(dir.path("eval")).unwrap();
    std::fs::create_dir(dir.path("eval")).unwrap();
    dir.write("eval/thesis.tex", "precious");
    dir.refused(&args("reconstruction", &data, &[]), &["eval", "not empty"]);
    std::fs::remove_file(dir.path("eval/thesis.tex")).unwrap();

    // what only one protocol minds comes after the folder was made
    let few = |protocol, count: &str, word: &str| {
        let (dir, one) = (Dir::new(), panorama());
        let mut args = args(protocol, &one, &[]);
        for name in ["--pairs", "--frames"] {
            let at = args.iter().position(|a| *a == name).unwrap();
            args[at + 1] = count;
        }
        let run = dir.run(&args);
        assert!(run.code == Some(2) && run.out.is_empty() && run.err.contains(word), "{}", run.err);
        assert_eq!(run.err.lines().count(), 1, "{}", run.err);
    };
    few("consistency", "2", "2 pairs");
    few("interpolation", "2", "too few");
}

#[test]
fn damaged_results_are_named() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    dir.ok(&args("reconstruction", &data, &["-q"]));
    let file = kept(&dir).into_keys().next().unwrap();
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    let name = file.file_name().unwrap().to_str().unwrap().to_owned();
    dir.refused(&args("reconstruction", &data, &["-q"]), &[&name, "remove the file"]);
    std::fs::remove_file(&file).unwrap();
    dir.ok(&args("reconstruction", &data, &["-q"]));
    assert_eq!(std::fs::read(&file).unwrap(), whole, "computed again to the bit");
}

#[cfg(feature = "pretrained")]
#[test]
fn sizes_of_codes_are_compared_by_name() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let args = |protocol, rest: &[&'static str]| {
        let mut all = vec!["evaluate", protocol, "--quick", "--images", "1", "--size", "64"];
        all.extend(["--baselines", "sg", "--model", "27"].iter().chain(rest));
        all
    };
    let with = |mut all: Vec<&'static str>| -> Vec<String> {
        all.extend(["--out", "eval"]);
        all.iter().map(|s| (*s).to_owned()).chain(["--data".to_owned(), data.clone()]).collect()
    };
    let run = |all: Vec<String>| dir.json(&all.iter().map(String::as_str).collect::<Vec<_>>());
    let [one] = &run(with(args("reconstruction", &["147", "--compact-lights", "1"])))[..] else {
        panic!("one table")
    };
    let rows = one["rows"].as_array().unwrap();
    let of = |system: &str, pass: &str| {
        let row = rows.iter().find(|row| row["System"] == system && row["Pass"] == pass);
        let row = row.unwrap_or_else(|| panic!("no {system}, {pass} in {one}"));
        (row["D"].as_f64().unwrap(), row["LDR PSNR (exp.)"].as_f64().unwrap())
    };
    for pass in ["autoencoder", "optimised"] {
        let (small, large) = (of("27", pass), of("147", pass));
        assert_eq!((small.0, large.0), (34.0, 146.0));
        assert!(large.1 > small.1 + 1.0, "{pass}: {small:?} and {large:?}");
    }
    // bases of the sizes that the models have
    assert!(of("SG 27", "optimised").1 < of("SG 141", "optimised").1);
    let [usual] = &run(with(args("reconstruction", &[])))[..] else { panic!("one table") };
    assert_eq!(usual["rows"][0]["D"], 27.0 + 4.0 * 7.0);
    let all = with(args("uniqueness", &["147"]));
    let all: Vec<_> = all.iter().map(String::as_str).collect();
    dir.refused(&all, &["--model 147", "vectors-147"]);
}

#[test]
fn lights_of_models_that_draw_them_are_refused() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    dir.refused(&args("light", &data, &["--compact-lights", "2"]), &["--compact-lights", "leave it out"]);
}
