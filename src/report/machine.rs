//! The machine that a time was measured on: nobody can judge the one without the other.

use super::Fact;
use crate::doctor::Facts;

/// Processor, threads, memory and system, as far as the system tells.
pub fn machine() -> Vec<Fact> {
    let machine = Facts::of_this_machine();
    let processor = machine.processor.unwrap_or_else(|| std::env::consts::ARCH.into());
    let mut facts = vec![Fact::new("Processor", format!("{processor}, {} threads", machine.threads))];
    if let Some(bytes) = machine.memory_bytes {
        facts.push(Fact::new("Memory", format!("{:.0} GiB", bytes as f64 / f64::from(1 << 30))));
    }
    facts.push(Fact::new("System", std::env::consts::OS));
    facts
}
