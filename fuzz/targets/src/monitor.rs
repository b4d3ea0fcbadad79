//! What running an input cost, and what went wrong: panics (caught ones too), time, memory.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

use crate::{Target, on_disk};

/// An input that takes longer than this hangs.
pub const LONGEST: Duration = Duration::from_secs(10);

/// Places of all panics since [`note_panics`], by the thread that panicked and by those it started alike.
static PANICS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// How a target did.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Inputs run.
    pub inputs: u64,
    /// Inputs that made something panic, with the place of the first panic of each.
    pub crashes: Vec<(PathBuf, String)>,
    /// The longest time that one took.
    pub slowest: Duration,
    /// The most memory that the process held while one ran, bytes; 0 where the system does not tell.
    pub largest: u64,
}

/// From now on panics are noted, not printed.
pub fn note_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        std::panic::set_hook(Box::new(|info| {
            let place = info.location().map_or("unknown".to_owned(), ToString::to_string);
            panics().push(format!("{place}: {}", info.payload_as_str().unwrap_or_default()));
        }));
    });
}

fn panics() -> std::sync::MutexGuard<'static, Vec<String>> {
    PANICS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A clock that ends the process when one input takes longer than [`LONGEST`].
#[derive(Debug)]
pub struct Clock {
    started: Instant,
    /// Milliseconds since the start at which the present input began; 0: none runs.
    began: Arc<AtomicU64>,
}

impl Clock {
    /// Starts the watching thread; it ends the process with code 3 and names the input's file.
    ///
    /// # Panics
    /// If there is no thread to be had.
    pub fn start(target: &'static str) -> Self {
        let (started, began) = (Instant::now(), Arc::new(AtomicU64::new(0)));
        let seen = Arc::clone(&began);
        let watching = move || loop {
            std::thread::sleep(Duration::from_millis(500));
            let begin = seen.load(Ordering::SeqCst);
            let now = started.elapsed();
            if begin > 0 && now > Duration::from_millis(begin) + LONGEST {
                eprintln!("{target}: the input before this line takes longer than {LONGEST:?}");
                std::process::exit(3);
            }
        };
        std::thread::Builder::new().name("clock".into()).spawn(watching).expect("a thread");
        Self { started, began }
    }
}

impl Tally {
    /// Runs one input. One that panics is kept in `keep`, if that is given.
    ///
    /// # Panics
    /// If it cannot be kept.
    pub fn run(&mut self, target: &Target, data: &[u8], clock: Option<&Clock>, keep: Option<&Path>) {
        let path = on_disk(data);
        if let Some(clock) = clock {
            clock.began.store(clock.started.elapsed().as_millis().max(1) as u64, Ordering::SeqCst);
        }
        let before = panics().len();
        reset_peak();
        let begin = Instant::now();
        let _ = catch_unwind(AssertUnwindSafe(|| (target.run)(&path)));
        self.slowest = self.slowest.max(begin.elapsed());
        self.largest = self.largest.max(peak());
        self.inputs += 1;
        if let Some(clock) = clock {
            clock.began.store(0, Ordering::SeqCst);
        }
        let place = panics().get(before).cloned();
        if let Some(place) = place {
            let kept = keep.map_or(path, |folder| {
                let kept = folder.join(format!("{}-{:06}", target.name, self.inputs));
                std::fs::write(&kept, data).expect("a crash can be kept");
                kept
            });
            self.crashes.push((kept, place));
        }
    }
}

/// The process's largest resident size is reset (Linux).
fn reset_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The largest resident size since then.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    1024 * kib.unwrap_or(0)
}
