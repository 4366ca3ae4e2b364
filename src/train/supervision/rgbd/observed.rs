//! Points that a camera has observed, and where the points of each part are drawn: among them, or on the registered body.

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::body::{Part, PartLabels};
use crate::config::{HandSupervision, RgbdSettings, SamplingSettings, SamplingStrategy};
use crate::mesh::{SurfaceSampler, TriangleMesh};
use crate::train::supervision::faces_of_part;
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
    labels: &PartLabels,
    sampling: &SamplingSettings,
    settings: &RgbdSettings,
) -> Result<Vec<Region>> {
    let places = |wanted: &dyn Fn(usize) -> bool| -> Vec<u32> {
        (0..nearest.len()).filter(|place| wanted(*place)).map(|place| place as u32).collect()
    };
    let SamplingSettings { body_share, face_share, hand_share, .. } = *sampling;
    if sampling.strategy == SamplingStrategy::Uniform {
        let share = body_share + face_share + 2.0 * hand_share;
        return Ok(vec![Region { part: Part::Body, share, source: Source::Observed(places(&|_| true)) }]);
    }
    let of_part = |part: Part| places(&|place| observed.parts[place] == part);
    let eyes_mouth = places(&|place| labels.eyes_mouth[nearest[place]]);
    let mut regions = vec![
        Region { part: Part::Body, share: body_share, source: Source::Observed(of_part(Part::Body)) },
        Region {
            part: Part::Face,
            share: face_share - settings.eyes_mouth_share,
            source: Source::Observed(of_part(Part::Face)),
        },
        Region { part: Part::Face, share: settings.eyes_mouth_share, source: Source::Observed(eyes_mouth) },
    ];
    for part in [Part::LeftHand, Part::RightHand] {
        let source = Source::Observed(of_part(part));
        regions.push(Region { part, share: hand_share, source });
    }
    regions.retain(|region| matches!(&region.source, Source::Observed(places) if places.len() >= FEWEST_POINTS));
    if sampling.hand_supervision == HandSupervision::Registration {
        for region in &mut regions {
            if matches!(region.part, Part::LeftHand | Part::RightHand) {
                let sampler = SurfaceSampler::new(body, Some(&faces_of_part(body, labels, region.part)))?;
                region.source = Source::Registered(sampler, Box::new(observed.of_part(region.part)?));
            }
        }
    }
    Ok(regions)
}
