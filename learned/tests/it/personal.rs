//! A personal body of one scan, beside the body that it was made from.

use glam::DVec3;
use xavatar_body::{BodyModel, Coefficients};
use xavatar_learned::core::{Fitted, FittedBody, PoseFit};
use xavatar_learned::personal::personal;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;

use super::tube::{tube, written};

/// The mean distance of a vertex to registrations, of a body whose pose alone is fitted.
fn distance(model: &BodyModel, shape: &[f64], frames: &[Vec<DVec3>]) -> f64 {
    let body = FittedBody::of(model);
    let of_frame = |frame: &Vec<DVec3>| {
        let fit = PoseFit { shape: false, expression: false };
        let first = PoseFit { shape: true, expression: false }.nearest(&body, frame, None);
        let found = fit.nearest(&body, frame, Some(Fitted { pose: first.pose, shape: shape.to_vec() }));
        let (posed, _) = body.posed(&found.pose, &found.shape);
        posed.positions.iter().zip(frame).map(|(own, target)| own.distance(*target)).sum::<f64>() / frame.len() as f64
    };
    frames.iter().map(of_frame).sum::<f64>() / frames.len() as f64
}

#[test]
fn one_scan_makes_the_body_the_persons_and_leaves_the_rest_unsure() {
    let population = Population { subjects: 1, poses: 9, effect: 6e-3, ..Population::default() };
    let folder = tempfile::tempdir().unwrap();
    let mut truth = population.truth(&tube()).unwrap();
    // A person such as no coefficients make: a belly.
    for place in truth.subjects[0].template.iter_mut().filter(|place| place.z > 0.0) {
        place.z += 0.05 * (-(20.0 * (place.y - 0.4).powi(2))).exp();
    }
    written(&truth, &population, folder.path().into(), 0..1);
    let all = Registrations::find(&[folder.path().into()], truth.model.vertex_count()).unwrap();
    let frames: Vec<Vec<DVec3>> = all.subjects[0].frames.iter().map(|path| all.read(path).unwrap()).collect();
    let one = Registrations::find(&[all.subjects[0].frames[0].clone()], truth.model.vertex_count()).unwrap();
    let start = truth.model.clone();
    let found = personal(&start, &one).unwrap();
    assert!(
        found.distances[1] < found.distances[0] && found.distances[2] <= found.distances[1],
        "{:?}",
        found.distances
    );
    let arrays = found.arrays(&start.to_arrays());
    let own = BodyModel::from_arrays_with("person".as_ref(), &arrays, Coefficients::All).unwrap();
    assert_eq!(own.shape_coefficients(), start.shape_coefficients());
    let generic = FittedBody::of(&start);
    let shape = PoseFit { shape: true, expression: false }.nearest(&generic, &frames[0], None).shape;
    let [of_person, of_body] =
        [(&own, vec![0.0; 2]), (&start, shape)].map(|(model, shape)| distance(model, &shape, &frames[1..]));
    assert!(of_person < 0.9 * of_body, "{of_person} {of_body}");
    // The pose that was seen is surer than one that was not.
    let mut bent = found.poses[0].clone();
    bent.rotations.iter_mut().for_each(|rotation| *rotation = rotation.transpose());
    let sum = |pose| found.deviations(pose).iter().sum::<f64>();
    assert!(sum(&found.poses[0]) < sum(&bent));
}
