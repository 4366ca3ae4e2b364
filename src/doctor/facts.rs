//! The processor and memory, as the system tells.

use serde::Serialize;
use xavatar_network::product_instructions;
use xavatar_vector::pass_instructions;

/// What a machine has that decides how fast the program is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// The processor's name, where the system tells.
    pub processor: Option<String>,
    /// Vector instructions that the processor has, of those that matter here.
    pub features: Vec<&'static str>,
    /// What the passes over rows use (activations, softmax, grids).
    pub pass_instructions: &'static str,
    /// What the matrix products use.
    pub product_instructions: &'static str,
    /// Threads that the program computes with.
    pub threads: usize,
    /// Threads that the system would run at a time.
    pub available_threads: usize,
    /// Memory in all, bytes, where the system tells; that of the container, if it is less.
    pub memory_bytes: Option<u64>,
    /// Memory that is free or can be freed, bytes, where the system tells.
    pub free_memory_bytes: Option<u64>,
    /// Whether the program was built with optimisation; without, it is some twenty times slower.
    pub optimised: bool,
}

impl Facts {
    /// Those of this machine.
    #[allow(clippy::disallowed_methods, reason = "what the system says of itself are files without a size")]
    pub fn of_this_machine() -> Self {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let memory = read("/proc/meminfo");
        let kibibytes = |name: &str| {
            let value = memory.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
            Some(value.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
        };
        // `max` where the container has no limit.
        let limit = read("/sys/fs/cgroup/memory.max").trim().parse::<u64>().unwrap_or(u64::MAX);
        Self {
            processor: read("/proc/cpuinfo").lines().find_map(|line| {
                let (name, value) = line.split_once(':')?;
                (name.trim() == "model name").then(|| value.trim().to_owned())
            }),
            features: features(),
            pass_instructions: pass_instructions(),
            product_instructions: product_instructions(),
            threads: rayon::current_num_threads(),
            available_threads: std::thread::available_parallelism().map_or(1, usize::from),
            memory_bytes: kibibytes("MemTotal").map(|bytes| bytes.min(limit)),
            free_memory_bytes: kibibytes("MemAvailable").map(|bytes| bytes.min(limit)),
            optimised: !cfg!(debug_assertions),
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn features() -> Vec<&'static str> {
    use std::arch::is_x86_feature_detected as has;
    let features = [
        ("sse4.2", has!("sse4.2")),
        ("avx", has!("avx")),
        ("avx2", has!("avx2")),
        ("fma", has!("fma")),
        ("avx512f", has!("avx512f")),
        ("avx512dq", has!("avx512dq")),
        ("avx512vl", has!("avx512vl")),
    ];
    features.into_iter().filter_map(|(name, has)| has.then_some(name)).collect()
}

#[cfg(target_arch = "aarch64")]
fn features() -> Vec<&'static str> {
    if std::arch::is_aarch64_feature_detected!("neon") { vec!["neon"] } else { Vec::new() }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn features() -> Vec<&'static str> {
    Vec::new()
}
