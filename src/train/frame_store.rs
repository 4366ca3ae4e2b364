//! The training frames of a run: checked and stored once under the run's `cache/`, then streamed.
//!
//! Each frame is one npz of scan and registration, whatever format it came in. Prepared frames stay in memory up to a limit;
//! beyond it the longest unused one makes room, so a subject of any length trains in bounded memory.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::RgbImage;

use super::prepared::PreparedFrame;
use super::{Event, Observer};
use crate::body::{BodyModel, BodyParameters, HandPose, PartLabels, PoseAxisAngle};
use crate::config::Config;
use crate::data::{Array, ArrayData, ArrayMap, FrameId, FrameSource, ScanFrame, read_npz, write_npz};
use crate::mesh::{Colouring, TriangleMesh};
use crate::{Error, Result};

const FOLDER: &str = "cache";
/// Prepared frames in memory are kept below this.
const MEMORY_LIMIT: usize = 1 << 30;
/// What a prepared face and vertex take, with their hierarchies.
const BYTES_A_FACE: usize = 200;

pub(super) struct FrameStore<'a> {
    body: &'a BodyModel,
    labels: &'a PartLabels,
    config: &'a Config,
    files: Vec<PathBuf>,
    ids: Vec<FrameId>,
    /// Most recently used last.
    loaded: VecDeque<(usize, Arc<PreparedFrame<'a>>)>,
}

impl<'a> FrameStore<'a> {
    /// Stores every frame of `frames` under `run`, or continues where an earlier command stopped.
    pub fn open(
        config: &'a Config,
        frames: &dyn FrameSource,
        body: &'a BodyModel,
        labels: &'a PartLabels,
        run: &Path,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
        let mut store = Self { body, labels, config, files: Vec::new(), ids: Vec::new(), loaded: VecDeque::new() };
        let total = frames.ids().len();
        for (index, id) in frames.ids().iter().enumerate() {
            observer.event(Event::Preparing { done: index, total });
            let path = folder.join(format!("{}.npz", id.to_string().replace('/', "_")));
            if !path.is_file() {
                match frames.read(index).and_then(|frame| store.check(frame)) {
                    Ok(frame) => write_npz(&path, &to_arrays(&frame))?,
                    Err(error) if config.skip_bad_frames => {
                        observer.event(Event::Warning { message: format!("left out: {error}") });
                        continue;
                    }
                    Err(error) => return Err(error),
                }
            }
            store.files.push(path);
            store.ids.push(id.clone());
        }
        observer.event(Event::Preparing { done: total, total });
        if store.ids.is_empty() {
            return Err(Error::Missing {
                path: run.into(),
                what: "a usable training frame".into(),
                remedy: "run `xavatar check` on the data".into(),
            });
        }
        Ok(store)
    }

    /// A frame that can be prepared can be trained on.
    fn check(&self, frame: ScanFrame) -> Result<ScanFrame> {
        PreparedFrame::new(frame.clone(), self.body, self.labels, &self.config.sampling)?;
        Ok(frame)
    }

    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// The scan and registration of a frame.
    pub fn read(&self, index: usize) -> Result<ScanFrame> {
        let id = self.ids[index].clone();
        from_arrays(id.clone(), &self.files[index], &read_npz(&self.files[index])?)
            .map_err(|error| error.in_frame(id.to_string()))
    }

    /// A prepared frame, from memory if it is there.
    pub fn prepared(&mut self, index: usize) -> Result<Arc<PreparedFrame<'a>>> {
        if let Some(place) = self.loaded.iter().position(|(loaded, _)| *loaded == index)
            && let Some(entry) = self.loaded.remove(place)
        {
            let frame = entry.1.clone();
            self.loaded.push_back(entry);
            return Ok(frame);
        }
        let frame = PreparedFrame::new(self.read(index)?, self.body, self.labels, &self.config.sampling)?;
        let frame = Arc::new(frame);
        self.loaded.push_back((index, frame.clone()));
        let size = |frame: &PreparedFrame| BYTES_A_FACE * (frame.scan.mesh.faces.len() + frame.body.mesh.faces.len());
        let mut held: usize = self.loaded.iter().map(|(_, frame)| size(frame)).sum();
        while held > MEMORY_LIMIT && self.loaded.len() > 1 {
            held -= self.loaded.pop_front().map_or(0, |(_, frame)| size(&frame));
        }
        Ok(frame)
    }
}

