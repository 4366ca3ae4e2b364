//! How far a mesh is from a scan, region by region: feet, legs, torso, arms, head, hands, face, and what is off the body.
//!
//! Each surface sample counts in one region: that of its nearest registered vertex or, farther than 3 cm from the registered
//! surface, off the body. It is measured against the whole other surface, as the parts' samples are. A region that only one of the
//! surfaces has is measured from that one: a braid that an avatar lacks is an error, not a gap in the table.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::metrics::OneSided;
use crate::Result;
use crate::body::{Region, Registration};
use crate::mesh::{SurfaceIndex, SurfacePoint, SurfaceSampler, TriangleMesh};

/// Farther from the registered surface a sample is off the body, metres.
const ON_BODY: f32 = 0.03;

/// How well one region agrees with the scan. All values are finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionMetrics {
    /// Chamfer distance, millimetres.
    pub cd_mm: f64,
    /// The mean of the two largest distances, millimetres.
    pub cd_max_mm: f64,
    /// Normal consistency in [0, 1].
    pub nc: f64,
    /// The region's share of the scan's surface.
    pub share: f64,
}

/// The metrics of the regions that either surface has.
pub type Regions = BTreeMap<Region, RegionMetrics>;

/// Tells samples' regions: a frame's registered body.
pub struct RegisteredRegions<'a> {
    registration: &'a Registration<'a>,
    /// Of the same body.
    surface: SurfaceIndex,
    of_vertices: &'a [Region],
}

impl<'a> RegisteredRegions<'a> {
    /// Of a body with `of_vertices` (V), registered as the mesh `posed` whose vertices (V) `registration` holds.
    ///
    /// # Errors
    /// [`InputError::Value`](crate::InputError::Value) if the body has no surface.
    pub fn new(registration: &'a Registration<'a>, posed: &TriangleMesh, of_vertices: &'a [Region]) -> Result<Self> {
        Ok(Self { registration, surface: SurfaceIndex::new(posed)?, of_vertices })
    }

    fn region(&self, point: glam::Vec3) -> Region {
        match self.surface.closest(point).distance {
            distance if distance > ON_BODY => Region::OffBody,
            _ => self.of_vertices[self.registration.nearest_vertex(point)],
        }
    }
}

/// Compares a prediction with a scan by region; all share one coordinate system. `samples` points are drawn on each surface.
///
/// # Errors
/// [`InputError::Value`](crate::InputError::Value) if a mesh has no area or fails [`TriangleMesh::check`].
pub fn compare_regions(
    prediction: &TriangleMesh,
    scan: &TriangleMesh,
    registered: &RegisteredRegions,
    samples: usize,
    random: &mut ChaCha8Rng,
) -> Result<Regions> {
    let measured = [
        by_region(prediction, scan, registered, samples, random)?,
        by_region(scan, prediction, registered, samples, random)?,
    ];
    let [of_prediction, of_scan] = &measured;
    let metrics = |region: Region| {
        let sides = [of_prediction.get(&region), of_scan.get(&region)];
        let share = sides[1].map_or(0.0, |side| f64::from(side.count) / samples as f64);
        let present: Vec<&OneSided> = sides.into_iter().flatten().collect();
        let mean =
            |value: fn(&OneSided) -> f64| present.iter().map(|side| value(side)).sum::<f64>() / present.len() as f64;
        let metrics = RegionMetrics {
            cd_mm: mean(|side| side.mean) * 1000.0,
            cd_max_mm: mean(|side| side.maximum) * 1000.0,
            nc: mean(|side| side.cosine),
            share,
        };
        (!present.is_empty()).then_some((region, metrics))
    };
    Ok(Region::ALL.into_iter().filter_map(metrics).collect())
}

/// What the samples of one surface sum up to in each region that they are in.
fn by_region(
    from: &TriangleMesh,
    to: &TriangleMesh,
    registered: &RegisteredRegions,
    samples: usize,
    random: &mut ChaCha8Rng,
) -> Result<BTreeMap<Region, OneSided>> {
    let (sampler, index) = (SurfaceSampler::new(from, None)?, SurfaceIndex::new(to)?);
    let drawn: Vec<SurfacePoint> = (0..samples).map(|_| sampler.sample(random)).collect();
    let measure = |sample: &SurfacePoint| {
        let point = from.position_at(sample);
        let closest = index.closest(point);
        let cosine = from.face_normal(sample.face).dot(to.face_normal(closest.face)).abs();
        (registered.region(point), closest.distance, cosine)
    };
    let measured: Vec<_> = drawn.par_iter().map(measure).collect();
    let of_region = |region: Region| {
        let own = measured.iter().filter(|(of, ..)| *of == region);
        Some((region, OneSided::of(own.map(|(_, distance, cosine)| (*distance, *cosine)))?))
    };
    Ok(Region::ALL.into_iter().filter_map(of_region).collect())
}

impl RegionMetrics {
    /// The means over frames of each region, over those frames that have it.
    pub(super) fn means<'a>(frames: impl Iterator<Item = &'a Regions>) -> Regions {
        let mut by_region: BTreeMap<Region, Vec<Self>> = BTreeMap::new();
        for (region, metrics) in frames.flatten() {
            by_region.entry(*region).or_default().push(*metrics);
        }
        let mean = |(region, frames): (Region, Vec<Self>)| {
            let of = |value: fn(&Self) -> f64| frames.iter().map(value).sum::<f64>() / frames.len() as f64;
            let metrics = Self {
                cd_mm: of(|metrics| metrics.cd_mm),
                cd_max_mm: of(|metrics| metrics.cd_max_mm),
                nc: of(|metrics| metrics.nc),
                share: of(|metrics| metrics.share),
            };
            (region, metrics)
        };
        by_region.into_iter().map(mean).collect()
    }
}
