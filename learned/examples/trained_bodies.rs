//! What sparse correctives are worth on a made-up population, as a table.
//!
//! `cargo run --release -p xavatar-learned --example trained_bodies -- BODY.npz [PEOPLE] [POSES] [VERTICES]` trains on PEOPLE people in POSES poses each, with
//! 12 mm of planted correctives and 2 mm of noise, and measures on a fifth as many other people, without noise. BODY, SMPL-X's, is taken with SMPL's 24 joints
//! and about VERTICES vertices.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use xavatar_body::{Anatomy, BlendShapes, BodyModel, Coefficients, Correctives, Gender, JointBasis, smpl};
use xavatar_formats::{Error, Result};
use xavatar_learned::core::Family;
use xavatar_learned::evaluation::evaluate;
use xavatar_learned::kept::Kept;
use xavatar_learned::population::Population;
use xavatar_learned::registrations::Registrations;
use xavatar_learned::sparse::{Kind, Training};
use xavatar_learned::truth::KnownTruth;
use xavatar_mesh::{TriangleMesh, decimated};

/// SMPL-X's joints that are SMPL's: the body's, and of each hand the middle finger's first.
const HANDS: [usize; 2] = [28, 43];

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let body = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (people, poses, vertices) = (number(20), number(50), number(600));
    let unseen = people.div_ceil(5);
    let start = small(&BodyModel::load(&body, Gender::of_file_name(&body).unwrap_or_default())?, vertices)?;
    let folder = std::env::temp_dir().join(format!("trained-bodies-{}", std::process::id()));
    let population = Population { subjects: people + unseen, poses, ..Population::default() };
    population.write(&start, &folder, |_| Ok(()))?;
    let clean = folder.join("clean");
    Population { noise: 0.0, ..population }.write(&start, &clean, |_| Ok(()))?;
    let of = |folder: &Path, range: std::ops::Range<usize>| {
        let paths: Vec<PathBuf> = range.map(|subject| folder.join(format!("{subject:02}"))).collect();
        Registrations::find(&paths, start.vertex_count())
    };
    let (known, others) = (of(&folder, 0..people)?, of(&clean, people..people + unseen)?);
    let truth = KnownTruth::find(std::slice::from_ref(&folder))?;
    println!("{people} people, {poses} poses, {} vertices; measured on {unseen} others", start.vertex_count());
    println!(
        "| correctives | held-out frames, mm | other people, mm | their other poses in one shape, mm | joints, mm | support F1 | blocks | minutes |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, kind) in [("none", Kind::Plain), ("dense, ridge", Kind::Dense), ("sparse", Kind::Sparse)] {
        let began = Instant::now();
        let training = Training { family: Family::Supr, kind, weights: false };
        let Some(trained) = training.train(&start, &known, &mut Kept::nothing(), |_| Ok(()))? else { break };
        let minutes = began.elapsed().as_secs_f64() / 60.0;
        let model = BodyModel::from_arrays_with(&body, &trained.arrays, Coefficients::All)?;
        let found = evaluate(&model, &others, &[], None, truth.as_ref(), |_| Ok(()))?;
        let shape = found.shapes.last().map_or(f64::NAN, |at| at.mean_mm);
        let (joints, f1) = found.truth.map_or((None, None), |truth| (truth.joints_mm, truth.support_f1));
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        let blocks = trained.correctives.density(model.skeleton().joints.len() - 1) * 100.0;
        let held_out = trained.held_out.last().map_or(f64::NAN, |distance| 1e3 * distance);
        let poses_mm = number(found.poses_mm);
        println!(
            "| {name} | {held_out:.2} | {shape:.2} | {poses_mm} | {} | {} | {blocks:.1} % | {minutes:.1} |",
            number(joints),
            number(f1)
        );
    }
    std::fs::remove_dir_all(&folder).map_err(Error::io(&folder))
}

/// A body of SMPL-X's joints as one of SMPL's, on some of its vertices.
fn small(model: &BodyModel, vertices: usize) -> Result<BodyModel> {
    let anatomy = model.anatomy();
    let (template, faces) = (model.template().to_vec(), model.faces().to_vec());
    let few = decimated(&TriangleMesh { vertices: template, faces, ..TriangleMesh::default() }, 2 * vertices);
    let skeleton = smpl::skeleton().clone();
    let (all, joints, shapes) = (anatomy.skeleton.joints.len(), skeleton.joints.len(), anatomy.shape_coefficients());
    let follows = |joint: usize| match joint {
        0..22 => joint,
        22..25 => 15,
        25..40 => 22,
        _ => 23,
    };
    let mut weights = vec![0.0; few.sources.len() * joints];
    for (row, vertex) in weights.chunks_exact_mut(joints).zip(&few.sources) {
        let own = &anatomy.skinning_weights[*vertex as usize * all..][..all];
        own.iter().enumerate().for_each(|(joint, weight)| row[follows(joint)] += weight);
    }
    let chosen = |row: &Vec<DVec3>| (0..22).chain(HANDS).map(|joint| row[joint]).collect();
    let direction =
        |row: &[f32]| few.sources.iter().flat_map(|vertex| row[3 * *vertex as usize..][..3].to_vec()).collect();
    let small = Anatomy {
        skeleton,
        template: few.mesh.vertices.clone(),
        faces: few.mesh.faces.clone(),
        skinning_weights: weights,
        shapes: BlendShapes::from_directions(anatomy.shapes.directions().take(shapes).map(direction).collect()),
        expressions: 0,
        joints: JointBasis {
            template: chosen(&anatomy.joints.template),
            directions: anatomy.joints.directions.iter().take(shapes).map(chosen).collect(),
        },
        correctives: Correctives::None,
        hands: Vec::new(),
    };
    BodyModel::assemble(model.path(), small)
}