fn rows(values: impl IntoIterator<Item = Vec3>) -> Array {
    let flat: Vec<f32> = values.into_iter().flat_map(|value| value.to_array()).collect();
    Array::from_f32(&[flat.len() / 3, 3], flat)
}

/// Everything a [`ScanFrame`] holds, as arrays; absent ones for what it does not have.
fn to_arrays(frame: &ScanFrame) -> ArrayMap {
    let ScanFrame { scan, parameters, .. } = frame;
    let faces = scan.faces.iter().flatten().map(|index| i64::from(*index)).collect();
    let mut arrays = ArrayMap::from([
        ("vertices".to_owned(), rows(scan.vertices.iter().copied())),
        ("faces".to_owned(), Array { shape: vec![scan.faces.len(), 3], data: ArrayData::I64(faces) }),
        ("transl".to_owned(), rows([parameters.transl])),
        ("betas".to_owned(), Array::from_f32(&[10], parameters.betas.to_vec())),
        ("expression".to_owned(), Array::from_f32(&[10], parameters.expression.to_vec())),
    ]);
    let joints = [parameters.global_orient].into_iter().chain(parameters.body_pose).chain([
        parameters.jaw_pose,
        parameters.left_eye_pose,
        parameters.right_eye_pose,
    ]);
    arrays.insert("joints".to_owned(), rows(joints.map(|joint| joint.0)));
    for (name, hand) in [("left", &parameters.left_hand_pose), ("right", &parameters.right_hand_pose)] {
        let (convention, values) = match hand {
            HandPose::Flat(joints) => ("flat", rows(joints.map(|joint| joint.0))),
            HandPose::RelativeToMean(joints) => ("relative_to_mean", rows(joints.map(|joint| joint.0))),
            HandPose::Pca(coefficients) => ("pca", Array::from_f32(&[coefficients.len()], coefficients.clone())),
        };
        arrays.insert(format!("{name}_hand.{convention}"), values);
    }
    if let Some(normals) = &scan.normals {
        arrays.insert("normals".to_owned(), rows(normals.iter().copied()));
    }
    match &scan.colouring {
        Colouring::None => {}
        Colouring::Vertex(colours) => {
            let data = ArrayData::U8(colours.as_flattened().to_vec());
            arrays.insert("colours".to_owned(), Array { shape: vec![colours.len(), 3], data });
        }
        Colouring::Texture { uvs, image } => {
            let flat = uvs.iter().flat_map(|uv| uv.to_array()).collect();
            arrays.insert("uvs".to_owned(), Array::from_f32(&[uvs.len(), 2], flat));
            let shape = vec![image.height() as usize, image.width() as usize, 3];
            arrays.insert("atlas".to_owned(), Array { shape, data: ArrayData::U8(image.as_raw().clone()) });
        }
    }
    arrays
}

