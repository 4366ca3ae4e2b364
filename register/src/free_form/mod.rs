//! Surfaces that are free of their body: the registered mesh moved vertex by vertex onto the scan, in the body's topology (Wang, ch. 5.4).
//!
//! E = pulls + s (a laplacian + b edge vectors) + c edge lengths over the moves d (V, 3) of a mesh's vertices from those of the posed body; the
//! laplacian is of the moves, so that what nothing pulls at goes with its surroundings and keeps its form. What is one place is looked for
//! again and again while s falls. Vertices that are held, those of hands, stay the body's. In decimetres, so that the squared lengths weigh;
//! metres in and out. The same bits whatever the threads.

mod descent;
mod pairs;
mod terms;

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};
use xavatar_body::{BodyModel, PartLabels, Role};
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;

use self::descent::descend;
use self::pairs::Scan;
use self::terms::{Mesh, Pull, pulls};

/// Decimetres in a metre.
const UNIT: f64 = 10.0;
/// Weights of the moves' roughness, of edges' vectors and of their squared lengths, against 1 of each pull.
const WEIGHTS: [f64; 3] = [0.1, 0.1, 0.1];
/// What the first two are multiplied by, at each search for what is one place.
const STIFFNESS: [f64; 8] = [64.0, 32.0, 16.0, 8.0, 4.0, 2.0, 1.0, 1.0];
/// Steps of the descent after each search.
const STEPS: usize = 20;
/// How often faces that were turned over are smoothed away at most.
const SMOOTHINGS: usize = 75;
/// After how many of them one more ring of vertices around them is smoothed too.
const SMOOTHINGS_A_RING: usize = 25;

/// What a vertex may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Go to the scan.
    Drawn,
    /// Go with its neighbours.
    Carried,
    /// Stay the body's.
    Held,
}

/// What each vertex (V) of a body may do: hands, which scans show badly, are held; eyes and the inside of the mouth, which none shows, carried.
pub fn freedoms(body: &BodyModel, labels: &PartLabels) -> Vec<Freedom> {
    let is_hand = labels.parts.iter().map(|part| body.skeleton().role(*part) == Role::Hands);
    let freedom = |(is_hand, is_detail): (bool, &bool)| match (is_hand, is_detail) {
        (true, _) => Freedom::Held,
        (false, true) => Freedom::Carried,
        (false, false) => Freedom::Drawn,
    };
    is_hand.zip(&labels.detail).map(freedom).collect()
}

/// A posed body's mesh, moved onto a scan, each of its vertices (V) as far as it is free.
///
/// # Errors
/// [`Error::Value`](xavatar_formats::Error::Value) for a scan without an area, or a mesh that [`TriangleMesh::check`] refuses.
pub fn free_form(body: &TriangleMesh, freedoms: &[Freedom], scan: &TriangleMesh) -> Result<TriangleMesh> {
    let scan = Scan::new(scan)?;
    let start: Vec<DVec3> = body.vertices.iter().map(|place| place.as_dvec3() * UNIT).collect();
    let mesh = Mesh::new(&body.faces, &start);
    let mut moves = vec![DVec3::ZERO; start.len()];
    for stiffness in STIFFNESS {
        let mut found = scan.pulls(moved(body, &moves), freedoms)?;
        found.iter_mut().for_each(|pull| pull.place *= UNIT);
        descend(&mut moves, STEPS, |moves| {
            let mut gradient = slope(&mesh, &start, moves, &found, stiffness);
            let held = gradient.iter_mut().zip(freedoms).filter(|(_, freedom)| **freedom == Freedom::Held);
            held.for_each(|(slope, _)| *slope = DVec3::ZERO);
            gradient
        });
    }
    smooth_turned_faces(body, &mesh, freedoms, &mut moves);
    Ok(moved(body, &moves))
}

/// dE/dd (V)
fn slope(mesh: &Mesh, start: &[DVec3], moves: &[DVec3], found: &[Pull], stiffness: f64) -> Vec<DVec3> {
    let [rough, vectors, lengths] = WEIGHTS;
    let places: Vec<DVec3> = start.iter().zip(moves).map(|(start, way)| *start + *way).collect();
    let mut gradient = vec![DVec3::ZERO; places.len()];
    pulls(&places, found, &mut gradient);
    mesh.laplacian(moves, stiffness * rough, &mut gradient);
    mesh.edge_vectors(&places, stiffness * vectors, &mut gradient);
    mesh.edge_lengths(&places, lengths, &mut gradient);
    gradient
}

fn moved(body: &TriangleMesh, moves: &[DVec3]) -> TriangleMesh {
    let place = |(place, way): (&Vec3, &DVec3)| (place.as_dvec3() + *way / UNIT).as_vec3();
    TriangleMesh {
        vertices: body.vertices.iter().zip(moves).map(place).collect(),
        faces: body.faces.clone(),
        ..TriangleMesh::default()
    }
}

/// Faces that show the other side than in the body are folds: their vertices go as their neighbours do, and the longer that takes, the more
/// of those around them.
fn smooth_turned_faces(body: &TriangleMesh, mesh: &Mesh, freedoms: &[Freedom], moves: &mut [DVec3]) {
    for round in 0..SMOOTHINGS {
        let turned = turned_faces(body, &moved(body, moves));
        if turned.is_empty() {
            return;
        }
        let mut vertices: BTreeSet<usize> =
            turned.iter().flat_map(|face| body.faces[*face]).map(|vertex| vertex as usize).collect();
        for _ in 0..round / SMOOTHINGS_A_RING {
            vertices.extend(vertices.clone().into_iter().flat_map(|vertex| mesh.neighbours(vertex)));
        }
        vertices.retain(|vertex| freedoms[*vertex] != Freedom::Held);
        let mean = |vertex: &usize| {
            let neighbours = mesh.neighbours(*vertex);
            neighbours.iter().map(|other| moves[*other]).sum::<DVec3>() / neighbours.len() as f64
        };
        let means: Vec<DVec3> = vertices.iter().map(mean).collect();
        vertices.into_iter().zip(means).for_each(|(vertex, mean)| moves[vertex] = mean);
    }
}

/// The faces whose normal turned by more than a right angle.
pub fn turned_faces(body: &TriangleMesh, moved: &TriangleMesh) -> Vec<usize> {
    let is_turned = |face: &usize| moved.face_normal(*face as u32).dot(body.face_normal(*face as u32)) < 0.0;
    (0..body.faces.len()).filter(is_turned).collect()
}

#[cfg(test)]
mod tests;
