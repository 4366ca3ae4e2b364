//! The weights under which places keep their distance to the scans: Gauss-Newton at every node, neighbours held together.
//!
//! With images q_kb = B_kb x and d_k = sum_b w_b q_kb, the distance changes by g_kb = grad s_k . (q_kb - d_k) a unit of w_b. A step h
//! minimises mean_k o_k (r_k + g_k . h)^2 + SMOOTH |c + h - c_neighbours|^2 + HELD |c + h|^2, where c = w - w_before, r_k is s_k less its
//! mean, and o_k lets frames count less the farther they are from it: there, another part of the body is near. K frames.

use glam::Vec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::{BAND, Places, Row, View};

/// Most bones of a node, as many as the field keeps.
const MOST_BONES: usize = 8;
/// Bones from this weight on bring their neighbours in the tree along.
const LEADING: f32 = 0.2;
/// How strongly neighbouring nodes are held together, and all to where they began, square metres.
const SMOOTH: f32 = 3e-4;
const HELD: f32 = 3e-5;
/// Deviation from which a frame counts half or less, metres.
const TYPICAL: f32 = 0.012;
/// Steps; smoothness spreads by a node a step.
const STEPS: usize = 25;
/// Longest change of a weight in a step.
const LONGEST: f32 = 0.15;
/// Weights below this are nothing, unless the body model has the bone there.
const LEAST: f32 = 5e-3;
/// Fewest frames that can tell a node's weights.
const FEWEST: f32 = 3.0;

type Weights = SmallVec<[f32; MOST_BONES]>;

/// What is being fitted at a node.
struct Node {
    bones: SmallVec<[usize; MOST_BONES]>,
    /// As it began.
    before: Weights,
    weights: Weights,
    /// Whether any frame shows a surface near it.
    is_seen: bool,
}

/// Fits the rows (R) of the nodes that may move, from where they are.
pub(super) fn refine(rows: &mut [Row], views: &[View], places: &Places, parents: &[Option<usize>]) {
    let Places { may_move, bones, neighbours } = places;
    let node = |node: usize| Node::new(node, &rows[node], may_move[node], views, bones, parents);
    let mut nodes: Vec<Node> = (0..rows.len()).into_par_iter().with_min_len(256).map(node).collect();
    for _ in 0..STEPS {
        let step = |index: usize| may_move[index].then(|| moved(index, &nodes, views, &neighbours[index]));
        let next: Vec<Option<Weights>> = (0..nodes.len()).into_par_iter().with_min_len(256).map(step).collect();
        for (node, weights) in nodes.iter_mut().zip(next) {
            node.weights = weights.unwrap_or_else(|| std::mem::take(&mut node.weights));
        }
    }
    for (row, node) in rows.iter_mut().zip(&nodes) {
        let kept = |bone: usize, weight: f32| weight >= LEAST || row.iter().any(|(own, _)| *own == bone);
        let fitted = node.bones.iter().copied().zip(node.weights.iter().copied());
        *row = fitted.filter(|(bone, weight)| kept(*bone, *weight)).collect();
    }
}

impl Node {
    fn new(
        node: usize,
        row: &Row,
        may_move: bool,
        views: &[View],
        allowed: &[usize],
        parents: &[Option<usize>],
    ) -> Self {
        let mut known = row.clone();
        known.sort_by(|a, b| b.1.total_cmp(&a.1));
        known.truncate(MOST_BONES);
        let is_seen = may_move && views.iter().any(|view| view.distance(node, row).abs() < BAND);
        if is_seen {
            let leading: Vec<usize> =
                known.iter().filter(|(_, weight)| *weight > LEADING).map(|(bone, _)| *bone).collect();
            let is_relative =
                |bone: &usize| leading.iter().any(|own| parents[*own] == Some(*bone) || parents[*bone] == Some(*own));
            for bone in allowed.iter().copied().filter(is_relative) {
                if known.len() < MOST_BONES && known.iter().all(|(own, _)| *own != bone) {
                    known.push((bone, 0.0));
                }
            }
        }
        let weights: Weights = known.iter().map(|(_, weight)| *weight).collect();
        Self { bones: known.iter().map(|(bone, _)| *bone).collect(), before: weights.clone(), weights, is_seen }
    }

