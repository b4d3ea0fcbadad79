//! Graphics devices: `bake --device`, `inspect --devices`, `bench`. They need one, a software one (Mesa's lavapipe) will
//! do; without any they fail, unless VENI_SKIP_GPU=1 is set.

use serde_json::Value;

use crate::readers::{Image, exr};
use crate::util::{Dir, finish, model};

/// Whether a test that needs an adapter is to be left out; says so.
pub(crate) fn skipped(test: &str) -> bool {
    let skip = std::env::var_os("VENI_SKIP_GPU").is_some_and(|v| v == "1");
    if skip {
        eprintln!("{test}: skipped, since VENI_SKIP_GPU=1 is set");
    }
    skip
}

/// What `inspect --devices` says of every adapter.
pub(crate) fn devices(dir: &Dir) -> Vec<Value> {
    let run = dir.run(&["inspect", "--devices", "--json", "--quiet"]);
    assert_eq!(
        run.code,
        Some(0),
        "no usable graphics device (VENI_SKIP_GPU=1 leaves these tests out): {run:?}"
    );
    assert_eq!(run.err, "");
    run.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The command on a machine without any Vulkan driver.
pub(crate) fn without_drivers(dir: &Dir, args: &[&str]) -> std::process::Command {
    let mut command = dir.command(args);
    for variable in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
        command.env(variable, dir.path("no such driver.json"));
    }
    command.env("WGPU_BACKEND", "vulkan");
    command
}

#[test]
fn both_devices_bake_the_same_picture() {
    if skipped("both_devices_bake_the_same_picture") {
        return;
    }
    let dir = Dir::new();
    let name = devices(&dir)[0]["device"].clone();
    let cube = ["--layout", "cubemap", "--size", "17"];
    for (case, layout) in [
        &["--size", "64x32"][..],
        &["--size", "64x32", "--turn", "33", "--exposure", "1.5"],
        &cube,
        &[&cube[..], &["--frame", "bevy", "--turn", "-70"]].concat(),
    ]
    .into_iter()
    .enumerate()
    {
        let bake = |device: &str, seed: &str| {
            let out = format!("{case}-{device}-{seed}.exr");
            let args =
                ["bake", "--model", model(), "--float", "--seed", seed, "--device", device, "-o", &out];
            let value = dir.json(&[&args[..], layout].concat()).remove(0);
            (value, exr(&dir.path(&out)))
        };
        let ((_, cpu), (value, gpu)) = (bake("cpu", "7"), bake("gpu", "7"));
        assert_eq!(value["device"], name);
        assert_eq!(value["precision"], "float");
        assert!(gpu.pixels.iter().flatten().all(|v| v.is_finite() && *v > 0.0), "{layout:?}");
        // the bound of 'inspect --devices'; a device's sine and exponential are good to some 1e-5 here
        assert!(gpu.difference(&cpu) < 1e-3, "{layout:?}: {}", gpu.difference(&cpu));
        // the digest is of the pixels, which differ in their last bits
        let others = |image: &Image| {
            let mut all = image.attributes.clone();
            assert!(all.remove("veni:pixels").is_some_and(|digest| digest.starts_with("xxh3:")));
            all
        };
        assert_eq!(others(&gpu), others(&cpu));
        let (_, other) = bake("cpu", "8");
        assert!(gpu.difference(&other) > 1e-2, "{layout:?}: the test can fail");
    }
}

#[test]
fn radiance_beyond_half_becomes_float_on_a_graphics_device_too() {
    if skipped("radiance_beyond_half_becomes_float_on_a_graphics_device_too") {
        return;
    }
    let dir = Dir::new();
    let args =
        ["bake", "--model", model(), "--seed", "5", "--exposure", "30", "--size", "32", "--device", "gpu"];
    let [value] = &dir.json(&[&args[..], &["-o", "bright.exr", "-o", "bright.png"]].concat())[..] else {
        panic!("one object")
    };
    assert_eq!(value["precision"], "float");
    assert!(exr(&dir.path("bright.exr")).pixels.iter().flatten().all(|v| v.is_finite() && *v > 65504.0));
    dir.refused(&[&args[..], &["-q", "-o", "half.exr", "--half"]].concat(), &["half.exr", "65504", "float"]);
}

#[test]
fn the_choice_of_a_device_is_said_and_software_is_never_taken_unasked() {
    if skipped("the_choice_of_a_device_is_said_and_software_is_never_taken_unasked") {
        return;
    }
    let dir = Dir::new();
    let all = devices(&dir);
    let is_software = |device: &Value| device["kind"] == "software";
    let card = all.iter().find(|d| !is_software(d)).map_or("CPU".into(), |d| d["device"].clone());
    let args = ["bake", "--model", model(), "--seed", "1", "--size", "32", "--force", "-o", "a.exr"];
    assert_eq!(dir.json(&args)[0]["device"], card);
    assert_eq!(dir.json(&[&args[..], &["--device", "auto"]].concat())[0]["device"], card);
    assert_eq!(dir.json(&[&args[..], &["--device", "cpu"]].concat())[0]["device"], "CPU");
    let run = dir.run(&[&args[..], &["--device", "gpu"]].concat());
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.out.contains(all[0]["device"].as_str().unwrap()), "{run:?}");
    assert_eq!(
        run.err.contains("is a software adapter; --device cpu is faster"),
        is_software(&all[0]),
        "{run:?}"
    );
    let sheet = ["sample", "--model", model(), "--count", "2", "--size", "32", "-o", "sheet.png"];
    assert_eq!(dir.json(&[&sheet[..], &["--device", "gpu"]].concat())[0]["device"], all[0]["device"]);
}

