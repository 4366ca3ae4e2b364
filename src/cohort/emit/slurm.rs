//! An array job of Slurm, one task a subject.

use std::path::Path;

use super::{CORES, NOTICE, STOPPED, job_name};
use crate::cohort::Manifest;

/// A script for `sbatch`. Slurm sends USR1 before the time is up and TERM when another job is more urgent; either saves the training, and the
/// task asks to be queued again. `program` and `manifest` are paths as the nodes see them.
pub fn slurm_script(manifest: &Manifest, program: &Path, path: &Path) -> String {
    let (name, count) = (job_name(&manifest.path), manifest.subjects.len());
    let (last, program, path) = (count - 1, quoted(program), quoted(path));
    format!(
        r#"#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=0-{last}
#SBATCH --cpus-per-task={CORES}
#SBATCH --mem=8G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@{NOTICE}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output={name}-%a.log

{program} --threads "${{SLURM_CPUS_PER_TASK:-{CORES}}}" batch {path} --shard "$SLURM_ARRAY_TASK_ID/{count}" &
work=$!
# Bash does not pass signals on.
trap 'kill -USR1 "$work"' USR1
trap 'kill -TERM "$work"' TERM
# A signal ends the waiting, not the work.
while kill -0 "$work" 2> /dev/null; do
    wait "$work"
done
wait "$work"
code=$?
# Stopped, with the training saved: to be gone on with.
if [ "$code" -eq {STOPPED} ]; then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
"#
    )
}

/// So that a shell takes the path as it is.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}
