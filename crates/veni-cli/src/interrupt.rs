//! Ctrl-C and requests to terminate: whatever runs ends at once and leaves no half-written file, unless it handles the first
//! signal itself.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use veni_light::output::abandon;

use crate::report::complain;

/// What handles the first signal instead of the end of the process.
static HANDLER: Mutex<Option<Handler>> = Mutex::new(None);

/// Whether the work said something since the first signal came: it is about to end by itself.
static HEARD: AtomicBool = AtomicBool::new(false);
/// How long it may say nothing when the system wants the process to end: what asks so kills it outright soon after.
const PATIENCE: Duration = Duration::from_secs(8);

struct Handler {
    flag: &'static AtomicBool,
    said: &'static str,
}

/// Watches from now on. Where that is not possible the system's own way of ending a process stays.
pub(crate) fn watch() {
    if let Err(error) = system::watch() {
        complain(&format!("cannot watch for Ctrl-C ({error}): a file being written then stays half-written"));
    }
}

/// From now on the first signal raises the flag and says `said`; the second one ends the process.
#[cfg(feature = "learn")]
pub(crate) fn handle(said: &'static str) -> &'static AtomicBool {
    let flag: &AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    *HANDLER.lock().unwrap_or_else(PoisonError::into_inner) = Some(Handler { flag, said });
    flag
}

/// Part of the work is done, and it has seen by now that a signal came, or will see it at once.
#[cfg(feature = "learn")]
pub(crate) fn heard() {
    HEARD.store(true, Ordering::Relaxed);
}

/// A signal came. Whether the process is to go on.
fn goes_on() -> bool {
    let handler = HANDLER.lock().unwrap_or_else(PoisonError::into_inner);
    match &*handler {
        Some(Handler { flag, said }) if !flag.swap(true, Ordering::Relaxed) => {
            HEARD.store(false, Ordering::Relaxed);
            complain(said);
            true
        }
        _ => false,
    }
}

#[cfg(unix)]
mod system {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    use std::sync::atomic::Ordering;

    use super::{HEARD, PATIENCE, abandon, complain, goes_on};

    pub(super) fn watch() -> std::io::Result<()> {
        let ignored = ignored();
        let watched = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| !is_in(ignored, *signal));
        let mut signals = Signals::new(watched)?;
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            for signal in signals.forever() {
                if !goes_on() {
                    end(signal);
                } else if signal != SIGINT {
                    // whoever presses Ctrl-C can press it again
                    std::thread::spawn(move || insist(signal));
                }
            }
        })?;
        Ok(())
    }

    /// Ends the process if its work has not been heard of in time.
    fn insist(signal: i32) {
        std::thread::sleep(PATIENCE);
        if !HEARD.load(Ordering::Relaxed) {
            let seconds = PATIENCE.as_secs();
            complain(&format!(
                "no step ended within {seconds} s: ended now, the last checkpoint is what there is"
            ));
            end(signal);
        }
    }

    fn end(signal: i32) {
        let _written = abandon();
        // so that a shell, too, sees which signal it was
        let _ = emulate_default_handler(signal);
    }

    fn is_in(set: u64, signal: i32) -> bool {
        u32::try_from(signal - 1).is_ok_and(|bit| set.checked_shr(bit).is_some_and(|set| set & 1 == 1))
    }

    /// The signals that whoever started the process (nohup, a shell's background) does not want it to hear. Only Linux
    /// tells without a signal's handler being replaced.
    fn ignored() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn signals_are_bits_from_one() {
            assert!(is_in(0b1, 1) && !is_in(0b1, 2) && is_in(1 << 14, SIGTERM) && !is_in(u64::MAX, 0));
            // the standard library ignores it in every program
            #[cfg(target_os = "linux")]
            assert!(is_in(ignored(), signal_hook::consts::SIGPIPE));
        }
    }
}

#[cfg(not(unix))]
mod system {
    use super::{abandon, goes_on};

    pub(super) fn watch() -> Result<(), ctrlc::Error> {
        ctrlc::set_handler(|| {
            if !goes_on() {
                let _written = abandon();
                std::process::exit(130);
            }
        })
    }
}
