//! A first pose of a registration: each joint turned as the vertices that follow it are, from the root down, within the atoms' limits.
//!
//! G_j turns the vertices with w_vj > 1/2 about their mean as they are turned in the registration; R_j = G_p^T G_j. Only a joint's atoms are kept, and
//! what its children are turned by is what is left of it. Metres.

use glam::{DMat3, DVec3};
use xavatar_register::linear::rotation_between;

use super::{BlsmBody, BlsmParameters};

/// Vertices with such a weight follow a joint.
const FOLLOWS: f64 = 0.5;
/// So many say how it is turned.
const FEWEST: usize = 4;

/// The parameters that bring a body near a registration (V), with mean bones and shape.
pub(super) fn first_turns(body: &BlsmBody, registration: &[DVec3]) -> BlsmParameters {
    let joints = body.names.len();
    let follows = |joint: usize, vertex: &usize| {
        body.weights[*vertex].iter().any(|(of, weight)| *of == joint && *weight > FOLLOWS)
    };
    let mut found = body.rest();
    let mut turns: Vec<DMat3> = Vec::with_capacity(joints);
    for joint in 0..joints {
        let parent = body.skeleton.parents[joint];
        let above = parent.map_or(DMat3::IDENTITY, |parent| turns[parent]);
        let mut vertices: Vec<usize> = (0..body.template.len()).filter(|vertex| follows(joint, vertex)).collect();
        if parent.is_none() && vertices.len() < FEWEST {
            vertices = (0..body.template.len()).collect();
        }
        let pairs: Vec<_> =
            vertices.iter().map(|vertex| (body.template[*vertex], registration[*vertex], 1.0)).collect();
        let turned = if vertices.len() < FEWEST { None } else { rotation_between(&pairs) }.unwrap_or(above);
        if parent.is_none() {
            let count = vertices.len() as f64;
            let [at_rest, posed] = [&body.template[..], registration]
                .map(|of| vertices.iter().map(|vertex| of[*vertex]).sum::<DVec3>() / count);
            let root = body.skeleton.offsets[0];
            found.turn = turned;
            found.translation = posed - turned * (at_rest - root) - root;
            turns.push(turned);
            continue;
        }
        let mut rotations = vec![DMat3::IDENTITY; joints];
        rotations[joint] = above.transpose() * turned;
        let (coordinates, _) = body.atoms.of_rotations(&rotations);
        for (place, _) in body.atoms.list.iter().enumerate().filter(|(_, atom)| atom.joint == joint) {
            found.atoms[place] = coordinates[place];
        }
        turns.push(above * body.atoms.rotations(&body.atoms.angles(&found.atoms))[joint]);
    }
    found
}
