//! A made-up population, trained on and measured: what was planted is found again.

use std::sync::atomic::{AtomicBool, Ordering};

use xavatar_body::{BodyModel, Coefficients};
use xavatar_formats::Result;
use xavatar_learned::core::Family;
use xavatar_learned::evaluation::evaluate;
use xavatar_learned::kept::Kept;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;
use xavatar_learned::sparse::{Kind, TrainedBody, Training};

use super::tube::{tube, written};

/// A population in a folder, and another of other people in the same bodies.
struct Case {
    folder: tempfile::TempDir,
    start: BodyModel,
}

fn case(poses: usize) -> Case {
    let population = Population { subjects: 8, poses, ..Population::default() };
    let (start, folder) = (tube(), tempfile::tempdir().unwrap());
    let truth = population.truth(&start).unwrap();
    written(&truth, &population, folder.path().join("known"), 0..6);
    written(&truth, &population, folder.path().join("unseen"), 6..8);
    Case { folder, start }
}

impl Case {
    fn registrations(&self, name: &str) -> Registrations {
        Registrations::find(&[self.folder.path().join(name)], self.start.vertex_count()).unwrap()
    }

    fn trained(&self, kind: Kind) -> TrainedBody {
        let training = Training { family: Family::Supr, kind, weights: false };
        training.train(&self.start, &self.registrations("known"), &mut Kept::nothing(), |_| Ok(())).unwrap().unwrap()
    }

    /// Millimetres, of people and poses that were not trained on.
    fn error(&self, body: &TrainedBody) -> f64 {
        let model = BodyModel::from_arrays_with("trained".as_ref(), &body.arrays, Coefficients::All).unwrap();
        let unseen = self.registrations("unseen");
        let found = evaluate(&model, &unseen, &[], None, None, |_| -> Result<()> { Ok(()) }).unwrap();
        found.shapes.last().unwrap().mean_mm
    }
}

#[test]
fn sparse_correctives_explain_what_was_planted_better_than_dense_ones_do() {
    let case = case(30);
    let [plain, dense, sparse] = [Kind::Plain, Kind::Dense, Kind::Sparse].map(|kind| case.trained(kind));
    let [of_plain, of_dense, of_sparse] = [&plain, &dense, &sparse].map(|body| case.error(body));
    // The mean length of noise of 2 mm a coordinate.
    let noise = 2.0 * (8.0 / std::f64::consts::PI).sqrt();
    let [over_dense, over_sparse] = [of_dense, of_sparse].map(|error| (error * error - noise * noise).max(0.0).sqrt());
    assert!(of_plain > 2.0 * of_sparse, "{of_plain} {of_sparse}");
    assert!(over_sparse < over_dense && of_sparse < 1.4 * noise, "{of_dense} {of_sparse}");
}

#[test]
fn a_training_that_was_stopped_anywhere_ends_with_the_same_bits() {
    let case = case(10);
    let training = Training { family: Family::Supr, kind: Kind::Sparse, weights: true };
    let known = case.registrations("known");
    let whole = training.train(&case.start, &known, &mut Kept::nothing(), |_| Ok(())).unwrap().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state");
    // In the first round, in the third, and once more where that began.
    for end in [(0, 4), (2, 3), (2, 0)] {
        let stop = AtomicBool::new(false);
        let mut kept = Kept::in_folder(&state, "tube", true, &stop).unwrap();
        let stopped = training.train(&case.start, &known, &mut kept, |at| {
            stop.store((at.round, at.done) >= end, Ordering::Relaxed);
            Ok(())
        });
        assert!(stopped.unwrap().is_none());
    }
    let never = AtomicBool::new(false);
    let mut kept = Kept::in_folder(&state, "tube", true, &never).unwrap();
    let mut rounds = Vec::new();
    let resumed = training.train(&case.start, &known, &mut kept, |at| {
        rounds.push(at.round);
        Ok(())
    });
    let resumed = resumed.unwrap().unwrap();
    assert_eq!(rounds[0], 2);
    assert_eq!(resumed.held_out, whole.held_out);
    assert_eq!(resumed.arrays, whole.arrays);
}
