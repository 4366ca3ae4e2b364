//! A BLSM body whose flesh is a network's, on the tube.

use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use xavatar_learned::blsm::{BlsmBody, BlsmFit, BlsmParameters, FleshedBody, SpiralBody, SpiralTraining};
use xavatar_learned::kept::Kept;

use crate::tube::tube;

/// What the flesh of people has beside the mean: a bulge somewhere along the tube, at two sides.
fn bulges(body: &BlsmBody, people: usize) -> Vec<Vec<DVec3>> {
    let bulge = |person: usize| {
        let height = 0.15 + 0.7 * (person as f64 * 0.618).fract();
        let offset = |place: &DVec3| {
            let outward = DVec3::new(place.x, 0.0, place.z).normalize();
            outward * 0.03 * (-((place.y - height) / 0.12).powi(2)).exp()
        };
        body.template.iter().map(offset).collect()
    };
    (0..people).map(bulge).collect()
}

/// Of twenty people, with their codes.
static OF_TWENTY: LazyLock<(SpiralBody, Vec<Vec<f64>>)> = LazyLock::new(|| trained(20));

fn trained(people: usize) -> (SpiralBody, Vec<Vec<f64>>) {
    let body = BlsmBody::of(&tube());
    let flesh = bulges(&body, people);
    let mut shares = Vec::new();
    let training = SpiralTraining { codes: 3, epochs: 40, seed: 1 };
    let (body, codes) = training
        .train(body, &flesh, &mut Kept::nothing(), |share| {
            shares.push(share);
            Ok(())
        })
        .unwrap()
        .unwrap();
    assert_eq!((shares.len(), shares[20]), (40, 0.5));
    (body, codes)
}

fn mean_distance(one: &[DVec3], other: &[DVec3]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one.distance(*other)).sum::<f64>() / one.len() as f64
}

#[test]
fn the_bodys_flesh_is_that_of_its_code_and_follows_codes_near_it() {
    let (body, _) = &*OF_TWENTY;
    let code = vec![0.5, -0.3, 0.8];
    let at = body.at(&code).unwrap();
    let with = |body: &BlsmBody, shape: &[f64]| body.posed(&BlsmParameters { shape: shape.to_vec(), ..body.rest() });
    // |D(c + h) - D(c) - J h| falls with the square of h, far below |J h|.
    let near: Vec<f64> = code.iter().map(|entry| entry + 0.01).collect();
    let moved = mean_distance(&with(&at, &near).vertices, &with(&at, &code).vertices);
    let exact = body.at(&near).unwrap();
    let apart = mean_distance(&with(&at, &near).vertices, &with(&exact, &near).vertices);
    assert!(moved > 1e-6 && apart < 0.05 * moved, "{apart} of {moved}");
    assert!(body.at(&[0.0; 7]).unwrap_err().to_string().contains("7 numbers"));
}

#[test]
fn a_person_of_the_body_is_found_in_registrations() {
    let (body, codes) = &*OF_TWENTY;
    let own = body.at(&codes[6]).unwrap();
    let truth = BlsmParameters { shape: codes[6].clone(), ..own.rest() };
    let mut bent = truth.clone();
    let turned = |(at, atom): (usize, &xavatar_learned::blsm::Atom)| atom.coordinate(0.1 * (at as f64).sin());
    bent.atoms = own.atoms.list.iter().enumerate().map(turned).collect();
    let frames = vec![own.posed(&truth).vertices, own.posed(&bent).vertices];
    let (found, at) = body.person(&frames, 1e-9).unwrap();
    let fit = BlsmFit::new(&at, 0.0);
    let distances = found.iter().zip(&frames).map(|(parameters, frame)| fit.distance(parameters, frame));
    let distance = distances.sum::<f64>() / 2.0;
    let mean = body.at(&[0.0; 3]).unwrap();
    let before = mean_distance(&mean.template, &own.posed(&truth).vertices);
    assert!(distance < 0.2 * before, "{distance} of {before}");
    assert_eq!(found[0].shape, found[1].shape);
}

#[test]
fn its_file_has_the_network_and_linear_shapes_for_those_who_do_not_know_it() {
    let (body, codes) = trained(8);
    let arrays = body.to_arrays().unwrap();
    let path = Path::new("body.npz");
    let plain = BlsmBody::from_arrays(path, &arrays).unwrap();
    assert_eq!(plain.shape_basis.len(), body.code_count());
    let FleshedBody::Spiral(again) = FleshedBody::from_arrays(path, &arrays).unwrap() else { panic!("linear") };
    let [one, other] = [&body, &*again].map(|body| body.at(&codes[2]).unwrap());
    assert!(mean_distance(&one.template, &other.template) < 1e-12);
    let linear = FleshedBody::from_arrays(path, &plain.to_arrays()).unwrap();
    assert!(matches!(linear, FleshedBody::Linear(_)));
    let mut other_mesh = arrays;
    for (name, array) in BlsmBody::of(&tube()).chosen(&[0, 1, 2]).to_arrays() {
        other_mesh.insert(name, array);
    }
    let message = FleshedBody::from_arrays(path, &other_mesh).unwrap_err().to_string();
    assert!(message.contains("body.npz") && message.contains("`spiral.mean`"), "{message}");
}

#[test]
fn one_person_is_too_few() {
    let body = BlsmBody::of(&tube());
    let flesh = bulges(&body, 1);
    let training = SpiralTraining { codes: 3, epochs: 1, seed: 0 };
    let message = training.train(body, &flesh, &mut Kept::nothing(), |_| Ok(())).unwrap_err().to_string();
    assert!(message.contains("people is 1"), "{message}");
}

#[test]
fn a_training_that_was_stopped_ends_with_the_same_bits() {
    let body = BlsmBody::of(&tube());
    let flesh = bulges(&body, 8);
    let training = SpiralTraining { codes: 3, epochs: 6, seed: (1 << 53) + 1 };
    let arrays = |trained: Option<(SpiralBody, Vec<Vec<f64>>)>| trained.unwrap().0.to_arrays().unwrap();
    let whole = arrays(training.train(body.clone(), &flesh, &mut Kept::nothing(), |_| Ok(())).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let (stop, never) = (AtomicBool::new(false), AtomicBool::new(false));
    let mut kept = Kept::in_folder(&folder.path().join("state"), "tube", false, &stop).unwrap();
    let stopped = training.train(body.clone(), &flesh, &mut kept, |share| {
        stop.store(share >= 0.5, Ordering::Relaxed);
        Ok(())
    });
    assert!(stopped.unwrap().is_none());
    drop(kept);
    let mut kept = Kept::in_folder(&folder.path().join("state"), "tube", true, &never).unwrap();
    let mut shares = Vec::new();
    let resumed = training.train(body, &flesh, &mut kept, |share| {
        shares.push(share);
        Ok(())
    });
    assert_eq!(arrays(resumed.unwrap()), whole);
    assert_eq!(shares.len(), 2);
}