    /// How a bone's weight has changed.
    fn change_of(&self, bone: usize) -> f32 {
        let place = self.bones.iter().position(|own| *own == bone);
        place.map_or(0.0, |place| self.weights[place] - self.before[place])
    }
}

/// A node's weights after a step.
fn moved(index: usize, nodes: &[Node], views: &[View], neighbours: &[u32; 6]) -> Weights {
    let node = &nodes[index];
    let count = node.bones.len();
    let mut matrix = [[0.0_f32; MOST_BONES]; MOST_BONES];
    let mut right = [0.0_f32; MOST_BONES];
    if node.is_seen {
        add_frames(index, node, views, &mut matrix, &mut right);
    }
    for (place, (row, target)) in matrix.iter_mut().zip(&mut right).take(count).enumerate() {
        let around = neighbours.iter().map(|other| nodes[*other as usize].change_of(node.bones[place]));
        let mean = around.sum::<f32>() / neighbours.len() as f32;
        let change = node.weights[place] - node.before[place];
        row[place] += SMOOTH + HELD;
        *target += SMOOTH * (mean - change) - HELD * change;
    }
    solve(&mut matrix, &mut right, count);
    let longest = right[..count].iter().fold(0.0_f32, |longest, change| longest.max(change.abs()));
    let factor = if longest > LONGEST { LONGEST / longest } else { 1.0 };
    let mut weights: Weights =
        node.weights.iter().zip(right).map(|(weight, change)| (weight + factor * change).max(0.0)).collect();
    let sum: f32 = weights.iter().sum();
    if sum <= 0.0 || sum.is_nan() {
        return node.weights.clone();
    }
    weights.iter_mut().for_each(|weight| *weight /= sum);
    weights
}

/// Adds what the frames ask of a node.
fn add_frames(
    index: usize,
    node: &Node,
    views: &[View],
    matrix: &mut [[f32; MOST_BONES]; MOST_BONES],
    right: &mut [f32; MOST_BONES],
) {
    let count = node.bones.len();
    let mut frames: SmallVec<[(f32, [f32; MOST_BONES]); 24]> = SmallVec::new();
    for view in views {
        let mut images = [Vec3::ZERO; MOST_BONES];
        for (image, bone) in images.iter_mut().zip(&node.bones) {
            *image = view.image(index, *bone);
        }
        let image: Vec3 = images.iter().zip(&node.weights).map(|(image, weight)| *weight * *image).sum();
        let (distance, gradient) = view.volume.at(image);
        if distance.abs() < BAND {
            frames.push((distance, images.map(|own| gradient.dot(own - image))));
        }
    }
    // The middle one first: a mean would follow what it should ignore.
    let mut sorted: SmallVec<[f32; 24]> = frames.iter().map(|(distance, _)| *distance).collect();
    sorted.sort_by(f32::total_cmp);
    let Some(middle) = sorted.get(sorted.len() / 2).copied() else { return };
    let counts = |distance: f32| (1.0 + ((distance - middle) / TYPICAL).powi(2)).powi(-2);
    let total: f32 = frames.iter().map(|(distance, _)| counts(*distance)).sum();
    if total < FEWEST {
        return;
    }
    let mean = frames.iter().map(|(distance, _)| counts(*distance) * distance).sum::<f32>() / total;
    let mut slopes = [0.0; MOST_BONES];
    for (distance, frame) in &frames {
        (0..count).for_each(|place| slopes[place] += counts(*distance) / total * frame[place]);
    }
    let share = 1.0 / views.len() as f32;
    for (distance, frame) in &frames {
        let weight = share * counts(*distance);
        let centred: Weights = frame.iter().zip(slopes).take(count).map(|(own, mean)| own - mean).collect();
        for ((row, target), slope) in matrix.iter_mut().zip(right.iter_mut()).zip(&centred) {
            *target -= weight * slope * (distance - mean);
            row.iter_mut().zip(&centred).for_each(|(entry, other)| *entry += weight * slope * other);
        }
    }
}

