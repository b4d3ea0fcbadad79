//! How much memory this process may still take.

use crate::{Error, Result};

/// Less than this is not worth asking the system about.
const SMALL: u64 = 256 << 20;

/// Refuses what the memory does not hold, before it is allocated: where an allocation fails, the process ends, and with it
/// the work on all other files.
///
/// # Errors
/// [`Error::TooLarge`] with both numbers if `bytes` are more than [`available`].
pub fn check(bytes: u64) -> Result<()> {
    let left = if bytes > SMALL { available() } else { None };
    match left.filter(|left| bytes > *left) {
        None => Ok(()),
        Some(left) => Err(Error::beyond(
            format!(
                "its pixels need {} MiB of memory, and {} MiB are available: make it smaller",
                bytes >> 20,
                left >> 20
            ),
            bytes,
            left,
        )),
    }
}

/// Bytes that can be allocated before the system refuses or ends the process: the least of what the machine has left,
/// what the control group allows and what the limit of the address space (`ulimit -v`) leaves. `None` where the system
/// does not say (anything but Linux).
pub fn available() -> Option<u64> {
    let found = [machine(), group(), address_space()];
    found.into_iter().flatten().min()
}

/// `MemAvailable` of /proc/meminfo.
fn machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    kib(&text, "MemAvailable:")
}

/// The limit of the control group (version 2) less what is used.
fn group() -> Option<u64> {
    let read = |name| std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok();
    let limit: u64 = read("memory.max")?.trim().parse().ok()?;
    let used: u64 = read("memory.current")?.trim().parse().ok()?;
    Some(limit.saturating_sub(used))
}

/// The limit of the address space less what is mapped.
fn address_space() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    let mapped = kib(&std::fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?;
    Some(limit.saturating_sub(mapped))
}

/// The number of a line `NAME: 123 kB`, in bytes.
fn kib(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u64>().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kibibytes_are_read_by_name() {
        let text = "MemTotal: 10 kB\nMemAvailable:     7 kB\n";
        assert_eq!(kib(text, "MemAvailable:"), Some(7168));
        assert_eq!(kib(text, "VmSize:"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_running_machine_has_some_memory_left() {
        let found = available().unwrap();
        assert!((1 << 20..1 << 50).contains(&found), "{found}");
        check(found / 4).unwrap();
        let error = check(2 * found + (1 << 50)).unwrap_err();
        assert!(
            matches!(&error, Error::TooLarge { message, .. } if message.contains("MiB are available")),
            "{error}"
        );
    }
}
