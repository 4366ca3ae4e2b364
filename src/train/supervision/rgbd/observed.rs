//! Points that a camera has observed, and where the points of each part are drawn: among them, or on the registered body.

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::body::{Part, PartLabels, Role, Skeleton};
use crate::config::{HandSupervision, RgbdSettings, SamplingSettings, SamplingStrategy};
use crate::mesh::{SurfaceSampler, TriangleMesh};
use crate::train::supervision::faces_of_part;
use crate::train::supervision::part_shares::{PartShare, part_shares, whole_share};
use crate::{Error, InputError, Result};

/// Points that a part needs to count as seen.
const FEWEST_POINTS: usize = 40;

/// Observed points, and which is nearest.
pub(super) struct ObservedPoints {
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// In [0, 1].
    pub colours: Vec<Vec3>,
    pub parts: Vec<Part>,
    tree: ImmutableKdTree<f32, 3>,
}

impl ObservedPoints {
    pub fn new(points: Vec<Vec3>, normals: Vec<Vec3>, colours: Vec<Vec3>, parts: Vec<Part>) -> Result<Self> {
        let rows: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
        let tree = ImmutableKdTree::new_from_slice(&rows).map_err(|failure| {
            Error::from(InputError::Value {
                name: "observed points".into(),
                found: format!("{} ({failure})", points.len()),
                expected: "at most 2^32".into(),
            })
        })?;
        Ok(Self { points, normals, colours, parts, tree })
    }

    /// The points of one part.
    fn of_part(&self, part: Part) -> Result<Self> {
        let wanted: Vec<usize> = (0..self.points.len()).filter(|index| self.parts[*index] == part).collect();
        let of = |values: &[Vec3]| wanted.iter().map(|index| values[*index]).collect();
        Self::new(of(&self.points), of(&self.normals), of(&self.colours), vec![part; wanted.len()])
    }

    /// The place in the list of the point nearest to `point`, which has to be finite.
    pub fn nearest(&self, point: Vec3) -> usize {
        self.tree.query(&point.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute().item as usize
    }
}

/// Where a region's points are drawn.
pub(super) enum Source {
    /// Observed points, by their places.
    Observed(Vec<u32>),
    /// The registered body's surface, with the colour of the nearest of these points.
    Registered(SurfaceSampler, Box<ObservedPoints>),
}

/// A part of the surface and its share of P.
pub(super) struct Region {
    pub part: Part,
    pub share: f64,
    pub source: Source,
}

/// The parts' shares of P (METHOD section 5). What the camera does not see contributes nothing.
pub(super) fn regions(
    observed: &ObservedPoints,
    nearest: &[usize],
    body: &TriangleMesh,
    skeleton: &Skeleton,
    labels: &PartLabels,
    sampling: &SamplingSettings,
    settings: &RgbdSettings,
) -> Result<Vec<Region>> {
    let places = |wanted: &dyn Fn(usize) -> bool| -> Vec<u32> {
        (0..nearest.len()).filter(|place| wanted(*place)).map(|place| place as u32).collect()
    };
    if sampling.strategy == SamplingStrategy::Uniform {
        let (part, share) = (Part::default(), whole_share(sampling));
        return Ok(vec![Region { part, share, source: Source::Observed(places(&|_| true)) }]);
    }
    let region = |of: PartShare| {
        let is_shown =
            |place: usize| observed.parts[place] == of.part && (!of.is_detail || labels.detail[nearest[place]]);
        Region { part: of.part, share: of.share, source: Source::Observed(places(&is_shown)) }
    };
    let shares = part_shares(skeleton, sampling, |_| settings.eyes_mouth_share);
    let mut regions: Vec<Region> = shares.into_iter().map(region).collect();
    regions.retain(|region| matches!(&region.source, Source::Observed(places) if places.len() >= FEWEST_POINTS));
    if sampling.hand_supervision == HandSupervision::Registration {
        for region in &mut regions {
            if skeleton.role(region.part) == Role::Hands {
                let sampler = SurfaceSampler::new(body, Some(&faces_of_part(body, labels, region.part)))?;
                region.source = Source::Registered(sampler, Box::new(observed.of_part(region.part)?));
            }
        }
    }
    Ok(regions)
}