fn from_arrays(id: FrameId, path: &Path, arrays: &ArrayMap) -> Result<ScanFrame> {
    let broken = |key: &str| Error::Malformed {
        path: path.into(),
        format: "cached frame",
        place: format!("`{key}`"),
        found: arrays.get(key).map_or("absent".into(), Array::description),
        expected: "what the frame was stored with; delete the run's cache folder and resume".into(),
    };
    let floats = |key: &str| arrays.get(key).and_then(Array::to_f32).ok_or_else(|| broken(key));
    let triples = |key: &str| -> Result<Vec<Vec3>> {
        Ok(floats(key)?.as_chunks().0.iter().copied().map(Vec3::from_array).collect())
    };
    let ten = |key: &str| <[f32; 10]>::try_from(floats(key)?).map_err(|_| broken(key));
    let vertices = triples("vertices")?;
    let faces =
        arrays.get("faces").and_then(|faces| faces.to_indices(vertices.len())).ok_or_else(|| broken("faces"))?;
    let bytes = |key: &str| match arrays.get(key).map(|array| &array.data) {
        Some(ArrayData::U8(bytes)) => Ok(bytes.clone()),
        _ => Err(broken(key)),
    };
    let colouring = if let Some(atlas) = arrays.get("atlas") {
        let [height, width, 3] = atlas.shape[..] else { return Err(broken("atlas")) };
        let image = RgbImage::from_raw(width as u32, height as u32, bytes("atlas")?).ok_or_else(|| broken("atlas"))?;
        let uvs = floats("uvs")?.as_chunks().0.iter().copied().map(Vec2::from_array).collect();
        Colouring::Texture { uvs, image: Arc::new(image) }
    } else if arrays.contains_key("colours") {
        Colouring::Vertex(bytes("colours")?.as_chunks().0.to_vec())
    } else {
        Colouring::None
    };
    let normals = arrays.contains_key("normals").then(|| triples("normals")).transpose()?;
    let scan = TriangleMesh { vertices, faces: faces.as_chunks().0.to_vec(), normals, colouring };
    scan.check()?;

    let joints: Vec<PoseAxisAngle> = triples("joints")?.into_iter().map(PoseAxisAngle).collect();
    let [global_orient, body_pose @ .., jaw_pose, left_eye_pose, right_eye_pose] = joints.as_slice() else {
        return Err(broken("joints"));
    };
    let hand = |side: &str| -> Result<HandPose> {
        let axis_angles = |key: &str| -> Result<[PoseAxisAngle; 15]> {
            let joints: Vec<PoseAxisAngle> = triples(key)?.into_iter().map(PoseAxisAngle).collect();
            joints.try_into().map_err(|_| broken(key))
        };
        let [flat, relative, pca] = ["flat", "relative_to_mean", "pca"].map(|kind| format!("{side}_hand.{kind}"));
        if arrays.contains_key(&flat) {
            Ok(HandPose::Flat(axis_angles(&flat)?))
        } else if arrays.contains_key(&relative) {
            Ok(HandPose::RelativeToMean(axis_angles(&relative)?))
        } else {
            Ok(HandPose::Pca(floats(&pca)?))
        }
    };
    let parameters = BodyParameters {
        betas: ten("betas")?,
        expression: ten("expression")?,
        global_orient: *global_orient,
        body_pose: body_pose.try_into().map_err(|_| broken("joints"))?,
        jaw_pose: *jaw_pose,
        left_eye_pose: *left_eye_pose,
        right_eye_pose: *right_eye_pose,
        left_hand_pose: hand("left")?,
        right_hand_pose: hand("right")?,
        transl: triples("transl")?.first().copied().ok_or_else(|| broken("transl"))?,
    };
    Ok(ScanFrame { id, scan, parameters })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_frame_is_the_frame() {
        let image = RgbImage::from_fn(4, 3, |x, y| image::Rgb([x as u8, y as u8, 7]));
        let scan = TriangleMesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            faces: vec![[0, 1, 2]],
            normals: Some(vec![Vec3::Z; 3]),
            colouring: Colouring::Texture { uvs: vec![Vec2::new(0.25, 0.5); 3], image: Arc::new(image) },
        };
        let mut parameters = BodyParameters { transl: Vec3::new(1.0, 2.0, 3.0), ..BodyParameters::default() };
        parameters.body_pose[20].0 = Vec3::new(0.1, 0.2, 0.3);
        parameters.right_eye_pose.0.x = -0.5;
        parameters.left_hand_pose = HandPose::Pca(vec![0.5; 6]);
        parameters.right_hand_pose = HandPose::RelativeToMean([PoseAxisAngle(Vec3::Y); 15]);
        let id = FrameId { split: "train".into(), sequence: "Take1".into(), number: 7 };
        let frame = ScanFrame { id: id.clone(), scan, parameters };

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.npz");
        write_npz(&path, &to_arrays(&frame)).unwrap();
        let read = from_arrays(id, &path, &read_npz(&path).unwrap()).unwrap();
        assert_eq!(format!("{read:?}"), format!("{frame:?}"));
    }
}
