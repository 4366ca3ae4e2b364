//! The same work as a job of a scheduler that is there already.

mod kubernetes;
mod slurm;

use std::path::Path;

pub use kubernetes::kubernetes_job;
pub use slurm::slurm_script;

/// Exit code of a process that was stopped and can be started again.
const STOPPED: u8 = 3;
/// Cores that a subject is given: more no longer help much (docs/performance.md).
const CORES: usize = 8;
/// Seconds between the scheduler's notice and its kill, in which the step is ended and saved.
const NOTICE: u32 = 120;

/// What a job is called: the manifest's name.
fn job_name(manifest: &Path) -> String {
    let stem = manifest.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let plain: String = stem.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect();
    match plain.trim_matches('-') {
        "" => "avatars".into(),
        // A name in Kubernetes, with room for what is put behind it.
        name => name.chars().take(40).collect::<String>().trim_matches('-').into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_have_names_that_every_scheduler_takes() {
        for (file, name) in [
            ("a/Lab_2026.toml", "lab-2026"),
            ("__.csv", "avatars"),
            (&format!("{}.toml", "x".repeat(60)), &"x".repeat(40)),
        ] {
            assert_eq!(job_name(Path::new(file)), name);
        }
    }
}
