//! The whole state of a run, in one file: parameters, Adam's moments, where training stands.
//!
//! Written to a temporary name, synced and renamed; the newest few and the best are kept. Randomness needs no state of its own:
//! every draw's generator is derived from (seed, step, frame).

use std::path::{Path, PathBuf};

use xavatar_deformer::{Axis, Grid, VoxelSkinning};
use xavatar_network::Adam;

use crate::fields::{FIELD_NAMES, Fields, Skinning};
use crate::{Error, InputError, Result};
use xavatar_formats::TensorFile;

const FOLDER: &str = "checkpoints";
const BEST: &str = "best.safetensors";

/// Where a run stands.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Progress {
    /// Steps of stage 0 done.
    pub pretraining_steps: u64,
    /// Steps on frames done.
    pub steps: u64,
    /// Seconds of all commands that worked on the run.
    pub seconds: f64,
    /// Running mean of the total loss; infinite before the first step.
    pub running_loss: f64,
    /// The smallest running mean that a checkpoint was written at.
    pub best_loss: f64,
}

/// Fields, optimiser and progress.
pub(super) struct State {
    pub fields: Fields<f32>,
    /// One for each field, in the order of [`FIELD_NAMES`].
    pub adam: Vec<Adam<f32>>,
    pub progress: Progress,
    /// The skinning field's parameters when the search's grid was last sampled.
    pub baked_skinning: Option<Vec<f32>>,
}

const BAKED: &str = "baked_skinning";
const AXES: [&str; 3] = ["skinning.axis_x", "skinning.axis_y", "skinning.axis_z"];
/// Bones of each node, then which, as f32: all that the file holds.
const BONE_COUNTS: &str = "skinning.bone_counts";
const BONES: &str = "skinning.bones";
const LOGITS: &str = "skinning.logits";

impl State {
    fn to_file(&self) -> TensorFile {
        let mut file = TensorFile::default();
        insert_parameters(&mut file, &self.fields);
        for (name, adam) in FIELD_NAMES.iter().zip(&self.adam) {
            let length = vec![adam.first_moment.len()];
            file.tensors.insert(format!("{name}.adam.first"), (length.clone(), adam.first_moment.clone()));
            file.tensors.insert(format!("{name}.adam.second"), (length, adam.second_moment.clone()));
            file.text.insert(format!("{name}.adam.updates"), adam.updates.to_string());
        }
        if let Some(parameters) = &self.baked_skinning {
            file.tensors.insert(BAKED.into(), (vec![parameters.len()], parameters.clone()));
        }
        let Progress { pretraining_steps, steps, seconds, running_loss, best_loss } = self.progress;
        for (key, value) in [
            ("pretraining_steps", pretraining_steps.to_string()),
            ("steps", steps.to_string()),
            ("seconds", seconds.to_string()),
            ("running_loss", running_loss.to_string()),
            ("best_loss", best_loss.to_string()),
        ] {
            file.text.insert(key.into(), value);
        }
        file
    }

    /// Replaces the state by the one stored at `path`.
    pub fn load(&mut self, path: &Path) -> Result<()> {
        let file = TensorFile::read(path)?;
        load_parameters(&file, &mut self.fields)?;
        for (name, adam) in FIELD_NAMES.iter().zip(&mut self.adam) {
            let length = adam.first_moment.len();
            let moment = |kind: &str| stored_vector(&file, path, &format!("{name}.adam.{kind}"), length);
            *adam = Adam {
                first_moment: moment("first")?,
                second_moment: moment("second")?,
                updates: file.parsed(path, &format!("{name}.adam.updates"))?,
            };
        }
        if file.tensors.contains_key(BAKED) {
            self.baked_skinning = Some(stored_vector(&file, path, BAKED, self.adam[2].first_moment.len())?);
        }
        self.progress = Progress {
            pretraining_steps: file.parsed(path, "pretraining_steps")?,
            steps: file.parsed(path, "steps")?,
            seconds: file.parsed(path, "seconds")?,
            running_loss: file.parsed(path, "running_loss")?,
            best_loss: file.parsed(path, "best_loss")?,
        };
        Ok(())
    }

    /// Writes a checkpoint, then removes all but the newest `kept` and the best. Returns its path.
    pub fn save(&mut self, run: &Path, kept: usize) -> Result<PathBuf> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(InputError::io(&folder))?;
        let best = self.progress.running_loss < self.progress.best_loss;
        self.progress.best_loss = self.progress.best_loss.min(self.progress.running_loss);
        let file = self.to_file();
        let step = self.progress.pretraining_steps + self.progress.steps;
        let path = folder.join(format!("step-{step:08}.safetensors"));
        file.write(&path)?;
        if best {
            file.write(&folder.join(BEST))?;
        }
        for old in checkpoints(run)?.into_iter().skip(kept) {
            std::fs::remove_file(&old).map_err(InputError::io(&old))?;
        }
        Ok(path)
    }
}

