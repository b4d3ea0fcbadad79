//! Every entry that takes bytes from outside, as a function of bytes.
//!
//! The libFuzzer binaries beside this crate (`fuzz/fuzz_targets`), the replay that is an ordinary test, and the runner for
//! stable toolchains (`fuzz-stable`) all run these. A target reads what it is given as the program would, with at most
//! [`PIXELS`] pixels, and lets go of the result: whether it is read or refused does not matter, only that it returns.

mod images;
mod light;
pub mod monitor;
pub mod mutate;
#[cfg(feature = "onnx")]
mod network;
mod obj;
mod pictures;
#[cfg(feature = "learn")]
mod runs;

use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Pixels that a file may declare: 32 MiB at 32 bytes each.
pub const PIXELS: usize = 1 << 20;

/// An entry for bytes from outside.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Also the name of its folder in `fuzz/corpus` and of its libFuzzer binary.
    pub name: &'static str,
    /// Runs it on a file; whether that was read and not refused.
    pub run: fn(&Path) -> bool,
    /// Small inputs that are read without an error.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Mends what every mutation breaks, checksums, so that what lies behind them is reached.
    pub repair: fn(&mut [u8]),
}

/// All targets that the features of this build have.
pub fn targets() -> Vec<Target> {
    let mut all = images::TARGETS.to_vec();
    all.extend(pictures::TARGETS);
    all.extend(light::TARGETS);
    all.extend(obj::TARGETS);
    #[cfg(feature = "onnx")]
    all.extend(network::TARGETS);
    #[cfg(feature = "learn")]
    all.extend(runs::TARGETS);
    all
}

/// The target of this name.
///
/// # Panics
/// If there is none.
pub fn target(name: &str) -> Target {
    let found = targets().into_iter().find(|target| target.name == name);
    found.unwrap_or_else(|| panic!("no target {name} in this build"))
}

/// Leaves checksums as they are.
fn untouched(_: &mut [u8]) {}

/// Runs a target by its name on bytes: what the libFuzzer binaries call.
pub fn run(name: &str, data: &[u8]) {
    (target(name).run)(&on_disk(data));
}

/// Writes the input to the one file of this thread, below `VENI_FUZZ_DIR` or, where that is not
/// set, in memory. It is there after an abort too.
///
/// # Panics
/// If it cannot be written.
pub fn on_disk(data: &[u8]) -> PathBuf {
    thread_local! {
        static PLACE: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
    }
    PLACE.with(|place| {
        let mut place = place.borrow_mut();
        let folder = place.get_or_insert_with(|| {
            let memory = || Some(PathBuf::from("/dev/shm")).filter(|path| path.is_dir());
            let parent = std::env::var_os("VENI_FUZZ_DIR").map(PathBuf::from).or_else(memory);
            let parent = parent.unwrap_or_else(std::env::temp_dir);
            tempfile::tempdir_in(parent).expect("a folder for the input")
        });
        let path = folder.path().join("input");
        std::fs::write(&path, data).expect("the input can be written");
        path
    })
}

/// Inputs of a target that are kept in the repository: `fuzz/corpus/NAME`, sorted by name.
///
/// # Panics
/// If one cannot be read.
pub fn corpus(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../corpus").join(name);
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), std::fs::read(path).expect("a corpus file"))).collect()
}
