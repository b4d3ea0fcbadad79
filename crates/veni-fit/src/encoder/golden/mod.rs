//! Golden numbers of the reference implementation: single layers and whole encoders, under each file's own tolerance.
//!
//! The files, their reader and the tolerance rule are those of the whole system's golden test. Gradients in the files
//! are not computed here, and neither are layers that this encoder lacks; those cases are skipped by name.

#[allow(dead_code, reason = "the whole system's test uses all of it")]
#[path = "../../../../../tests/golden_vectors/bindings.rs"]
mod bindings;
#[allow(dead_code, reason = "the whole system's test uses all of it")]
#[path = "../../../../../tests/golden_vectors/case.rs"]
mod case;
#[path = "../../../../../tests/golden_vectors/compare.rs"]
mod compare;
mod encoders;
#[path = "../../../../../tests/golden_vectors/filler.rs"]
mod filler;
mod layers;
#[allow(dead_code, reason = "the whole system's test uses all of it")]
#[path = "../../../../../tests/golden_vectors/official.rs"]
mod official;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use veni_light::model::{self, Array};

use bindings::Bindings;
use case::Case;

/// Why a case is not computed here.
type Skipped = &'static str;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden")
}

fn load(name: &str) -> Case {
    Case::load(&folder().join(format!("{name}.safetensors"))).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Names of the case files that start with one of `prefixes`.
fn names(prefixes: &[&str]) -> Vec<String> {
    let entries = std::fs::read_dir(folder()).expect("the folder of golden files");
    let name = |entry: std::fs::DirEntry| entry.path().file_stem()?.to_str().map(str::to_owned);
    let mut names: Vec<_> = entries.filter_map(|e| name(e.expect("a readable entry"))).collect();
    names.retain(|name| prefixes.iter().any(|prefix| name.starts_with(prefix)));
    names.sort();
    names
}

/// A case's weights by our names under `prefix`.
fn tensors(case: &Case, bindings: &Bindings, prefix: &str) -> BTreeMap<String, Array> {
    let named = |(name, data): (String, case::Data)| {
        (format!("{prefix}.{name}"), Array { shape: data.shape, data: data.values })
    };
    bindings.weights(case).into_iter().map(named).collect()
}

/// What differs: outputs beyond the tolerance, and outputs that were not compared.
fn failures(case: &Case) -> Vec<String> {
    let mut failures = case.failures();
    failures.retain(|failure| !failure.starts_with("grad."));
    failures
}

/// Runs cases and gives the names of those that passed and of those skipped, with the reason.
fn run(names: &[String], compute: impl Fn(&Case) -> Result<(), Skipped>) -> (Vec<String>, Vec<String>) {
    let (mut passed, mut skipped, mut failed) = (Vec::new(), Vec::new(), Vec::new());
    let mut closest = (0.0, String::new());
    for name in names {
        let case = load(name);
        if let Err(reason) = compute(&case) {
            skipped.push(format!("{name}: {reason}"));
            continue;
        }
        match failures(&case) {
            failures if !failures.is_empty() => failed.push(format!("{name}: {failures:?}")),
            _ if case.comparisons() == 0 => failed.push(format!("{name}: nothing was compared")),
            _ => passed.push(name.clone()),
        }
        for (ratio, tensor) in case.ratios() {
            if ratio > closest.0 {
                closest = (ratio, format!("{name}: {tensor}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(closest.0 > 0.0 && closest.0 <= 1.0, "{closest:?}");
    (passed, skipped)
}

/// What processors with narrower vectors would compute.
#[test]
fn narrower_vectors_compute_the_same() {
    use super::simd::narrow::{CHOSEN, NONE, SCALAR, V3};
    use std::sync::atomic::Ordering::Relaxed;
    let small = ["c02_", "c03_encoder_default_nomirror", "c03_encoder_late_split", "c03_encoder_full_vn"];
    for vectors in [SCALAR, V3] {
        CHOSEN.store(vectors, Relaxed);
        let (layers, _) = run(&names(&small[..1]), layers::compute);
        let (encoders, _) = run(&names(&small[1..]), encoders::compute);
        CHOSEN.store(NONE, Relaxed);
        assert_eq!((layers.len(), encoders.len()), (17, 3), "vectors {vectors}");
    }
}
