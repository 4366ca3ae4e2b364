//! Part-aware sampling of one picture of an RGB-D camera (thesis ch. 4.4, METHOD section 5).
//!
//! P_on: observed points of each part. P_off, which the thesis does not have: the same points moved by normal noise, as far as
//! the picture knows their signed distance. Free points: those of them, and points along the rays, that the camera looks through.

use glam::{Vec2, Vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::camera_view::{CameraView, Drawn, Knowledge};
use super::sampling::PosedSamples;
use crate::config::{Config, SamplingStrategy};

/// How far before what is seen free points are drawn, metres.
const FREE_REACH: f32 = 0.3;

struct OnSurface {
    position: Vec3,
    normal: Vec3,
    colour: Vec3,
    label: u8,
    is_registered: bool,
    off: Vec3,
}

/// Draws a picture's points.
pub(super) fn draw(view: &CameraView, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
    let (sampling, truncation) = (&config.sampling, config.losses.truncation as f32);
    let mut drawn = Vec::new();
    for region in &view.regions {
        for _ in 0..(region.share * sampling.points as f64).round() as usize {
            let (position, normal, colour, is_registered) = match &region.drawn {
                Drawn::Observed(places) => {
                    let place = places[random.random_range(0..places.len())] as usize;
                    let observed = &view.observed;
                    (observed.points[place], observed.normals[place], observed.colours[place], false)
                }
                Drawn::Registered(sampler, seen) => {
                    let place = sampler.sample(random);
                    let position = view.body.mesh.position_at(&place);
                    let colour = seen.colours[seen.nearest(position)];
                    (position, view.body.mesh.normal_at(&place), colour, true)
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
            drawn.push(OnSurface { position, normal, colour, label: part.0, is_registered, off });
        }
    }
    let mut samples = PosedSamples::default();
    for sample in &drawn {
        samples.on_points.push(sample.position.to_array());
        samples.on_normals.push(sample.normal.to_array());
        samples.on_colours.push(sample.colour.to_array());
        samples.on_labels.push(sample.label);
    }
    let Some(settings) = &config.rgbd else { return samples };
    let free_space = config.losses.free_space > 0.0;
    if settings.off_surface {
        let known: Vec<_> = drawn
            .par_iter()
            .map(|sample| match sample.is_registered {
                true => Knowledge::Distance(view.body.solid.signed_distance(sample.off).0),
                false => view.knowledge(sample.off),
            })
            .collect();
        for (sample, known) in drawn.iter().zip(known) {
            match known {
                Knowledge::Distance(distance) => {
                    samples.off_points.push(sample.off.to_array());
                    samples.off_targets.push(distance);
                    samples.off_labels.push(sample.label);
                }
                Knowledge::Outside(bound) if free_space => {
                    add_free(&mut samples, sample.off, sample.label, bound, truncation);
                }
                _ => {}
            }
        }
    }
    if free_space {
        let air: Vec<Vec3> = (0..settings.free_points).filter_map(|_| point_on_ray(view, random)).collect();
        let known: Vec<_> = air.par_iter().map(|point| (view.knowledge(*point), view.part(*point).0)).collect();
        for (point, (known, label)) in air.into_iter().zip(known) {
            if let Knowledge::Outside(bound) | Knowledge::Distance(bound) = known {
                add_free(&mut samples, point, label, bound, truncation);
            }
        }
    }
    samples
}

fn add_free(samples: &mut PosedSamples, point: Vec3, label: u8, bound: f32, truncation: f32) {
    samples.free_points.push(point.to_array());
    samples.free_bounds.push([0.0, if bound < truncation { bound.max(0.0) } else { f32::INFINITY }]);
    samples.free_labels.push(label);
}

/// A point on the ray of a random pixel: up to [`FREE_REACH`] before the subject, or on a ray past it, as far as the body.
fn point_on_ray(view: &CameraView, random: &mut ChaCha8Rng) -> Option<Vec3> {
    let camera = &view.camera;
    let pixel = [random.random_range(0..camera.width), random.random_range(0..camera.height)];
    let depth = match view.surface_depth(pixel) {
        Some(surface) => surface - FREE_REACH * random.random::<f32>(),
        None => {
            let anywhere = view.observed.points[random.random_range(0..view.observed.points.len())];
            camera.to_camera(anywhere).z + FREE_REACH * random.random_range(-1.0..1.0)
        }
    };
    let place = Vec2::from(pixel.map(|pixel| pixel as f32)) + Vec2::from(random.random::<[f32; 2]>());
    // What is not free after all is left out with everything else that is not known.
    (depth > 0.0).then(|| camera.back_project(place, depth))
}
