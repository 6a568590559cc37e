//! Memory limit of the reading process on this machine.

/// Assumed available memory where the system does not report it.
const UNKNOWN: u64 = 8 << 30;
/// Smallest limit: with less, the kernel's libraries leave too little for any file.
const LEAST: u64 = 1 << 30;

/// Half of the available memory, so that the answer fits into the other half; at least [`LEAST`].
pub fn memory_limit_bytes() -> u64 {
    let machine = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| available(&text));
    let limits = [machine, group()];
    let available = limits.into_iter().flatten().min();
    available.map_or(UNKNOWN, |bytes| (bytes / 2).max(LEAST))
}

/// `MemAvailable` of `/proc/meminfo`, bytes.
fn available(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

/// Memory left under the limit of this process's control group (version 2); `None` without a limit.
fn group() -> Option<u64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let own = groups.lines().find_map(|line| line.strip_prefix("0::"))?;
    let folder = format!("/sys/fs/cgroup{}", own.trim_end_matches('/'));
    let number = |name: &str| -> Option<u64> {
        let text = std::fs::read_to_string(format!("{folder}/{name}")).ok()?;
        text.trim().parse().ok()
    };
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn available_memory_is_read_from_the_systems_words() {
        let text = "MemTotal:       16384000 kB\nMemFree:          100000 kB\nMemAvailable:    8000000 kB\n";
        assert_eq!(available(text), Some(8_000_000 * 1024));
        assert_eq!(available("MemTotal: 1 kB\n"), None);
        assert!(memory_limit_bytes() >= LEAST);
    }
}
