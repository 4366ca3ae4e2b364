//! How far a mesh is from a scan: chamfer distances, normal consistency and volume overlap, for the body and its parts
//! (thesis 5.1.4).
//!
//! CD is the mean of the two one-sided mean point-to-surface distances, CD-MAX of the two maxima (millimetres); NC is the mean
//! |cos| with the closest face's normal, both directions; IoU that of the volumes, by points uniform in the joint bounding box.
//! The published tables intersect *bounding boxes* and call that IoU: here it is `iou_box`.
//!
//! A surface sample belongs to the part of its nearest registered vertex, and is measured against the whole other surface. Parts
//! are measured by role: a row for the hands, one for the face, as far as the skeleton has them. A part's volume is what lies
//! inside, nearest to that part and within 8 cm of the registration. Parts of one role have a box each: one around both hands
//! would mostly miss them.

use std::collections::BTreeMap;

use glam::Vec3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::overlap::{BoundingBox, Overlap};
use crate::Result;
use crate::body::{Part, Registration, Role, Skeleton};
use crate::mesh::{SolidIndex, SurfaceIndex, SurfacePoint, SurfaceSampler, TriangleMesh};

/// Farther from the registration a volume belongs to no hand and no face, metres.
const PART_REACH: f32 = 0.08;
const MILLIMETRES: f64 = 1000.0;

/// A value for the whole body, and for the parts of each finer role that its skeleton has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parts<T> {
    /// The whole surface.
    pub all: T,
    /// Hands, from the wrist on; face, with head and neck, eyes and mouth.
    #[serde(flatten)]
    pub by_role: BTreeMap<Role, T>,
}

impl<T: Clone + Default> Parts<T> {
    /// The value of a role's parts; that of `Default` for a skeleton without them.
    pub fn of(&self, role: Role) -> T {
        self.by_role.get(&role).cloned().unwrap_or_default()
    }

    /// Another value of each, made of it.
    pub fn map<U>(&self, value: impl Fn(&T) -> U) -> Parts<U> {
        let by_role = self.by_role.iter().map(|(role, own)| (*role, value(own))).collect();
        Parts { all: value(&self.all), by_role }
    }
}

/// The metrics of one frame. A part is absent where it cannot be measured: one of the surfaces has no sample of it, or no point
/// drawn is inside either. That is no score, neither a good nor a bad one.
pub type FrameMetrics = Parts<Option<PartMetrics>>;

/// How well one part agrees with the scan. All values are finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartMetrics {
    /// Chamfer distance, millimetres.
    pub cd_mm: f64,
    /// The mean of the two largest distances, millimetres.
    pub cd_max_mm: f64,
    /// Normal consistency in [0, 1].
    pub nc: f64,
    /// Intersection over union of the volumes.
    pub iou: f64,
    /// Intersection over union of the bounding boxes; of several parts the mean.
    pub iou_box: f64,
}

/// Compares a prediction with a scan; both and the registration, of a body with this skeleton, share one coordinate system.
/// `samples` points are drawn on each surface and in each box.
///
/// # Errors
/// [`InputError::Value`](crate::InputError::Value) if a mesh has no area or fails [`TriangleMesh::check`].
pub fn compare(
    prediction: &TriangleMesh,
    scan: &TriangleMesh,
    registration: &Registration,
    skeleton: &Skeleton,
    samples: usize,
    random: &mut ChaCha8Rng,
) -> Result<FrameMetrics> {
    let meshes = [prediction, scan];
    let solids = [SolidIndex::new(prediction)?, SolidIndex::new(scan)?];
    let measurements = [
        measure(prediction, scan, solids[1].surface(), registration, samples, random)?,
        measure(scan, prediction, solids[0].surface(), registration, samples, random)?,
    ];
    let mut part = |parts: &[Part]| {
        let boxes = parts
            .iter()
            .map(|part| both(&measurements, |side| bounds_of_part(side, *part)))
            .collect::<Option<Vec<_>>>()?;
        let overlaps = parts.iter().zip(&boxes).map(|(&part, &[a, b])| {
            a.joined(b).sampled_overlap(samples, random, |point| {
                let (nearest, distance) = registration.nearest(point);
                if nearest != part || distance > PART_REACH {
                    return [false; 2];
                }
                [solids[0].is_inside(point), solids[1].is_inside(point)]
            })
        });
        let overlap = overlaps.fold(Overlap::default(), |sum, overlap| sum + overlap);
        summarise(&measurements, |part| parts.contains(&part), overlap, &boxes)
    };
    let roles = Role::FINE.map(|role| (role, skeleton.parts_of(role).collect::<Vec<_>>()));
    let present = roles.iter().filter(|(_, parts)| !parts.is_empty());
    let by_role = present.map(|(role, parts)| (*role, part(parts))).collect();
    let all = both(&meshes, |mesh| bounds_of_surface(mesh)).and_then(|[a, b]| {
        let overlap = a
            .joined(b)
            .sampled_overlap(samples, random, |point| [solids[0].is_inside(point), solids[1].is_inside(point)]);
        summarise(&measurements, |_| true, overlap, &[[a, b]])
    });
    Ok(Parts { all, by_role })
}

