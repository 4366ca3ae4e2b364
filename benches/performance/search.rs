//! The correspondence search alone: 10,000 points at the built-in subject's posed surface, nine starts each.
//!
//! A root here is a start that converged, before roots of one point are merged; the skinning field is the paper's, trained
//! on the canonical body for a few hundred steps, so that a start takes about as many evaluations as in a real run.

use std::sync::atomic::AtomicBool;

use xavatar::config::{Config, SearchedField, Starts};
use xavatar::correspondence::{PosedField, PosedWarp, bake, bone_rows, start_groups};
use xavatar::mannequin::{BuiltInSubject, Split};
use xavatar::train::{Trainer, TrainingFrames};

use crate::report::{Report, Seconds};
use crate::steps::{OneFrame, Timings};

const POINTS: usize = 10_000;
const REPEATS: usize = 3;
const GRID: SearchedField = SearchedField::Baked { nodes: [96, 96, 48], refresh_steps: 1 };

/// Measures the exact and the baked search.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    report.section("search, 10,000 points x 9 starts");
    let settings = [
        // The search never asks the geometry field: a small one shortens the training.
        ("fields.geometry.width", "64"),
        ("schedule.pretraining_steps", "300"),
        ("schedule.steps", "1"),
        ("schedule.preview_steps", "0"),
        ("sampling.points", "600"),
        ("optimiser.batch_frames", "1"),
    ];
    let config = Config::preset_with("paper-scan", &settings.map(|(key, value)| (key.into(), value.into())))?;
    let subject = BuiltInSubject::new()?;
    let (model, parameters) = (subject.model(), subject.parameters(Split::Train, 0, 1)?);
    let folder = tempfile::tempdir()?;
    let (source, mut timings) = (OneFrame::of(&subject)?, Timings::default());
    let labels = subject.part_labels();
    let mut trainer =
        Trainer::start(&config, TrainingFrames::Scans(&source), model, labels, folder.path(), &mut timings)?;
    trainer.run(&AtomicBool::new(false), &mut timings)?;
    let avatar = trainer.avatar();

    let posed = model.pose(&parameters)?;
    let bones = bone_rows(&model.canonical_to_posed(&parameters)?);
    let points: Vec<[f32; 3]> =
        posed.vertices.iter().cycle().take(POINTS).map(|vertex| (*vertex - parameters.transl).to_array()).collect();
    let groups = start_groups(Starts::Body)?;
    let labels = vec![0; points.len()];
    let baked = bake(&avatar.fields.skinning, GRID, avatar.subject.bounds)?;
    let baked = baked.ok_or("the paper's skinning is a network")?;
    let exact = PosedWarp::new(&avatar.fields.skinning, None, &bones, None)?;
    for (name, warp) in [("exact", exact), ("baked", PosedWarp::Voxels(baked.warp(&bones, None)?))] {
        let field = PosedField {
            fields: &avatar.fields,
            bones: &bones,
            embedded: &[],
            groups: &groups,
            settings: &config.search,
            warp: &warp,
            bounds: avatar.subject.bounds,
        };
        let found = field.candidates(&points, &labels)?.statistics;
        let seconds = Seconds::of(REPEATS, || {
            field.candidates(&points, &labels).expect("the search succeeded before");
        });
        report.rate(&format!("search_{name}_roots_per_s"), found.converged as f64, &seconds, "roots");
        let evaluations = (found.evaluations + found.polish_evaluations) as f64;
        report.number(&format!("search_{name}_evaluations_per_start"), evaluations / found.starts as f64, "");
        report.number(
            &format!("search_{name}_converged"),
            found.converged as f64 / found.starts as f64,
            "of the starts",
        );
    }
    Ok(())
}
