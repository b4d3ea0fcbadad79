//! ONNX files: what is run, and what is refused.

use std::path::PathBuf;

use rayon::prelude::*;

use super::onnx_file::{FLOAT, INT32, OnnxFile};
use super::*;
use crate::expand::{CLIPPED, Expand};

const GRID: Equirect = Equirect { width: 32, height: 16 };

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn load(&self, file: OnnxFile) -> OnnxNetwork {
        OnnxNetwork::load(self.write("net.onnx", &file.bytes())).unwrap()
    }

    fn refused(&self, name: &str, bytes: &[u8], words: &[&str]) {
        let error = OnnxNetwork::load(self.write(name, bytes)).unwrap_err().to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        for word in words.iter().chain(&[name]) {
            assert!(error.contains(word), "{name}: '{word}' is missing in: {error}");
        }
    }
}

fn sky() -> LdrPanorama {
    let values =
        GRID.directions().into_iter().map(|[x, y, z]| [0.9 + 0.35 * x, 0.9 + 0.3 * y, 0.9 + 0.3 * z]);
    LdrPanorama::new(GRID, values.collect())
}

/// The largest |ln| between what came out and `expected(linear values, pixel, channel)` where the image is clipped.
fn off(done: &NetworkExpanded, expected: impl Fn(&Panorama, usize, usize) -> f32) -> f32 {
    let (ldr, mut off, mut count) = (sky(), 0f32, 0);
    let linear = ldr.linear(TransferFunction::Srgb);
    for (k, values) in ldr.values().iter().enumerate() {
        for (c, v) in values.iter().enumerate() {
            if *v >= CLIPPED {
                off = off.max((done.panorama.pixels()[k][c] / expected(&linear, k, c)).ln().abs());
                count += 1;
            }
            assert!(*v > KEPT || done.panorama.pixels()[k][c] == linear.pixels()[k][c]);
        }
    }
    assert!(count > 300);
    off
}

#[test]
fn networks_in_onnx_files_are_run() {
    let folder = Folder::new();
    let options = NetworkOptions { input: NetworkInput::Linear, ..Default::default() };
    let four = |linear: &Panorama, k: usize, c: usize| 4.0 * linear.pixels()[k][c];
    for size in [[0, 0], [16, 32], [16, 0]] {
        let network = folder.load(OnnxFile::times(4.0, size));
        assert_eq!(network.size(), size.map(|n| Some(n as usize).filter(|n| *n > 0)));
        assert_eq!((network.name(), network.digest().to_string().len()), ("net.onnx", 16));
        assert!(off(&sky().expand_by(&network, &options).unwrap(), four) < 1e-6);
    }
    // without declared shapes
    let bare = OnnxFile::default().value(11, "x", FLOAT, &[]).value(12, "y", FLOAT, &[]);
    let bare = bare.constant("four", &[], &[4.0]).node("Mul", &["x", "four"], "y", &[]);
    assert!(off(&sky().expand_by(&folder.load(bare), &options).unwrap(), four) < 1e-6);
    // ln(4 x)
    let log = OnnxFile::image([0, 0]).constant("four", &[], &[4.0]).node("Mul", &["x", "four"], "z", &[]);
    let log = folder.load(log.node("Log", &["z"], "y", &[]));
    let logs = NetworkOptions { output: NetworkOutput::Log, ..options.clone() };
    assert!(off(&sky().expand_by(&log, &logs).unwrap(), four) < 1e-5);
    // 1 x 3 kernel, twice the sum of the neighbours in a row: the sphere has no first column
    let mut kernel = vec![0.0; 27];
    (0..3).for_each(|c| kernel[c * 9 + c * 3..][..3].copy_from_slice(&[2.0, 0.0, 2.0]));
    let conv = OnnxFile::image([0, 0]).constant("kernel", &[3, 3, 1, 3], &kernel);
    let conv = folder.load(conv.node(
        "Conv",
        &["x", "kernel"],
        "y",
        &[("kernel_shape", &[1, 3]), ("strides", &[1, 1]), ("pads", &[0, 1, 0, 1])],
    ));
    let neighbours = |linear: &Panorama, k: usize, c: usize| {
        let (row, column) = (k / GRID.width, k % GRID.width);
        let at = |column: usize| linear.pixel(column % GRID.width, row)[c];
        2.0 * (at(column + 1) + at(column + GRID.width - 1))
    };
    let done = sky().expand_by(&conv, &options).unwrap();
    assert!(off(&done, neighbours) < 1e-5);
    let broken = |linear: &Panorama, k: usize, c: usize| match k % GRID.width {
        0 => 2.0 * linear.pixels()[k + 1][c],
        column if column + 1 == GRID.width => 2.0 * linear.pixels()[k - 1][c],
        _ => neighbours(linear, k, c),
    };
    assert!(off(&done, broken) > 0.5, "a seam would be noticed");
    // from the workers of a pool, all at once
    let all: Vec<_> = (0..32).into_par_iter().map(|_| sky().expand_by(&conv, &options).unwrap()).collect();
    assert!(all.iter().all(|one| *one == done));
}

