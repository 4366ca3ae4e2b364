//! A made-up population, trained on and measured: what was planted is found again.

use xavatar_body::{BodyModel, Coefficients};
use xavatar_formats::Result;
use xavatar_learned::core::Family;
use xavatar_learned::evaluation::evaluate;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;
use xavatar_learned::sparse::{Kind, TrainedBody, Training};

use super::tube::{tube, written};

/// A population in a folder, and another of other people in the same bodies.
struct Case {
    folder: tempfile::TempDir,
    start: BodyModel,
}

fn case() -> Case {
    let population = Population { subjects: 8, poses: 30, ..Population::default() };
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
        training.train(&self.start, &self.registrations("known"), |_| Ok(())).unwrap()
    }

    /// Millimetres, of people and poses that were not trained on.
    fn error(&self, body: &TrainedBody) -> f64 {
        let model = BodyModel::from_arrays_with("trained".as_ref(), &body.arrays, Coefficients::All).unwrap();
        let found = evaluate(&model, &self.registrations("unseen"), &[], None, |_| -> Result<()> { Ok(()) }).unwrap();
        found.shapes.last().unwrap().mean_mm
    }
}

#[test]
fn sparse_correctives_explain_what_was_planted_better_than_dense_ones_do() {
    let case = case();
    let [plain, dense, sparse] = [Kind::Plain, Kind::Dense, Kind::Sparse].map(|kind| case.trained(kind));
    let [of_plain, of_dense, of_sparse] = [&plain, &dense, &sparse].map(|body| case.error(body));
    // The mean length of noise of 2 mm a coordinate.
    let noise = 2.0 * (8.0 / std::f64::consts::PI).sqrt();
    let [over_dense, over_sparse] = [of_dense, of_sparse].map(|error| (error * error - noise * noise).max(0.0).sqrt());
    assert!(of_plain > 2.0 * of_sparse, "{of_plain} {of_sparse}");
    assert!(over_sparse < over_dense && of_sparse < 1.4 * noise, "{of_dense} {of_sparse}");
}
