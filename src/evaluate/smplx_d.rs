//! The baseline SMPLX+D (thesis 5.3.1): the registered body plus one mean offset a vertex, learned from the training scans.
//!
//! In each training frame, a vertex's offset leads from it to the closest point of the scan; the inverse of its blended bone
//! transform takes it to the rest pose. The means over the frames, blended again, are added to the body of any other frame.
//! V vertices; metres.

use glam::{Mat3A, Vec3};
use rayon::prelude::*;

use crate::body::{BodyModel, Pose, PosedBody};
use crate::data::ScanFrame;
use crate::mesh::{SurfaceIndex, TriangleMesh};
use crate::{Error, InputError, Result};

/// The baseline's name in tables and on the command line's `--baseline`.
pub const SMPLX_D: &str = "SMPLX+D";

/// Where bones turned apart blend to less volume than this, the skin has collapsed and its inverse says nothing.
const SMALLEST_DETERMINANT: f32 = 0.05;

/// A body model with the mean offsets of one subject.
pub struct SmplxD<'a> {
    body: &'a BodyModel,
    /// Mean offsets in the rest pose's frame (V), metres.
    offsets: Vec<Vec3>,
}

impl<'a> SmplxD<'a> {
    /// Learns the offsets from training frames, one at a time in memory.
    ///
    /// # Errors
    /// The first error of `frames`; those of [`BodyModel::pose`] and [`SurfaceIndex::new`], with the frame named.
    /// [`InputError::Value`] if there is no frame.
    pub fn fit(
        body: &'a BodyModel,
        frames: impl IntoIterator<Item = crate::formats::Result<ScanFrame>>,
    ) -> Result<Self> {
        let mut offsets = vec![MeanOffset::default(); body.vertex_count()];
        let mut count = 0_usize;
        for frame in frames {
            let frame = frame?;
            let in_frame = |error: InputError| error.in_frame(frame.id.to_string());
            let posed = body.resolve(&frame.parameters).and_then(|pose| body.pose(&pose)).map_err(in_frame)?;
            let scan = SurfaceIndex::new(&frame.scan).map_err(in_frame)?;
            let blends = blended_transforms(body, &posed);
            offsets.par_iter_mut().zip(&posed.vertices).zip(&blends).for_each(|((offset, &vertex), blend)| {
                if blend.determinant() > SMALLEST_DETERMINANT {
                    offset.add(blend.inverse() * (scan.closest(vertex).position - vertex));
                }
            });
            count += 1;
        }
        if count == 0 {
            return Err(Error::from(InputError::Value {
                name: format!("training frames of {SMPLX_D}"),
                found: "none".into(),
                expected: "at least one".into(),
            }));
        }
        Ok(Self { body, offsets: offsets.iter().map(MeanOffset::value).collect() })
    }

    /// The clothed body in a pose, in the world.
    ///
    /// # Errors
    /// Those of [`BodyModel::pose`].
    pub fn pose(&self, pose: &Pose) -> Result<TriangleMesh> {
        let posed = self.body.pose(pose)?;
        let blends = blended_transforms(self.body, &posed);
        let vertices = posed.vertices.iter().zip(&blends).zip(&self.offsets);
        Ok(self.body.mesh(vertices.map(|((&vertex, &blend), &offset)| vertex + blend * offset).collect()))
    }
}

/// The mean of a vertex's offsets so far.
#[derive(Clone, Copy, Default)]
struct MeanOffset {
    sum: Vec3,
    count: u32,
}

impl MeanOffset {
    fn add(&mut self, offset: Vec3) {
        self.sum += offset;
        self.count += 1;
    }

    /// Zero if there was none: the body itself.
    fn value(&self) -> Vec3 {
        self.sum / self.count.max(1) as f32
    }
}

/// The linear part of the blended transform of each vertex (V).
fn blended_transforms(body: &BodyModel, posed: &PosedBody) -> Vec<Mat3A> {
    let blend = |weights: &[f32]| {
        let bones = posed.bone_transforms.iter().zip(weights);
        bones.fold(Mat3A::ZERO, |sum, (bone, &weight)| sum + bone.matrix3 * weight)
    };
    body.skinning_weights().par_chunks_exact(posed.bone_transforms.len()).map(blend).collect()
}
