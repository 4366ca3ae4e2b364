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
use crate::error::expect_length;
use crate::grid::baked_warp::Node;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::softmax_field::{SoftmaxField, generator, vectors};
    use crate::{BakedWeights, SearchSettings, Warp, search};

    const JOINTS: usize = 8;

    /// A chain of bones along x, each turned against its parent; grid and which of its cells are near the chain.
    fn chain() -> (BakedWeights<f64>, Vec<BoneTransform<f64>>, Vec<bool>) {
        let centres: Vec<[f64; 3]> = (0..JOINTS).map(|bone| [0.2 * bone as f64 - 0.7, 0.0, 0.0]).collect();
        let mut bones: Vec<glam::DAffine3> = Vec::new();
        let mut generator = generator(71);
        for centre in &centres {
            let pivot = glam::DVec3::from(*centre) - glam::DVec3::new(0.1, 0.0, 0.0);
            let turn = glam::DQuat::from_scaled_axis(vectors::<f64>(&mut generator, 1, 0.5)[0].into());
            let local = glam::DAffine3::from_translation(pivot)
                * glam::DAffine3::from_quat(turn)
                * glam::DAffine3::from_translation(-pivot);
            bones.push(bones.last().map_or(local, |parent| *parent * local));
        }
        let rows = bones.iter().map(|bone| {
            let (m, t) = (bone.matrix3.transpose().to_cols_array(), bone.translation.to_array());
            std::array::from_fn(|index| if index % 4 == 3 { t[index / 4] } else { m[index / 4 * 3 + index % 4] })
        });
        let grid = Grid::<f64>::regular([-1.0, -0.4, -0.4], [1.0, 0.4, 0.4], [51, 21, 21]).unwrap();
        let near = |cell: usize| {
            let [low, high] = grid.cell_corners(cell);
            let middle = |axis: usize| -> f64 { 0.5 * (low[axis] + high[axis]) };
            middle(0).abs() < 0.9 && middle(1).hypot(middle(2)) < 0.2
        };
        let matters = (0..grid.cells()).map(near).collect();
        let field = SoftmaxField { centres, radius: 0.12 };
        (BakedWeights::sample(&field, grid).unwrap(), rows.collect(), matters)
    }

    fn image(warp: &impl Warp<f64>, point: [f64; 3]) -> [f64; 3] {
        let mut transform = [[0.0; 12]];
        warp.transforms(&mut Default::default(), &[point], &mut transform);
        apply(&transform[0], point)
    }

    #[test]
    fn every_owner_of_a_roots_cell_keeps_its_start() {
        let (mut baked, bones, matters) = chain();
        // The second part's bones have no weight in most cells.
        let groups = StartGroups::new(JOINTS, vec![(0..JOINTS).collect(), vec![6, 7]], vec![1, 4]).unwrap();
        baked.prune_starts(&groups, &matters).unwrap();
        let offsets: Vec<[f64; 3]> = vectors(&mut generator(72), baked.grid().len(), 0.02);
        let warp = baked.warp(&bones, Some(&offsets)).unwrap();
        let boxes = warp.start_boxes().expect("boxes of the frame");
        let points: Vec<[f64; 3]> = vectors(&mut generator(73), 20_000, 0.95);
        let mut tried = 0;
        for point in points.into_iter().map(|[x, y, z]| [x, 0.3 * y, 0.3 * z]).filter(|&point| warp.matters(point)) {
            let target = image(&warp, point);
            let nodes = baked.grid().cell_nodes(baked.grid().cell_number(point).expect("in the box"));
            for (label, group) in [(Some(0), 0), (Some(1), 1), (None, 2)] {
                let names = groups.bones(label).unwrap();
                let owners = owners(baked.grid(), baked.weights(), names);
                for owner in nodes.map(|node| usize::from(owners[node])) {
                    let place = names.iter().position(|&bone| bone == owner).expect("of the group");
                    let start = apply(&inverse_transform(&bones[owner]).expect("a rotation"), target);
                    let [low, high] = boxes.boxes[group][place];
                    assert!((0..3).all(|axis| low[axis] <= start[axis] && start[axis] <= high[axis]));
                }
            }
            tried += 1;
            if tried == 300 {
                return;
            }
        }
        panic!("{tried} points are too few");
    }

    #[test]
    fn pruned_searches_find_the_roots_that_matter_with_fewer_starts() {
        let (mut baked, bones, matters) = chain();
        let groups = StartGroups::all(JOINTS).unwrap();
        let canonical =
            vectors::<f64>(&mut generator(74), 2000, 0.85).into_iter().map(|[x, y, z]| [x, 0.2 * y, 0.2 * z]);
        let settings = SearchSettings::default();
        let (points, full) = {
            let warp = baked.warp(&bones, None).unwrap();
            let points: Vec<_> = canonical.map(|point| image(&warp, point)).collect();
            let full = search(&warp, &groups, &points, None, &settings).unwrap();
            (points, full)
        };
        baked.prune_starts(&groups, &matters).unwrap();
        let warp = baked.warp(&bones, None).unwrap();
        let pruned = search(&warp, &groups, &points, None, &settings).unwrap();
        let (mut known, mut found) = (0, 0);
        for point in 0..points.len() {
            for root in full.range(point).filter(|&root| warp.matters(full.points[root])) {
                let same = |other: usize| {
                    let gap = subtract(full.points[root], pruned.points[other]);
                    dot(gap, gap) < 1e-6
                };
                known += 1;
                found += usize::from(pruned.range(point).any(same));
            }
        }
        let s = pruned.statistics;
        println!("{found} of {known} roots with {} starts, {} pruned, {} immaterial", s.starts, s.pruned, s.immaterial);
        assert!(known > 1500 && found * 1000 >= known * 995, "{found} of {known} roots");
        assert!(s.starts + s.pruned == full.statistics.starts && s.pruned * 2 > full.statistics.starts, "{s:?}");
        assert!(pruned.points.iter().all(|&point| warp.matters(point)));
        let other = StartGroups::new(JOINTS, Vec::new(), vec![0]).unwrap();
        assert!(search(&warp, &other, &points, None, &settings).is_err());
    }
}
