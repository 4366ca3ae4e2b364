//! The whole state of a run, in one file: parameters, Adam's moments, where training stands.
//!
//! Written to a temporary name, synced and renamed; the newest few and the best are kept, and none goes before its successor is on
//! the disk. One that was damaged there is noticed by its checksum, and the one before takes its place. Randomness needs no state of
//! its own: every draw's generator is derived from (seed, step, frame).

use std::path::{Path, PathBuf};

use glam::Vec3;
use xavatar_formats::{TensorFile, create_folder};
use xavatar_network::Adam;

use crate::body::PoseAxisAngle;
use crate::train::engine::Learned;
use crate::train::{Progress, RefinedPose, TrainingState};
use crate::{Error, InputError, Result};

pub(super) const FOLDER: &str = "checkpoints";
const BEST: &str = "best.safetensors";
/// The tensor that holds what [`Learned::sampled_skinning`] does.
const BAKED: &str = "baked_skinning";
/// The tensor that holds what frames' poses were refined to.
const POSES: &str = "refined_poses";

fn to_file(learned: &Learned, progress: &Progress) -> TensorFile {
    let mut file = TensorFile::default();
    learned.fields.insert_into(&mut file);
    for (name, adam) in learned.adam.as_ref().named() {
        let length = vec![adam.first_moment.len()];
        file.tensors.insert(format!("{name}.adam.first"), (length.clone(), adam.first_moment.clone()));
        file.tensors.insert(format!("{name}.adam.second"), (length, adam.second_moment.clone()));
        file.text.insert(format!("{name}.adam.updates"), adam.updates.to_string());
    }
    if let Some(parameters) = &learned.sampled_skinning {
        file.tensors.insert(BAKED.into(), (vec![parameters.len()], parameters.clone()));
    }
    let Progress { pretraining_steps, steps, seconds, running_loss, best_loss, refinements, ref poses } = *progress;
    if !poses.is_empty() {
        file.tensors.insert(POSES.into(), pose_rows(poses));
    }
    for (key, value) in [
        ("pretraining_steps", pretraining_steps.to_string()),
        ("steps", steps.to_string()),
        ("seconds", seconds.to_string()),
        ("running_loss", running_loss.to_string()),
        ("best_loss", best_loss.to_string()),
        ("refinements", refinements.to_string()),
    ] {
        file.text.insert(key.into(), value);
    }
    file
}

/// Replaces a state by that of a run's newest checkpoint that is not damaged, if it has one. Damaged ones are removed: they are made
/// again.
pub(super) fn restore_newest(run: &Path, state: &mut TrainingState) -> Result<()> {
    for path in checkpoints(run)? {
        match TensorFile::read(&path) {
            Ok(file) => return restore(&file, &path, state),
            Err(damaged @ InputError::Malformed { .. }) => {
                log::warn!("{damaged}; going on from the checkpoint before");
                std::fs::remove_file(&path).map_err(InputError::io(&path))?;
            }
            Err(other) => return Err(other.into()),
        }
    }
    Ok(())
}

/// Replaces a state by the one in a file that was read at `path`.
fn restore(file: &TensorFile, path: &Path, state: &mut TrainingState) -> Result<()> {
    let Learned { fields, adam, sampled_skinning } = &mut state.learned;
    fields.load_from(file)?;
    for (name, adam) in adam.as_mut().named() {
        let length = adam.first_moment.len();
        let moment = |kind: &str| stored_vector(file, path, &format!("{name}.adam.{kind}"), length);
        *adam = Adam {
            first_moment: moment("first")?,
            second_moment: moment("second")?,
            updates: file.parsed(path, &format!("{name}.adam.updates"))?,
        };
    }
    if file.tensors.contains_key(BAKED) {
        *sampled_skinning = Some(stored_vector(file, path, BAKED, fields.skinning.parameters().len())?);
    }
    state.progress = Progress {
        pretraining_steps: file.parsed(path, "pretraining_steps")?,
        steps: file.parsed(path, "steps")?,
        seconds: file.parsed(path, "seconds")?,
        running_loss: file.parsed(path, "running_loss")?,
        best_loss: file.parsed(path, "best_loss")?,
        refinements: if file.text.contains_key("refinements") { file.parsed(path, "refinements")? } else { 0 },
        poses: stored_poses(file, path)?,
    };
    Ok(())
}

