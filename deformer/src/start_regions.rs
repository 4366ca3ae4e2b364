//! Which starts of a search can be left out: an exact bound, not a guess.
//!
//! Bone i's start for x_d is x_0 = B_i^-1 x_d. Each cell that matters belongs, for each start group, to the bones of the
//! group with the largest weight at one of its nodes; nodes without a bone of the group take the nearest node's. Per frame
//! and start a box in the space of x_0 holds the images under B_i^-1 d of all cells that belong to the bone; a start
//! outside is pruned. So if x_d has a root in a cell that matters, all bones this cell belongs to keep their starts.
//!
//! Bound: for x in a cell with nodes k at p_k, d(x) = sum_k share_k A_k x lies in the convex hull of the balls around
//! A_k p_k with radius |A_k| |x - p_k| <= s r_k: s the greatest norm of a bone's linear part, r_k the greatest diagonal of
//! a cell at k. 2 x 2 x 2 nodes share one axis-aligned box around the centres of their balls. Metres.

use xavatar_network::Real;

use crate::affine::{apply, dot, inverse_transform, rotation, subtract};
use crate::baked_warp::Node;
use crate::error::expect_length;
use crate::{BoneTransform, Error, Grid, Result, SparseWeights, StartGroups};

/// Added to the boxes: far above the search's tolerance and the rounding of f32, metres.
const SLACK: f64 = 2e-4;

/// How the cells that matter are shared out among the starts of each group.
#[derive(Clone, Debug)]
pub struct StartRegions<T> {
    groups: StartGroups,
    /// Per cell.
    matters: Vec<bool>,
    clusters: Vec<Cluster<T>>,
    /// Per group (the parts, then the full group) and bone of the group: the bone and its clusters.
    starts: Vec<Vec<(usize, Vec<u32>)>>,
}

/// Up to 2 x 2 x 2 nodes of cells that matter, the last repeated.
#[derive(Clone, Debug)]
struct Cluster<T> {
    nodes: [u32; 8],
    positions: [[T; 3]; 8],
    /// The greatest diagonal of a cell at one of the nodes.
    radius: T,
}

/// The image of a cluster: centre and half extents of a box, and how far beyond it points of the cells may lie.
#[derive(Clone, Copy)]
struct Image<T> {
    centre: [T; 3],
    half: [T; 3],
    radius: T,
}

/// One frame's boxes: where a start may be of use.
#[derive(Clone, Debug)]
pub struct StartBoxes<'a, T> {
    regions: &'a StartRegions<T>,
    /// Per group and bone of the group: lowest and highest corner.
    boxes: Vec<Vec<[[T; 3]; 2]>>,
}

impl<T: Real> StartRegions<T> {
    /// Shares the cells that matter (one flag per cell) out among the starts of `groups`.
    ///
    /// # Errors
    /// If there is not one flag per cell, or the weights have another number of bones than the groups.
    pub(crate) fn new(
        grid: &Grid<T>,
        weights: &SparseWeights<T>,
        groups: &StartGroups,
        matters: &[bool],
    ) -> Result<Self> {
        expect_length("flags of cells", matters.len(), grid.cells())?;
        if weights.joints() != groups.joints() {
            return Err(Error::Skeleton {
                name: "the number of bones of the skinning weights",
                found: weights.joints().to_string(),
                expected: format!("{}, as the start groups have", groups.joints()),
            });
        }
        let cells: Vec<[usize; 8]> =
            (0..grid.cells()).filter(|&cell| matters[cell]).map(|cell| grid.cell_nodes(cell)).collect();
        let (clusters, cluster_of_node) = clusters(grid, &cells);
        let starts = groups.each().map(|bones| {
            let owners = owners(grid, weights, bones);
            let clusters_of = |&bone: &usize| {
                let owned = cells.iter().filter(|nodes| nodes.iter().any(|&node| usize::from(owners[node]) == bone));
                let mut clusters: Vec<u32> = owned.flatten().map(|&node| cluster_of_node[node]).collect();
                clusters.sort_unstable();
                clusters.dedup();
                (bone, clusters)
            };
            bones.iter().map(clusters_of).collect()
        });
        Ok(Self { starts: starts.collect(), groups: groups.clone(), matters: matters.to_vec(), clusters })
    }

    /// The boxes of a frame with these blended transforms at the nodes.
    ///
    /// # Errors
    /// If a bone that starts cannot be inverted.
    pub(crate) fn boxes(&self, nodes: &[Node<T>], bones: &[BoneTransform<T>]) -> Result<StartBoxes<'_, T>> {
        use rayon::prelude::*;
        let stretch = bones.iter().map(|bone| norm(bone)).fold(T::zero(), T::max);
        let images: Vec<_> = self.clusters.par_iter().with_min_len(1024).map(|c| c.image(nodes, stretch)).collect();
        let of_start = |(bone, clusters): &(usize, Vec<u32>)| {
            let inverse = inverse_transform(&bones[*bone]).ok_or_else(|| Error::Skeleton {
                name: "a bone transform",
                found: format!("singular or not finite (bone {bone})"),
                expected: "invertible, as rotations are".to_owned(),
            })?;
            Ok(bounding_box(&inverse, clusters.iter().map(|&cluster| &images[cluster as usize])))
        };
        let boxes = self.starts.par_iter().map(|group| group.par_iter().map(of_start).collect::<Result<_>>());
        Ok(StartBoxes { regions: self, boxes: boxes.collect::<Result<_>>()? })
    }
}

