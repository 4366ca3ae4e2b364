//! Part-aware sampling of one picture of an RGB-D camera (thesis ch. 4.4, METHOD section 5).
//!
//! P_on: observed points of each part. P_off, which the thesis does not have: the same points moved by normal noise, as far as
//! the picture knows their signed distance.

use glam::Vec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::CameraView;
use super::observed::Source;
use crate::config::{Config, SamplingStrategy};
use crate::mesh::SurfacePoint;
use crate::train::drawn::{Origin, PosedSamples, UNKNOWN_DEPTH};

struct OnSurface {
    position: Vec3,
    normal: Vec3,
    colour: Vec3,
    label: u8,
    /// Where it is on the registered body, if it is drawn there.
    registered: Option<SurfacePoint>,
    off: Vec3,
}

impl OnSurface {
    /// Where it comes from, and a point that was `moved` so far from it, metres.
    fn origin(&self, view: &CameraView, moved: f32) -> Origin {
        let place = self.registered.as_ref();
        place.map_or(Origin::Depth(UNKNOWN_DEPTH), |place| view.canonical.origin(&view.body.mesh, place, moved))
    }
}

/// Draws a picture's points.
pub(super) fn draw(view: &CameraView, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
    let sampling = &config.sampling;
    let mut drawn = Vec::new();
    for region in &view.regions {
        for _ in 0..(region.share * sampling.points as f64).round() as usize {
            let (position, normal, colour, registered) = match &region.source {
                Source::Observed(places) => {
                    let place = places[random.random_range(0..places.len())] as usize;
                    let observed = &view.observed;
                    (observed.points[place], observed.normals[place], observed.colours[place], None)
                }
                Source::Registered(sampler, seen) => {
                    let place = sampler.sample(random);
                    let position = view.body.mesh.position_at(&place);
                    let colour = seen.colours[seen.nearest(position)];
                    (position, view.body.mesh.normal_at(&place), colour, Some(place))
                }
            };
            let part = match sampling.strategy {
                SamplingStrategy::PartAware => region.part,
                SamplingStrategy::Uniform => view.part(position),
            };
            let wide = random.random::<f32>() < sampling.wide_share;
            let deviation = if wide { sampling.wide_deviation } else { sampling.deviation };
            let noise = Vec3::from_array(std::array::from_fn(|_| random.sample(StandardNormal)));
            let off = position + deviation * noise;
            drawn.push(OnSurface { position, normal, colour, label: part.0, registered, off });
        }
    }
    let mut samples = PosedSamples::default();
    for sample in &drawn {
        samples.on_points.push(sample.position.to_array());
        samples.on_normals.push(sample.normal.to_array());
        samples.on_colours.push(sample.colour.to_array());
        samples.on_labels.push(sample.label);
        samples.on_origins.push(sample.origin(view, 0.0));
    }
    let Some(settings) = &config.rgbd else { return samples };
    if settings.off_surface {
        let known: Vec<_> = drawn
            .par_iter()
            .map(|sample| match sample.registered.is_some() {
                true => Some(view.body.solid.signed_distance(sample.off).0),
                false => view.distance(sample.off),
            })
            .collect();
        for (sample, known) in drawn.iter().zip(known) {
            if let Some(distance) = known {
                samples.off_points.push(sample.off.to_array());
                samples.off_targets.push(distance);
                samples.off_labels.push(sample.label);
                samples.off_origins.push(sample.origin(view, sample.off.distance(sample.position)));
            }
        }
    }
    samples
}
