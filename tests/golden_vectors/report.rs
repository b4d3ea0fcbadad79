//! Runs a folder of cases and reports: passed, skipped (by name), failed (with the worst deviations).

use crate::{FAMILIES, Outcome, case::Case};
use burn::tensor::Device;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What became of one case.
#[derive(Debug)]
pub(crate) enum Verdict {
    /// The tensors compared, and how much of its tolerance each uses.
    Passed(Vec<(f64, String)>),
    /// The reason.
    Skipped(String),
    /// One message per failing tensor.
    Failed(Vec<String>),
}

impl Verdict {
    /// With what this process compared besides.
    fn and(self, case: &Case) -> Self {
        match self {
            Self::Passed(ratios) if case.mismatches().is_empty() => {
                Self::Passed(ratios.into_iter().chain(case.ratios()).collect())
            }
            Self::Passed(_) => Self::Failed(case.mismatches()),
            Self::Failed(failures) => Self::Failed(failures.into_iter().chain(case.mismatches()).collect()),
            Self::Skipped(reason) => Self::Skipped(reason),
        }
    }
}

/// Computes one case. A panic inside is a failure of that case only.
pub(crate) fn run_case(case: &Case, device: &Device) -> Verdict {
    let result = catch_unwind(AssertUnwindSafe(|| FAMILIES.iter().find_map(|family| family(case, device))));
    match result {
        // a kind that nobody knows would be a case that nobody runs
        Ok(None) => Verdict::Failed(vec![format!("no module for {:?}", case.module())]),
        Ok(Some(Outcome::Skipped(reason))) => Verdict::Skipped(reason),
        Ok(Some(Outcome::Elsewhere(verdict))) => verdict.and(case),
        Ok(Some(Outcome::Compared)) => match (case.failures(), case.comparisons()) {
            (failures, _) if !failures.is_empty() => Verdict::Failed(failures),
            (_, 0) => Verdict::Failed(vec!["nothing was compared".into()]),
            (..) => Verdict::Passed(case.ratios()),
        },
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            let mut failures = case.failures();
            failures.retain(|f| !f.ends_with("never compared"));
            failures.push(format!("stopped: {}", text.unwrap_or_else(|| "unknown panic".into())));
            Verdict::Failed(failures)
        }
    }
}

/// The case files of a folder, by name.
pub(crate) fn case_files(folder: &Path) -> Vec<PathBuf> {
    let entries =
        std::fs::read_dir(folder).unwrap_or_else(|e| panic!("cannot list {}: {e}", folder.display()));
    let mut files: Vec<_> = entries.map(|e| e.expect("a readable folder entry").path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "safetensors"));
    files.sort();
    assert!(!files.is_empty(), "no case files (*.safetensors) in {}", folder.display());
    files
}

/// The cases of `tests/golden`, all of which are computed on every device of burn.
const CASES: usize = 104;
/// Those that are not computed; whoever adds one says here that it is known.
const NOT_COMPUTED: [&str; 0] = [];

/// Runs every case of a folder on as many threads as there are processors; panics if one failed, and for the folder of
/// this repository if other cases were computed than are expected.
pub(crate) fn run_folder(label: &str, folder: &Path, device: &Device) {
    let files = case_files(folder);
    let (next, results) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(path) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                    let verdict = match Case::load(path) {
                        Ok(case) => run_case(&case, device),
                        Err(message) => Verdict::Failed(vec![format!("unreadable: {message}")]),
                    };
                    results.lock().expect("no worker panics outside a case").push((name, verdict));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no worker panics outside a case");
    results.sort_by(|a, b| a.0.cmp(&b.0));
    let [passed, skipped] = summarise(label, &results);
    if std::env::var_os("VENI_GOLDEN_DIR").is_none() {
        let names = results.iter().filter(|(_, verdict)| matches!(verdict, Verdict::Skipped(_)));
        assert_eq!(
            names.map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
            NOT_COMPUTED,
            "skipped on {label}"
        );
        assert_eq!([passed, skipped], [CASES - NOT_COMPUTED.len(), NOT_COMPUTED.len()], "on {label}");
    }
}

/// Prints past the test framework's capture, so that the counts of a green run are seen too; panics if a case failed or
/// not a single one was computed. Gives how many passed and how many were skipped.
pub(crate) fn summarise(label: &str, results: &[(String, Verdict)]) -> [usize; 2] {
    let (mut text, mut counts, mut tensors, mut closest) =
        (String::new(), [0usize; 3], 0, (0.0, String::new()));
    let verbose = std::env::var_os("VENI_GOLDEN_VERBOSE").is_some();
    for (name, verdict) in results {
        match verdict {
            Verdict::Passed(ratios) => {
                (counts[0], tensors) = (counts[0] + 1, tensors + ratios.len());
                for (ratio, tensor) in ratios {
                    if verbose {
                        text += &format!("  {ratio:.4} of the tolerance: {name}: {tensor}\n");
                    }
                    if *ratio > closest.0 {
                        closest = (*ratio, format!("{name}: {tensor}"));
                    }
                }
            }
            Verdict::Skipped(reason) => {
                counts[1] += 1;
                text += &format!("  skipped {name}: {reason}\n");
            }
            Verdict::Failed(messages) => {
                counts[2] += 1;
                text += &messages.iter().map(|m| format!("  FAILED {name}: {m}\n")).collect::<String>();
            }
        }
    }
    let [passed, skipped, failed] = counts;
    let head = format!(
        "golden on {label}: {passed} passed ({tensors} tensors), {skipped} skipped, {failed} failed; \
         the closest uses {:.2} of its tolerance ({})",
        closest.0, closest.1
    );
    let _ = std::io::stderr().write_all(format!("\n{head}\n{text}").as_bytes());
    assert!(failed == 0, "{head}\n{text}");
    assert!(passed > 0, "{head}: not one case was computed");
    [passed, skipped]
}