#[test]
fn files_that_do_not_fit_are_refused() {
    let folder = Folder::new();
    let whole = OnnxFile::times(4.0, [0, 0]).bytes();
    folder.refused("text.onnx", b"this is not an ONNX file", &["not an ONNX model"]);
    folder.refused("empty.onnx", b"", &["not an ONNX model"]);
    folder.refused("picture.onnx", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", &["not an ONNX model"]);
    for length in 0..whole.len() {
        let cut = OnnxNetwork::load(folder.write("cut.onnx", &whole[..length]));
        // the operator set comes last, in 4 bytes, and the runtime does without
        assert!(cut.is_err() || length == whole.len() - 4, "{length} of {} bytes", whole.len());
    }
    assert!(OnnxNetwork::load(folder.0.path()).unwrap_err().to_string().contains("folder"));
    let missing = OnnxNetwork::load(folder.0.path().join("none.onnx")).unwrap_err().to_string();
    assert!(missing.contains("none.onnx"), "{missing}");

    let with = |input: &[u64], output: &[u64], op: &str| {
        let file = OnnxFile::default().value(11, "x", FLOAT, input).value(12, "y", FLOAT, output);
        file.node(op, &["x"], "y", &[]).bytes()
    };
    let expected = "1 x 3 x H x W";
    folder.refused("rank.onnx", &with(&[3, 16, 32], &[], "Relu"), &["input 'x' is 3 x 16 x 32", expected]);
    folder.refused("grey.onnx", &with(&[1, 1, 0, 0], &[], "Relu"), &["1 x 1 x side_2 x side_3", expected]);
    folder.refused("batch.onnx", &with(&[8, 3, 16, 32], &[], "Relu"), &["8 x 3 x 16 x 32", expected]);
    folder.refused("last.onnx", &with(&[1, 16, 32, 3], &[], "Relu"), &["channels before rows"]);
    // what only a run tells
    folder.refused(
        "mean.onnx",
        &with(&[1, 3, 0, 0], &[], "GlobalAveragePool"),
        &["1 x 3 x 1 x 1", "1 x 3 x 64 x 128"],
    );
    folder.refused("flat.onnx", &with(&[1, 3, 0, 0], &[], "Flatten"), &["not an image", "4 dims but has 2"]);
    folder.refused("shape.onnx", &with(&[1, 3, 0, 0], &[], "Shape"), &["output", "float"]);
    let pixels = OnnxFile::default().value(11, "x", INT32, &[1, 3, 0, 0]).value(12, "y", FLOAT, &[]);
    folder.refused("int.onnx", &pixels.node("Relu", &["x"], "y", &[]).bytes(), &["input 'x' is", "float"]);
    let mask = OnnxFile::image([0, 0]).value(11, "mask", FLOAT, &[1, 3, 0, 0]);
    folder.refused("two.onnx", &mask.node("Mul", &["x", "mask"], "y", &[]).bytes(), &["2 inputs (x, mask)"]);
    let twice = OnnxFile::image([0, 0]).value(12, "z", FLOAT, &[]).node("Relu", &["x"], "y", &[]);
    folder.refused("outs.onnx", &twice.node("Relu", &["x"], "z", &[]).bytes(), &["2 outputs (y, z)"]);
    let unknown = OnnxFile::image([0, 0]).node("Frobnicate", &["x"], "y", &[]).bytes();
    folder.refused("unknown.onnx", &unknown, &["Frobnicate", "operator"]);
    for place in
        [&[("location", "weights.bin")][..], &[("location", "w.bin"), ("offset", "0"), ("length", "4")]]
    {
        let split =
            OnnxFile::image([0, 0]).elsewhere("factor", place).node("Mul", &["x", "factor"], "y", &[]);
        folder.refused("split.onnx", &split.bytes(), &["other files", "external_data=False"]);
    }
    let missing = OnnxFile::image([0, 0]).node("Mul", &["x", "nowhere"], "y", &[]).bytes();
    folder.refused("missing.onnx", &missing, &["nowhere", "not made before"]);
    let small = OnnxFile::image([0, 0]).constant("three", &[1, 3, 5, 5], &[1.0; 75]);
    folder.refused(
        "small.onnx",
        &small.node("Mul", &["x", "three"], "y", &[]).bytes(),
        &["cannot be run", "Mul"],
    );
}

#[test]
fn graphs_that_the_runtime_would_not_survive_are_refused_before() {
    let folder = Folder::new();
    let whole = OnnxFile::times(4.0, [0, 0]).bytes();
    // lengths beyond the message that holds them, the largest of which seeks backwards
    for length in [&[0x7F][..], &[0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x08], &[0xFF; 9]] {
        let text = [&[0x12], length, &[1][..usize::from(length.len() == 9)], b"x"].concat();
        let graph = [&[0x3A, text.len() as u8][..], &text].concat();
        folder.refused("length.onnx", &[&[8, 8][..], &graph].concat(), &["damaged", "beyond its whole"]);
    }
    // a cycle, and a value that is made twice
    let cycle = OnnxFile::image([0, 0]).node("Add", &["x", "b"], "a", &[]).node("Relu", &["a"], "b", &[]);
    let cycle = cycle.node("Relu", &["b"], "y", &[]).bytes();
    folder.refused("cycle.onnx", &cycle, &["Add takes 'b'", "not made before"]);
    let twice = OnnxFile::image([0, 0]).node("Relu", &["x"], "y", &[]).node("Relu", &["x"], "y", &[]);
    folder.refused("twice.onnx", &twice.bytes(), &["makes 'y' twice"]);
    let loops = OnnxFile::image([0, 0]).node("Loop", &["x"], "y", &[]).bytes();
    folder.refused("loop.onnx", &loops, &["Loop", "cannot be told"]);
    // numbers that would be allocated
    let conv = |name: &'static str, value: u64| {
        let file = OnnxFile::image([0, 0]).constant("kernel", &[3, 3, 1, 1], &[1.0; 9]);
        file.node("Conv", &["x", "kernel"], "y", &[(name, &[value, value])]).bytes()
    };
    folder.refused("pads.onnx", &conv("pads", 1 << 40), &["pads", "limit of 1024"]);
    folder.refused("negative.onnx", &conv("pads", u64::MAX), &["pads", "limit of 1024"]);
    folder.refused("strides.onnx", &conv("strides", 65), &["strides", "limit of 64"]);
    folder.refused(
        "input.onnx",
        &OnnxFile::times(1.0, [1 << 20, 1 << 21]).bytes(),
        &["pixels of input", "limit"],
    );
    let short = OnnxFile::image([0, 0]).constant("c", &[2], &[1.0]);
    folder.refused("short.onnx", &short.bytes(), &["constant 'c' has 1 values", "say 2"]);
    let huge = OnnxFile::image([0, 0]).constant("c", &[1 << 40, 1 << 40], &[1.0]);
    folder.refused("huge.onnx", &huge.bytes(), &["constant 'c'", "limit"]);
    // what is refused is not what every network has
    assert!(OnnxNetwork::load(folder.write("whole.onnx", &whole)).is_ok());
}

