//! A BLSM body that is trained on made-up people, stopped and gone on with.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use xavatar_learned::blsm::{BlsmFit, BlsmParameters, BlsmPopulation, BlsmTraining, Free};
use xavatar_learned::kept::Kept;
use xavatar_learned::registrations::Registrations;
use xavatar_mesh::{TriangleMesh, write_ply};

use crate::tube::tube;

#[test]
fn a_training_that_was_stopped_anywhere_ends_with_the_same_bits() {
    let (start, folder) = (tube(), tempfile::tempdir().unwrap());
    let people = folder.path().join("people");
    BlsmPopulation { subjects: 4, poses: 3, noise: 1e-3, seed: 1 }.write(&start, &people, |_| Ok(())).unwrap();
    let registrations = Registrations::find(&[people], start.vertex_count()).unwrap();
    let training = BlsmTraining { shapes: 2, keep_weights: false };
    let whole = training.train(&start, &registrations, &mut Kept::nothing(), |_| Ok(())).unwrap().unwrap();
    let state = folder.path().join("state");
    // Among the first free bones, and among the bones of the second modes.
    for end in [0.1, 0.8] {
        let stop = AtomicBool::new(false);
        let mut kept = Kept::in_folder(&state, "tube", true, &stop).unwrap();
        let stopped = training.train(&start, &registrations, &mut kept, |share| {
            stop.store(share >= end, Ordering::Relaxed);
            Ok(())
        });
        assert!(stopped.unwrap().is_none(), "{end}");
    }
    let never = AtomicBool::new(false);
    let mut kept = Kept::in_folder(&state, "tube", true, &never).unwrap();
    let mut shares = Vec::new();
    let resumed = training.train(&start, &registrations, &mut kept, |share| {
        shares.push(share);
        Ok(())
    });
    let resumed = resumed.unwrap().unwrap();
    assert!(shares[0] > 0.8, "{shares:?}");
    assert_eq!(resumed.distances, whole.distances);
    assert_eq!((resumed.people, resumed.takes, resumed.flesh), (whole.people, whole.takes, whole.flesh));
    assert_eq!(resumed.body, whole.body);
}

/// Registrations of one person, in takes in which other things are worn: a belt of its own height each.
fn dressed(folder: &std::path::Path, takes: std::ops::Range<usize>, poses: usize) {
    let start = tube();
    let population = BlsmPopulation { subjects: 1, poses, noise: 5e-4, seed: 3 };
    let mut body = population.body(&start);
    let bare = body.template.clone();
    for take in takes {
        let height = 0.2 + 0.2 * take as f64;
        for (place, bare) in body.template.iter_mut().zip(&bare) {
            let outward = DVec3::new(bare.x, 0.0, bare.z).normalize();
            *place = *bare + outward * 0.04 * (-((bare.y - height) / 0.1).powi(2)).exp();
        }
        for pose in 0..poses {
            let vertices = population.registration(&body, 0, take * poses + pose);
            let vertices = vertices.iter().map(|vertex| vertex.as_vec3()).collect();
            let path = folder.join(format!("anna/offsets/train/Take{take}/{pose}.ply"));
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            write_ply(path, &TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() }).unwrap();
        }
    }
}

#[test]
fn of_one_person_in_several_takes_bones_are_shared_and_shapes_are_what_was_worn() {
    let (start, folder) = (tube(), tempfile::tempdir().unwrap());
    dressed(folder.path(), 0..3, 5);
    let registrations = Registrations::find(&[folder.path().join("anna")], start.vertex_count()).unwrap();
    assert_eq!(registrations.subjects.len(), 1);
    let training = BlsmTraining { shapes: 8, keep_weights: true };
    let trained = training.train(&start, &registrations, &mut Kept::nothing(), |_| Ok(())).unwrap().unwrap();
    assert_eq!((trained.people.len(), trained.takes.len(), trained.flesh.len()), (1, 3, 3));
    assert_eq!((trained.body.bone_basis.len(), trained.body.shape_basis.len()), (0, 2));
    // Noise alone is .8 mm; as two takes have not the same flesh, bones are not quite found.
    assert!(trained.distances[1] < 2e-3, "{:?}", trained.distances);
    // Shapes are needed, and are the takes': a take's own one explains its frames, another's does not.
    let fit = BlsmFit::new(&trained.body, 1e-6);
    let frames = registrations.read_all(&registrations.subjects[0]).unwrap();
    let distance = |frame: usize, take: usize| {
        let found = fit.nearest(&frames[frame], Free::Pose, None);
        fit.distance(&BlsmParameters { shape: trained.takes[take].clone(), ..found }, &frames[frame])
    };
    assert!(distance(7, 1) < 0.5 * distance(7, 2), "{} {}", distance(7, 1), distance(7, 2));
    let found = fit.person(&frames[5..10], None);
    let apart = found[0].shape.iter().zip(&trained.takes[1]).map(|(one, other)| (one - other).abs());
    assert!(apart.fold(0.0, f64::max) < 0.2, "{:?} {:?}", found[0].shape, trained.takes[1]);
}
