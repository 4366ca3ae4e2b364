//! Writing a subject in the preprocessed X-Humans layout.

use std::io::Write;
use std::path::Path;

use super::{COLOURED_SCANS, GENDER_FILE, PARAMETERS, SHAPE_FILE, parameters_path};
use crate::ScanFrame;
use crate::fields::components;
use xavatar_body::{BodyParameters, Gender, HandPose, PoseAxisAngle, smplx};
use xavatar_formats::{Array, ArrayMap, Error, Result, npy_bytes, write_atomically, write_pickle};
use xavatar_mesh::write_ply;

/// Writes a subject's folder: gender, mean shape, and each frame's scan as a PLY and its parameters.
///
/// Frames are taken one at a time, so that they need not be in memory together; each goes where its id says.
///
/// # Errors
/// [`Error::Value`] if a hand pose is not relative to the mean, the only convention of the layout; [`Error::Io`];
/// the first error that `frames` gives.
pub fn write_subject(
    folder: impl AsRef<Path>,
    gender: Gender,
    betas: &[f32],
    frames: impl IntoIterator<Item = Result<ScanFrame>>,
) -> Result<()> {
    let folder = folder.as_ref();
    create_folder(folder)?;
    write_common(folder, gender, betas)?;
    for frame in frames {
        let frame = frame?;
        write_frame(folder, &frame).map_err(|error| error.in_frame(frame.id.to_string()))?;
    }
    Ok(())
}

/// Writes what is common to a subject's frames, in its folder, which has to be there.
///
/// # Errors
/// [`Error::Io`].
pub fn write_common(folder: &Path, gender: Gender, betas: &[f32]) -> Result<()> {
    write_atomically(&folder.join(GENDER_FILE), |writer| writeln!(writer, "{gender}"))?;
    let shape = npy_bytes(&Array::from_f32(&[betas.len()], betas.to_vec()));
    write_atomically(&folder.join(SHAPE_FILE), |writer| writer.write_all(&shape))
}

fn write_frame(subject: &Path, frame: &ScanFrame) -> Result<()> {
    let sequence = subject.join(&frame.id.split).join(&frame.id.sequence);
    create_folder(&sequence.join(COLOURED_SCANS))?;
    write_ply(sequence.join(COLOURED_SCANS).join(format!("mesh-f{:05}.ply", frame.id.number)), &frame.scan)?;
    write_parameters(&sequence, frame.id.number, &frame.parameters)
}

/// Writes the registered parameters of a frame in the folder of its sequence.
pub(crate) fn write_parameters(sequence: &Path, number: u32, parameters: &BodyParameters) -> Result<()> {
    create_folder(&sequence.join(PARAMETERS))?;
    write_pickle(parameters_path(sequence, number), &parameter_arrays(parameters.smplx()?)?)
}

fn parameter_arrays(parameters: &smplx::Parameters) -> Result<ArrayMap> {
    let vector = |name: &str, values: &[f32]| (name.to_owned(), Array::from_f32(&[values.len()], values.to_vec()));
    let pose = |name: &str, joints: &[PoseAxisAngle]| vector(name, &components(joints).collect::<Vec<_>>());
    Ok(ArrayMap::from([
        vector("betas", &parameters.betas),
        vector("expression", &parameters.expression),
        vector("transl", &parameters.transl.to_array()),
        pose("global_orient", &[parameters.global_orient]),
        pose("body_pose", &parameters.body_pose),
        pose("jaw_pose", &[parameters.jaw_pose]),
        pose("leye_pose", &[parameters.left_eye_pose]),
        pose("reye_pose", &[parameters.right_eye_pose]),
        pose("left_hand_pose", offsets_from_mean("left_hand_pose", &parameters.left_hand_pose)?),
        pose("right_hand_pose", offsets_from_mean("right_hand_pose", &parameters.right_hand_pose)?),
    ]))
}

fn offsets_from_mean<'a>(name: &str, hand: &'a HandPose) -> Result<&'a [PoseAxisAngle]> {
    let found = match hand {
        HandPose::RelativeToMean(offsets) => return Ok(offsets),
        HandPose::Flat(_) => "a pose relative to the flat hand",
        HandPose::Pca(_) => "a pose in PCA coefficients",
    };
    Err(Error::Value {
        name: name.into(),
        found: found.into(),
        expected: "offsets from the model's mean hand, as X-Humans stores them".into(),
    })
}

pub(crate) fn create_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(Error::io(folder))
}