/// The cases that were found by fuzzing: an allocation of an unchecked length, a loop without an end, a name of 2⁵⁶ bytes.
#[test]
fn found_files_are_refused() {
    let folder = Folder::new();
    for (name, bytes) in [
        ("alloc.onnx", &include_bytes!("files/alloc.onnx")[..]),
        ("hang.onnx", include_bytes!("files/hang.onnx")),
        ("name.onnx", include_bytes!("files/name.onnx")),
    ] {
        folder.refused(name, bytes, &["not an ONNX model"]);
    }
}

#[test]
fn values_that_are_no_radiance_are_refused_by_name() {
    let folder = Folder::new();
    let nan = OnnxFile::image([0, 0]).constant("two", &[], &[2.0]).node("Sub", &["x", "two"], "z", &[]);
    let network = folder.load(nan.clone().node("Sqrt", &["z"], "y", &[]));
    let error = sky().expand_by(&network, &NetworkOptions::default()).unwrap_err().to_string();
    assert!(error.contains("net.onnx") && error.contains("not numbers"), "{error}");
    let network = folder.load(nan.node("Identity", &["z"], "y", &[]));
    let error = sky().expand_by(&network, &NetworkOptions::default()).unwrap_err().to_string();
    assert!(error.contains("net.onnx") && error.contains("negative"), "{error}");
    // made for one size, it is not asked for another
    let network = folder.load(OnnxFile::times(4.0, [16, 32]));
    let options = NetworkOptions { grid: Some(Equirect::new(64, 32)), ..Default::default() };
    let error = options.check(&network).unwrap_err().to_string();
    assert!(error.contains("net.onnx") && error.contains("32 × 16"), "{error}");
}