#[test]
fn devices_are_measured_and_checked() {
    if skipped("devices_are_measured_and_checked") {
        return;
    }
    let dir = Dir::new();
    for device in devices(&dir) {
        assert!(device["kind"].is_string() && device["backend"].is_string() && device["driver"].is_string());
        for (limit, least) in [
            // what WebGPU promises at least
            ("max_storage_buffer_binding_size", 128 << 20),
            ("max_compute_workgroup_storage_size", 16 << 10),
            ("max_compute_invocations_per_workgroup", 256),
            ("max_texture_dimension_2d", 8192),
        ] {
            assert!(device[limit].as_u64().unwrap() >= least, "{limit}: {device}");
        }
        assert!(device["features_used"].is_array(), "{device}");
        assert!(device["multiply_adds"]["gflops"].as_f64().unwrap() > 0.01, "{device}");
        assert_eq!(device["numbers"]["right"], true, "{device}");
        assert!(device["numbers"]["largest_error"].as_f64().unwrap() <= 1e-3, "{device}");
    }
    let text = dir.ok(&["inspect", "--devices"]);
    for word in ["backend", "max_texture_dimension_2d", "GFLOP/s", "right"] {
        assert!(text.contains(word), "{word} is missing in {text}");
    }
}

/// A Vulkan loader that finds no driver stands in for a machine that has none.
#[cfg(target_os = "linux")]
#[test]
fn without_a_graphics_device_the_remedy_is_named() {
    let dir = Dir::new();
    let args = ["bake", "--model", model(), "--seed", "1", "--size", "32", "-o", "a.exr"];
    let run = finish(&mut without_drivers(&dir, &[&args[..], &["--device", "gpu"]].concat()));
    assert_eq!((run.code, run.out.as_str()), (Some(2), ""), "{run:?}");
    assert_eq!(run.err.lines().count(), 1, "{run:?}");
    for word in ["no graphics device", "mesa-vulkan-drivers", "--device cpu"] {
        assert!(run.err.contains(word), "{word} is missing in {run:?}");
    }
    assert!(dir.files().is_empty(), "{:?}", dir.files());
    let run = finish(&mut without_drivers(&dir, &["inspect", "--devices", "--json"]));
    assert_eq!((run.code, run.out.as_str()), (Some(1), ""), "{run:?}");
    assert!(run.err.contains("mesa-vulkan-drivers"), "{run:?}");
    // nothing else needs one
    let run = finish(&mut without_drivers(&dir, &[&args[..], &["--json"]].concat()));
    assert_eq!((run.code, run.err.as_str()), (Some(0), ""), "{run:?}");
    assert_eq!(serde_json::from_str::<Value>(&run.out).unwrap()["device"], "CPU");
    let bench = ["bench", "--json", "--model", model(), "--sizes", "32x16", "--latent-vectors", "2"];
    let run = finish(&mut without_drivers(&dir, &bench));
    assert_eq!((run.code, run.out.lines().count()), (Some(0), 2), "{run:?}");
    assert!(run.err.contains("CPU only"), "{run:?}");
}

#[test]
fn every_device_is_timed() {
    if skipped("every_device_is_timed") {
        return;
    }
    let dir = Dir::new();
    let names: Vec<_> = devices(&dir).iter().map(|d| d["device"].as_str().unwrap().to_owned()).collect();
    let args = ["bench", "--model", model(), "--latent-vectors", "9", "--sizes", "32x16"];
    let rows = dir.json(&args);
    assert_eq!(rows.len(), 2 * (1 + names.len()), "{rows:?}");
    for (at, row) in rows.iter().enumerate() {
        let expected = if at < 2 { "CPU" } else { &names[at / 2 - 1] };
        assert_eq!(row["device"], expected);
        assert_eq!(row["latent_vectors"], if at % 2 == 0 { 4 } else { 9 });
        let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name} of {row}"));
        let rate = 512.0 / number("milliseconds") * 1e3;
        assert!((number("mdirections_per_second") * 1e6 / rate - 1.0).abs() < 1e-6, "{row}");
        assert!((number("percent") - 100.0 * number("gflops") / number("multiply_add_gflops")).abs() < 1e-6);
        assert!(number("percent") > 0.0, "{row}");
        if at % 2 == 1 {
            let operations = 2.0 * (5 * 11 * 128 + 12 * 128 * 128 + 3 * 128) as f64;
            assert!((number("gflops") * 1e9 / rate / operations - 1.0).abs() < 1e-6, "{row}");
        }
    }
}

#[test]
fn wrong_arguments_are_refused() {
    let dir = Dir::new();
    dir.refused(&["bench", "--sizes", "32x32"], &["32x32", "32x16"]);
    dir.refused(
        &["bench", "--model", model(), "--latent-vectors", "0"],
        &["--latent-vectors 0", "between 1"],
    );
    dir.refused(&["bench", "--model", "missing.safetensors"], &["missing.safetensors"]);
    let run = dir.run(&["inspect", "--devices", "file.exr"]);
    assert_eq!(run.code, Some(2));
    assert!(run.err.contains("cannot be used with"), "{run:?}");
    let run = dir.run(&["bake", "--seed", "1", "-o", "a.exr", "--device", "tpu"]);
    assert_eq!(run.code, Some(2));
    assert!(run.err.contains("auto, cpu, gpu"), "{run:?}");
}