/// Solves the first `count` equations of a positive definite matrix in place, by elimination.
fn solve(matrix: &mut [[f32; MOST_BONES]; MOST_BONES], right: &mut [f32; MOST_BONES], count: usize) {
    for pivot in 0..count {
        let from = matrix[pivot];
        for row in pivot + 1..count {
            let factor = matrix[row][pivot] / from[pivot];
            let entries = matrix[row].iter_mut().zip(from).take(count).skip(pivot);
            entries.for_each(|(entry, above)| *entry -= factor * above);
            right[row] -= factor * right[pivot];
        }
    }
    for row in (0..count).rev() {
        let known: f32 = (row + 1..count).map(|column| matrix[row][column] * right[column]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat3;

    use super::super::volume::{DistanceVolume, cuboid};
    use super::*;
    use crate::mesh::SolidIndex;

    #[test]
    fn elimination_solves_what_it_is_given() {
        let mut matrix = [[0.0; MOST_BONES]; MOST_BONES];
        let known = [[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 5.0]];
        let solution = [1.0_f32, -2.0, 0.25];
        let mut right = [0.0; MOST_BONES];
        for ((row, known), target) in matrix.iter_mut().zip(&known).zip(&mut right) {
            row[..3].copy_from_slice(known);
            *target = known.iter().zip(solution).map(|(entry, value)| entry * value).sum();
        }
        solve(&mut matrix, &mut right, 3);
        assert!((0..3).all(|row| (right[row] - solution[row]).abs() < 1e-5), "{right:?}");
    }

    /// Eight frames in which a block and the second of two bones move along x by these steps, while the first bone rests.
    fn views<'a>(block: f32, bone: f32, places: &[Vec3], body: &'a SolidIndex) -> Vec<View<'a>> {
        let view = |step: f32| {
            let mut mesh = cuboid();
            mesh.vertices.iter_mut().for_each(|vertex| vertex.x += block * step);
            View {
                volume: DistanceVolume::new(&mesh, &SolidIndex::new(&mesh).unwrap()),
                body,
                bones: vec![(Mat3::IDENTITY, Vec3::ZERO), (Mat3::IDENTITY, bone * step * Vec3::X)],
                places: places.to_vec(),
            }
        };
        (0..8).map(|number| view(number as f32 - 3.5)).collect()
    }

    fn refined(views: &[View], places: &[Vec3]) -> Vec<Row> {
        let mut rows = vec![vec![(0, 1.0)]; places.len()];
        let alone = (0..places.len() as u32).map(|place| [place; 6]).collect();
        let places = Places { may_move: vec![true; places.len()], bones: vec![0, 1], neighbours: alone };
        refine(&mut rows, views, &places, &[None, Some(0)]);
        rows
    }

    fn weight_of(row: &Row, bone: usize) -> f32 {
        row.iter().filter(|(own, _)| *own == bone).map(|(_, weight)| weight).sum()
    }

    // What is worn goes with the bone that keeps it at its place in the scans, though the body model says another.
    #[test]
    fn places_go_with_the_bone_that_their_surface_goes_with() {
        let places = [Vec3::new(0.29, 0.03, 0.02), Vec3::new(0.3, -0.04, 0.05), Vec3::new(0.31, 0.0, -0.06)];
        let body = SolidIndex::new(&cuboid()).unwrap();
        let views = views(0.006, 0.006, &places, &body);
        let spread = |place: usize, row: &Row| {
            let distances: Vec<f32> = views.iter().map(|view| view.distance(place, row)).collect();
            let mean = distances.iter().sum::<f32>() / distances.len() as f32;
            distances.iter().map(|distance| (distance - mean).powi(2)).sum::<f32>()
        };
        for (place, row) in refined(&views, &places).iter().enumerate() {
            assert!(weight_of(row, 1) > 0.5, "{row:?}");
            assert!((weight_of(row, 0) + weight_of(row, 1) - 1.0).abs() < 1e-5, "{row:?}");
            assert!(spread(place, row) < 0.25 * spread(place, &vec![(0, 1.0)]), "{row:?}");
        }
    }

    #[test]
    fn places_whose_surface_goes_with_their_own_bone_keep_it() {
        let places = [Vec3::new(0.29, 0.03, 0.02), Vec3::new(0.31, 0.0, -0.06)];
        let body = SolidIndex::new(&cuboid()).unwrap();
        for row in refined(&views(0.0, 0.006, &places, &body), &places) {
            assert!(weight_of(&row, 0) > 0.99, "{row:?}");
        }
    }
}
