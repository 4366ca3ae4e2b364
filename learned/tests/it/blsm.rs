//! A BLSM body that is trained on made-up people, stopped and gone on with.

use std::sync::atomic::{AtomicBool, Ordering};

use xavatar_learned::blsm::{BlsmPopulation, BlsmTraining};
use xavatar_learned::kept::Kept;
use xavatar_learned::registrations::Registrations;

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
    assert_eq!((resumed.people, resumed.flesh), (whole.people, whole.flesh));
    assert_eq!(resumed.body, whole.body);
}