fn stored_vector(file: &TensorFile, path: &Path, name: &str, length: usize) -> Result<Vec<f32>> {
    match file.tensors.get(name) {
        Some((_, values)) if values.len() == length => Ok(values.clone()),
        other => Err(Error::from(InputError::Mismatch {
            path: path.into(),
            found: other.map_or(format!("no {name}"), |(shape, _)| format!("{name} of shape {shape:?}")),
            expected: format!("{length} entries"),
            remedy: "resume with the configuration that the run was started with".into(),
        })),
    }
}

/// The run's checkpoints, the newest first.
pub(super) fn checkpoints(run: &Path) -> Result<Vec<PathBuf>> {
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

/// Stores the parameters of all fields under `field.parameter`.
pub(crate) fn insert_parameters(file: &mut TensorFile, fields: &Fields<f32>) {
    for (name, network) in FIELD_NAMES.iter().zip(fields.networks()) {
        for entry in network.layout().entries() {
            let values = network.parameters()[entry.range.clone()].to_vec();
            file.tensors.insert(format!("{name}.{}", entry.name), (entry.shape.clone(), values));
        }
    }
    if let Some(voxels) = fields.skinning.voxels() {
        let mut insert = |name: &str, values: Vec<f32>| {
            file.tensors.insert(name.into(), (vec![values.len()], values));
        };
        let (grid, weights) = (voxels.baked().grid(), voxels.baked().weights());
        for (name, axis) in AXES.into_iter().zip(grid.axes()) {
            insert(name, axis.nodes().to_vec());
        }
        let rows = || (0..grid.len()).map(|node| weights.row(node).0);
        insert(BONE_COUNTS, rows().map(|bones| bones.len() as f32).collect());
        insert(BONES, rows().flatten().map(|bone| f32::from(*bone)).collect());
        insert(LOGITS, voxels.parameters().to_vec());
    }
}

/// A skinning field of `joints` joints on a grid, as [`insert_parameters`] stored it in the file at `path`.
pub(crate) fn load_voxels(file: &TensorFile, path: &Path, joints: usize) -> Result<VoxelSkinning<f32>> {
    let broken = |name: &str| {
        Error::from(InputError::Malformed {
            path: path.into(),
            format: "avatar",
            place: format!("tensor `{name}`"),
            found: file.tensors.get(name).map_or("none".into(), |(shape, _)| format!("shape {shape:?}")),
            expected: "the grid, bones and logits of one skinning field".into(),
        })
    };
    let values = |name: &str| file.tensors.get(name).map(|(_, values)| values.as_slice()).ok_or_else(|| broken(name));
    let axis = |name: &str| Ok::<_, Error>(Axis::new(values(name)?.to_vec())?);
    let grid = Grid::new([axis(AXES[0])?, axis(AXES[1])?, axis(AXES[2])?])?;
    let mut bones = values(BONES)?.iter().map(|bone| *bone as usize);
    let mut rows = Vec::with_capacity(grid.len());
    for count in values(BONE_COUNTS)? {
        let row: Vec<usize> = bones.by_ref().take(*count as usize).collect();
        if row.len() as f32 != *count {
            return Err(broken(BONE_COUNTS));
        }
        rows.push(row);
    }
    Ok(VoxelSkinning::from_logits(grid, joints, &rows, values(LOGITS)?.to_vec())?)
}

/// Replaces the parameters of all fields by those stored under `field.parameter`.
pub(crate) fn load_parameters(file: &TensorFile, fields: &mut Fields<f32>) -> Result<()> {
    for (name, network) in FIELD_NAMES.iter().zip(fields.networks_mut()) {
        let prefix = format!("{name}.");
        let own =
            file.tensors.iter().filter_map(|(key, tensor)| Some((key.strip_prefix(&prefix)?.into(), tensor.clone())));
        let flat = network.layout().gather(&own.collect())?;
        network.update(|parameters| parameters.copy_from_slice(&flat));
    }
    if let Skinning::Voxels(voxels) = &mut fields.skinning {
        let stored = file.tensors.get(LOGITS).map(|(_, logits)| logits.as_slice()).unwrap_or_default();
        if stored.len() != voxels.parameters().len() {
            return Err(Error::from(InputError::Value {
                name: format!("the stored tensor `{LOGITS}`"),
                found: format!("{} entries", stored.len()),
                expected: format!("{}", voxels.parameters().len()),
            }));
        }
        voxels.update(|logits| logits.copy_from_slice(stored));
    }
    Ok(())
}