/// Refined poses as a tensor (F, J + 1, 3): the joints' rotations, then the translation.
fn pose_rows(poses: &[RefinedPose]) -> (Vec<usize>, Vec<f32>) {
    let row = |pose: &RefinedPose| -> Vec<[f32; 3]> {
        pose.rotations.iter().map(|turn| turn.0).chain([pose.translation]).map(|value| value.to_array()).collect()
    };
    let rows: Vec<Vec<[f32; 3]>> = poses.iter().map(row).collect();
    let width = rows.first().map_or(0, Vec::len);
    (vec![rows.len(), width, 3], rows.concat().into_flattened())
}

fn stored_poses(file: &TensorFile, path: &Path) -> Result<Vec<RefinedPose>> {
    let Some((shape, values)) = file.tensors.get(POSES) else { return Ok(Vec::new()) };
    let width = match shape[..] {
        [_, width, 3] if width > 1 => width,
        _ => return Err(mismatch(path, format!("{POSES} of shape {shape:?}"), "(frames, joints + 1, 3)".into())),
    };
    let pose = |row: &[f32]| {
        let mut rows = row.as_chunks::<3>().0.iter().map(|value| Vec3::from_array(*value));
        let rotations = rows.by_ref().take(width - 1).map(PoseAxisAngle).collect();
        RefinedPose { rotations, translation: rows.next().unwrap_or_default() }
    };
    Ok(values.chunks_exact(3 * width).map(pose).collect())
}

/// Checkpoints that are kept beside the best: a damaged one gives way to the one before.
const KEPT: usize = 2;

/// Writes a checkpoint, then removes all but the newest [`KEPT`] and the best. Returns its path.
pub(super) fn save(learned: &Learned, progress: &mut Progress, run: &Path) -> Result<PathBuf> {
    let folder = run.join(FOLDER);
    create_folder(&folder)?;
    let best = progress.running_loss < progress.best_loss;
    progress.best_loss = progress.best_loss.min(progress.running_loss);
    let file = to_file(learned, progress);
    let path = folder.join(format!("step-{:08}.safetensors", progress.all_steps()));
    file.write(&path)?;
    if best {
        file.write(&folder.join(BEST))?;
    }
    for old in checkpoints(run)?.into_iter().skip(KEPT) {
        std::fs::remove_file(&old).map_err(InputError::io(&old))?;
    }
    Ok(path)
}

fn stored_vector(file: &TensorFile, path: &Path, name: &str, length: usize) -> Result<Vec<f32>> {
    match file.tensors.get(name) {
        Some((_, values)) if values.len() == length => Ok(values.clone()),
        other => {
            let found = other.map_or(format!("no {name}"), |(shape, _)| format!("{name} of shape {shape:?}"));
            Err(mismatch(path, found, format!("{length} entries")))
        }
    }
}

fn mismatch(path: &Path, found: String, expected: String) -> Error {
    let remedy = "resume with the configuration that the run was started with".into();
    Error::from(InputError::Mismatch { path: path.into(), found, expected, remedy })
}

/// The run's checkpoints, the newest first.
fn checkpoints(run: &Path) -> Result<Vec<PathBuf>> {
    let folder = run.join(FOLDER);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(InputError::io(&folder))? {
        let entry = entry.map_err(InputError::io(&folder))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with("step-") && name.ends_with(".safetensors") {
            paths.push(entry.path());
        }
    }
    paths.sort();
    paths.reverse();
    Ok(paths)
}