impl<T: Real> StartBoxes<'_, T> {
    /// The groups whose starts the boxes are for.
    pub fn groups(&self) -> &StartGroups {
        &self.regions.groups
    }

    /// The boxes of a group's bones, in their order; `None` for points without a label. Panics if there is no such label.
    pub fn of_group(&self, label: Option<u8>) -> &[[[T; 3]; 2]] {
        &self.boxes[label.map_or(self.boxes.len() - 1, usize::from)]
    }

    pub(crate) fn cell_matters(&self, cell: usize) -> bool {
        self.regions.matters[cell]
    }
}

impl<T: Real> Cluster<T> {
    fn image(&self, nodes: &[Node<T>], stretch: T) -> Image<T> {
        let (mut low, mut high) = ([T::infinity(); 3], [T::neg_infinity(); 3]);
        for (&node, &position) in self.nodes.iter().zip(&self.positions) {
            let image = apply(&nodes[node as usize].transform(), position);
            for axis in 0..3 {
                low[axis] = low[axis].min(image[axis]);
                high[axis] = high[axis].max(image[axis]);
            }
        }
        let half = T::of(0.5);
        Image {
            centre: std::array::from_fn(|axis| half * (low[axis] + high[axis])),
            half: std::array::from_fn(|axis| half * (high[axis] - low[axis])),
            radius: stretch * self.radius,
        }
    }
}

/// The box around the images of clusters under an affine map.
fn bounding_box<'a, T: Real>(map: &BoneTransform<T>, images: impl Iterator<Item = &'a Image<T>>) -> [[T; 3]; 2] {
    let rows = rotation(map);
    let sizes = rows.map(|row| row.map(T::abs));
    let lengths = rows.map(|row| dot(row, row).sqrt());
    let (mut low, mut high) = ([T::infinity(); 3], [T::neg_infinity(); 3]);
    for image in images {
        let centre = apply(map, image.centre);
        for axis in 0..3 {
            let reach = dot(sizes[axis], image.half) + lengths[axis] * image.radius + T::of(SLACK);
            low[axis] = low[axis].min(centre[axis] - reach);
            high[axis] = high[axis].max(centre[axis] + reach);
        }
    }
    [low, high]
}

/// A bound on the norm of the linear part, exact for rotations: |M|^2 <= the greatest row sum of |M^T M|.
fn norm<T: Real>(bone: &BoneTransform<T>) -> T {
    let m = rotation(bone);
    let product = |r: usize, c: usize| (0..3).map(|k| m[k][r] * m[k][c]).sum::<T>().abs();
    (0..3).map(|r| product(r, 0) + product(r, 1) + product(r, 2)).fold(T::zero(), T::max).sqrt()
}

/// Clusters of the nodes of these cells, and the cluster of each node (of those that are in one).
fn clusters<T: Real>(grid: &Grid<T>, cells: &[[usize; 8]]) -> (Vec<Cluster<T>>, Vec<u32>) {
    let [x, y, z] = grid.counts();
    let halves = [x.div_ceil(2), y.div_ceil(2), z.div_ceil(2)];
    let number = |node: usize| {
        let [i, j, k] = [node % x / 2, node / x % y / 2, node / (x * y) / 2];
        i + halves[0] * (j + halves[1] * k)
    };
    let mut radius = vec![T::zero(); grid.len()];
    for nodes in cells {
        let diagonal = subtract(grid.position(nodes[7]), grid.position(nodes[0]));
        let length = dot(diagonal, diagonal).sqrt();
        nodes.iter().for_each(|&node| radius[node] = radius[node].max(length));
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); halves.iter().product()];
    (0..grid.len()).filter(|&node| radius[node] > T::zero()).for_each(|node| members[number(node)].push(node));
    let mut of_node = vec![u32::MAX; grid.len()];
    let mut clusters = Vec::new();
    for nodes in members.iter().filter(|nodes| !nodes.is_empty()) {
        nodes.iter().for_each(|&node| of_node[node] = clusters.len() as u32);
        let member: [usize; 8] = std::array::from_fn(|index| nodes[index.min(nodes.len() - 1)]);
        clusters.push(Cluster {
            nodes: member.map(|node| node as u32),
            positions: member.map(|node| grid.position(node)),
            radius: nodes.iter().map(|&node| radius[node]).fold(T::zero(), T::max),
        });
    }
    (clusters, of_node)
}

/// The bone of `group` with the largest weight at each node or, where none has a weight, at a nearest node (in steps).
fn owners<T: Real>(grid: &Grid<T>, weights: &SparseWeights<T>, group: &[usize]) -> Vec<u8> {
    let counts = grid.counts();
    let mut owners: Vec<Option<u8>> = (0..grid.len())
        .map(|node| {
            let (bones, weights) = weights.row(node);
            let of_group = bones.iter().zip(weights).filter(|(bone, _)| group.contains(&usize::from(**bone)));
            of_group.fold(None, |best, (&bone, &weight)| match best {
                Some((_, most)) if weight <= most => best,
                _ => Some((bone, weight)),
            })
        })
        .map(|best| best.map(|(bone, _)| bone))
        .collect();
    let mut front: Vec<usize> = (0..grid.len()).filter(|&node| owners[node].is_some()).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for node in front {
            let mut stride = 1;
            for count in counts {
                let place = node / stride % count;
                let below = (place > 0).then(|| node - stride);
                let above = (place + 1 < count).then(|| node + stride);
                for neighbour in [below, above].into_iter().flatten() {
                    if owners[neighbour].is_none() {
                        owners[neighbour] = owners[node];
                        next.push(neighbour);
                    }
                }
                stride *= count;
            }
        }
        front = next;
    }
    owners.into_iter().map(|owner| owner.unwrap_or(group[0] as u8)).collect()
}