/// What a sample of one surface says about the other.
struct Measurement {
    point: Vec3,
    part: Part,
    /// To the other surface, metres.
    distance: f32,
    /// |cos| between the two surfaces' normals.
    cosine: f32,
}

fn measure(
    from: &TriangleMesh,
    to: &TriangleMesh,
    index: &SurfaceIndex,
    registration: &Registration,
    samples: usize,
    random: &mut ChaCha8Rng,
) -> Result<Vec<Measurement>> {
    let sampler = SurfaceSampler::new(from, None)?;
    let drawn: Vec<SurfacePoint> = (0..samples).map(|_| sampler.sample(random)).collect();
    let measure = |sample: &SurfacePoint| {
        let point = from.position_at(sample);
        let closest = index.closest(point);
        // A face without area has the normal zero, which agrees with nothing.
        let cosine = from.face_normal(sample.face).dot(to.face_normal(closest.face)).abs();
        Measurement { point, part: registration.nearest(point).0, distance: closest.distance, cosine }
    };
    Ok(drawn.par_iter().map(measure).collect())
}

/// The metrics of the samples that `belongs` accepts.
fn summarise(
    measurements: &[Vec<Measurement>; 2],
    belongs: impl Fn(Part) -> bool,
    overlap: Overlap,
    boxes: &[[BoundingBox; 2]],
) -> Option<PartMetrics> {
    let [a, b] = both(measurements, |side| {
        let own = side.iter().filter(|sample| belongs(sample.part));
        OneSided::of(own.map(|sample| (sample.distance, sample.cosine)))
    })?;
    let box_ratios: f64 = boxes.iter().map(|[a, b]| a.overlap(*b).ratio()).sum::<Option<f64>>()?;
    Some(PartMetrics {
        cd_mm: (a.mean + b.mean) / 2.0 * MILLIMETRES,
        cd_max_mm: (a.maximum + b.maximum) / 2.0 * MILLIMETRES,
        nc: (a.cosine + b.cosine) / 2.0,
        iou: overlap.ratio()?,
        iou_box: box_ratios / boxes.len() as f64,
    })
}

/// What some samples of one surface sum up to.
pub(super) struct OneSided {
    /// How many they are.
    pub count: u32,
    /// Mean distance, metres.
    pub mean: f64,
    /// Largest distance, metres.
    pub maximum: f64,
    /// Mean |cos|.
    pub cosine: f64,
}

impl OneSided {
    /// Of their distances and |cos|; none of no sample.
    pub fn of(samples: impl Iterator<Item = (f32, f32)>) -> Option<Self> {
        let (mut count, mut distances, mut maximum, mut cosines) = (0_u32, 0.0, 0.0_f64, 0.0);
        for (distance, cosine) in samples {
            count += 1;
            distances += f64::from(distance);
            maximum = maximum.max(f64::from(distance));
            cosines += f64::from(cosine);
        }
        let total = f64::from(count);
        (count > 0).then(|| Self { count, mean: distances / total, maximum, cosine: cosines / total })
    }
}

fn both<T, U>(pair: &[T; 2], value: impl Fn(&T) -> Option<U>) -> Option<[U; 2]> {
    Some([value(&pair[0])?, value(&pair[1])?])
}

fn bounds_of_part(measurements: &[Measurement], part: Part) -> Option<BoundingBox> {
    BoundingBox::around(measurements.iter().filter(|sample| sample.part == part).map(|sample| sample.point))
}

fn bounds_of_surface(mesh: &TriangleMesh) -> Option<BoundingBox> {
    BoundingBox::around(mesh.faces.iter().flatten().map(|&vertex| mesh.vertices[vertex as usize]))
}
