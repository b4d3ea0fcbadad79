//! The allocator, and how it is made to keep the memory of a training.

/// Training allocates and frees tensors all the time, which this allocator does faster than most systems' own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// How many milliseconds the allocator holds on to freed memory before it gives it back to the system; −1: for ever.
#[cfg(unix)]
const DELAY: &str = "MIMALLOC_PURGE_DELAY";

/// Starts this program again, in this very process, with an allocator that gives nothing back: a training step frees
/// a few hundred megabytes and asks for them again, and a sixth of its time went into the system clearing their pages.
/// The allocator reads the setting from the environment before `main`, so it can only be made from outside. A setting
/// of the user's stays; where the system cannot do it, training is merely slower.
#[cfg(unix)]
pub(crate) fn keep_memory() {
    use std::os::unix::process::CommandExt;
    use std::process::Command;

    if std::env::var_os(DELAY).is_none()
        && let Ok(program) = std::env::current_exe()
    {
        // returns only if it failed
        let mut arguments = std::env::args_os();
        let mut command = Command::new(program);
        if let Some(name) = arguments.next() {
            command.arg0(name);
        }
        let _failed = command.args(arguments).env(DELAY, "-1").exec();
    }
}

/// Nothing: only Unix systems replace a running program.
#[cfg(not(unix))]
pub(crate) fn keep_memory() {}
