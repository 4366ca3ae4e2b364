//! The machine that a figure was measured on: nobody can judge a time without it.

use std::fs;

use super::Fact;

/// Processor, threads and memory, as far as the system tells.
pub fn machine() -> Vec<Fact> {
    let threads = rayon::current_num_threads();
    let processor = field_of("/proc/cpuinfo", "model name").unwrap_or_else(|| std::env::consts::ARCH.into());
    let mut facts = vec![Fact::new("Processor", format!("{processor}, {threads} threads"))];
    let kibibytes = field_of("/proc/meminfo", "MemTotal").and_then(|text| text.split(' ').next()?.parse::<u64>().ok());
    if let Some(kibibytes) = kibibytes {
        facts.push(Fact::new("Memory", format!("{:.0} GiB", kibibytes as f64 / f64::from(1 << 20))));
    }
    facts.push(Fact::new("System", std::env::consts::OS));
    facts
}

/// The first value of a key in a file of `key : value` lines.
fn field_of(file: &str, key: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    let fields = text.lines().filter_map(|line| line.split_once(':'));
    fields.into_iter().find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim().into())
}
