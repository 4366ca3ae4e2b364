//! A vertex's correctives as a convex group lasso over joints (METHOD-BODY D3).
//!
//! minimise 1/2n |X p - y|^2 + lambda sum_j g_j |p_j|, p_j the 4 x 3 block of joint j: of the sums G = X^T X / n, C = X^T y / n. Blocks are solved one
//! after the other, exactly: with G_jj = U diag(d) U^T, p = U (d + kappa / r)^-1 U^T b for the r = |p| that makes it true, or zero where |b| <= kappa =
//! lambda g_j. Only blocks that a step let in are swept, until no other wants in (Karush, Kuhn, Tucker). The optimum is that of any other method; since
//! few blocks are in, a vertex takes some hundred thousand operations.

use nalgebra::{DMatrix, Matrix4, SymmetricEigen};

use super::correctives::{PER_JOINT, VertexBlocks};

/// Sweeps over the blocks that are in.
const SWEEPS: usize = 300;
/// A sweep that moves nothing by more than this share of the largest block was the last.
const CONVERGED: f64 = 1e-7;
/// What is added to the diagonal of least squares on a support, of the mean of the diagonal.
const RIDGE: f64 = 1e-6;

/// A block of directions: (4, 3).
type Block = [[f64; 3]; PER_JOINT];

/// What all vertices share.
pub struct GroupLasso {
    /// G (F, F).
    gram: Vec<f64>,
    features: usize,
    /// Eigenvalues and eigenvectors of each block on G's diagonal.
    diagonals: Vec<(Block4, [f64; PER_JOINT])>,
}

type Block4 = Matrix4<f64>;

/// One vertex.
#[derive(Clone, Copy)]
pub struct GroupProblem<'a> {
    /// n C (F).
    pub crossed: &'a [[f64; 3]],
    /// n.
    pub frames: usize,
    /// What a joint's block costs: lambda g_j, of each group.
    pub prices: &'a [f64],
}

impl GroupLasso {
    /// Of n frames' features: `gram` is n G (F, F).
    pub fn new(gram: &[f64], features: usize, frames: usize) -> Self {
        let gram: Vec<f64> = gram.iter().map(|value| value / frames.max(1) as f64).collect();
        let diagonal = |group: usize| {
            let at = PER_JOINT * group;
            let block = Matrix4::from_fn(|row, column| gram[(at + row) * features + at + column]);
            let eigen = SymmetricEigen::new(block);
            (eigen.eigenvectors, eigen.eigenvalues.map(|value| value.max(0.0)).into())
        };
        let diagonals = (0..features / PER_JOINT).map(diagonal).collect();
        Self { gram, features, diagonals }
    }

    /// How many groups there are.
    pub fn groups(&self) -> usize {
        self.diagonals.len()
    }

    /// The smallest common price at which no block of a vertex is let in, for each price being `weights` times it.
    pub fn highest_price(&self, problem: GroupProblem<'_>, weights: &[f64]) -> f64 {
        let share = 1.0 / problem.frames.max(1) as f64;
        let length = |group: usize| norm(&block(problem.crossed, group, share)) / weights[group];
        (0..self.groups()).map(length).fold(0.0, f64::max)
    }

    /// The blocks of a vertex that are not zero, from `start`.
    pub fn solve(&self, problem: GroupProblem<'_>, start: &[(usize, Block)]) -> Vec<(usize, Block)> {
        let share = 1.0 / problem.frames.max(1) as f64;
        let mut blocks = start.to_vec();
        for _ in 0..=self.groups() {
            self.sweep(problem, share, &mut blocks);
            blocks.retain(|(_, block)| norm(block) > 0.0);
            let is_in = |group: usize| blocks.iter().any(|(of, _)| *of == group);
            let excess = |group: usize| norm(&self.pull(problem, share, &blocks, group)) / problem.prices[group] - 1.0;
            let outside = (0..self.groups()).filter(|group| !is_in(*group)).map(|group| (group, excess(group)));
            let wanting: Vec<usize> =
                outside.filter(|(_, excess)| *excess > CONVERGED).map(|(group, _)| group).collect();
            if wanting.is_empty() {
                break;
            }
            blocks.extend(wanting.into_iter().map(|group| (group, Block::default())));
        }
        blocks.sort_by_key(|(group, _)| *group);
        blocks
    }

    /// The least squares on the groups of a support, of which nothing has a price.
    pub fn refit(&self, crossed: &[[f64; 3]], frames: usize, support: &[usize]) -> Vec<(usize, Block)> {
        let columns: Vec<usize> = support.iter().flat_map(|group| PER_JOINT * group..PER_JOINT * (group + 1)).collect();
        let size = columns.len();
        let mut matrix =
            DMatrix::from_fn(size, size, |row, column| self.gram[columns[row] * self.features + columns[column]]);
        let ridge = RIDGE * matrix.trace() / size.max(1) as f64;
        (0..size).for_each(|place| matrix[(place, place)] += ridge);
        let share = 1.0 / frames.max(1) as f64;
        let right = DMatrix::from_fn(size, 3, |row, axis| crossed[columns[row]][axis] * share);
        let Some(solution) = matrix.cholesky().map(|cholesky| cholesky.solve(&right)) else { return Vec::new() };
        let of_group = |(place, group): (usize, &usize)| {
            let entry = |feature: usize| [0, 1, 2].map(|axis| solution[(PER_JOINT * place + feature, axis)]);
            (*group, std::array::from_fn(entry))
        };
        support.iter().enumerate().map(of_group).collect()
    }

    /// How far a block moves a vertex in these frames, root mean square, metres.
    pub fn effect(&self, group: usize, own: &Block) -> f64 {
        let at = PER_JOINT * group;
        let mut sum = 0.0;
        for (row, one) in own.iter().enumerate() {
            for (column, other) in own.iter().enumerate() {
                let dot: f64 = one.iter().zip(other).map(|(one, other)| one * other).sum();
                sum += self.gram[(at + row) * self.features + at + column] * dot;
            }
        }
        sum.max(0.0).sqrt()
    }

    /// tr(p^T n G p) - 2 tr(p^T n C): what a vertex's blocks change of the sum of squares over these frames.
    pub fn gain(&self, crossed: &[[f64; 3]], frames: usize, blocks: &[(usize, Block)]) -> f64 {
        let none = GroupProblem { crossed, frames, prices: &[] };
        let share = 1.0 / frames.max(1) as f64;
        let of_block = |(group, own): &(usize, Block)| {
            // C - G p and C: p . (G p - 2 C) = -p . ((C - G p) + C).
            let left = self.correlation(none, share, blocks, *group);
            let crossed = block(crossed, *group, share);
            -(dot(own, &left) + dot(own, &crossed))
        };
        frames as f64 * blocks.iter().map(of_block).sum::<f64>()
    }

    fn sweep(&self, problem: GroupProblem<'_>, share: f64, blocks: &mut [(usize, Block)]) {
        for _ in 0..SWEEPS {
            let (mut moved, mut largest) = (0.0_f64, 0.0_f64);
            for place in 0..blocks.len() {
                let group = blocks[place].0;
                let pull = self.pull(problem, share, blocks, group);
                let found = self.exact(group, &pull, problem.prices[group]);
                moved = moved.max(norm(&difference(&found, &blocks[place].1)));
                largest = largest.max(norm(&found));
                blocks[place].1 = found;
            }
            if moved <= CONVERGED * largest {
                break;
            }
        }
    }

    /// C_j - sum_k G_jk p_k over all blocks.
    fn correlation(&self, problem: GroupProblem<'_>, share: f64, blocks: &[(usize, Block)], group: usize) -> Block {
        let mut left = block(problem.crossed, group, share);
        for (other, values) in blocks {
            for (row, left) in left.iter_mut().enumerate() {
                let at = (PER_JOINT * group + row) * self.features + PER_JOINT * other;
                for (weight, value) in self.gram[at..at + PER_JOINT].iter().zip(values) {
                    left.iter_mut().zip(value).for_each(|(left, value)| *left -= weight * value);
                }
            }
        }
        left
    }

    /// What a block is pulled by when it is zero and the others are as they are.
    fn pull(&self, problem: GroupProblem<'_>, share: f64, blocks: &[(usize, Block)], group: usize) -> Block {
        let mut pull = self.correlation(problem, share, blocks, group);
        if let Some((_, own)) = blocks.iter().find(|(of, _)| *of == group) {
            let at = PER_JOINT * group;
            for (row, pull) in pull.iter_mut().enumerate() {
                for (column, value) in own.iter().enumerate() {
                    let weight = self.gram[(at + row) * self.features + at + column];
                    pull.iter_mut().zip(value).for_each(|(pull, value)| *pull += weight * value);
                }
            }
        }
        pull
    }

    /// The block with the smallest tr(p^T G_jj p) / 2 - tr(b^T p) + kappa |p|.
    fn exact(&self, group: usize, pull: &Block, price: f64) -> Block {
        if norm(pull) <= price {
            return Block::default();
        }
        let (vectors, values) = &self.diagonals[group];
        let turned: Block = std::array::from_fn(|row| {
            [0, 1, 2].map(|axis| (0..PER_JOINT).map(|at| vectors[(at, row)] * pull[at][axis]).sum())
        });
        let squares = turned.map(|row| row.iter().map(|value| value * value).sum::<f64>());
        // sum |b_i|^2 / (d_i r + kappa)^2 = 1; the root of its inverse root is found by Newton's steps from the left, which do not overshoot.
        let mut length = 0.0;
        for _ in 0..50 {
            let (mut sum, mut slope) = (0.0, 0.0);
            for (value, square) in values.iter().zip(squares) {
                let scale = value * length + price;
                sum += square / (scale * scale);
                slope += square * value / (scale * scale * scale);
            }
            let step = (sum.sqrt() - 1.0) * sum / slope.max(f64::MIN_POSITIVE);
            length += step;
            if step.abs() <= 1e-13 * length {
                break;
            }
        }
        let scaled: Block = std::array::from_fn(|row| turned[row].map(|value| value / (values[row] + price / length)));
        std::array::from_fn(|row| {
            [0, 1, 2].map(|axis| (0..PER_JOINT).map(|at| vectors[(row, at)] * scaled[at][axis]).sum())
        })
    }
}

/// Blocks as correctives have them.
pub(crate) fn directions(blocks: Vec<(usize, Block)>) -> VertexBlocks {
    blocks.into_iter().map(|(group, block)| (group, block.map(glam::DVec3::from_array))).collect()
}

fn block(crossed: &[[f64; 3]], group: usize, share: f64) -> Block {
    std::array::from_fn(|feature| crossed[PER_JOINT * group + feature].map(|value| value * share))
}

fn dot(one: &Block, other: &Block) -> f64 {
    one.as_flattened().iter().zip(other.as_flattened()).map(|(one, other)| one * other).sum()
}

fn norm(block: &Block) -> f64 {
    dot(block, block).sqrt()
}

fn difference(one: &Block, other: &Block) -> Block {
    std::array::from_fn(|row| std::array::from_fn(|axis| one[row][axis] - other[row][axis]))
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const GROUPS: usize = 6;
    const FRAMES: usize = 80;

    /// Sums over frames of features like quaternions', and of a vertex that groups 1 and 4 correct.
    fn sums() -> (Vec<f64>, Vec<[f64; 3]>) {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut number = |scale: f64| (random.random::<f64>() - 0.5) * scale;
        let (width, scales) = (PER_JOINT * GROUPS, [1.0, 1.0, 1.0, 0.1]);
        let truth: Vec<[f64; 3]> =
            (0..width).map(|at| if at / 4 == 1 || at / 4 == 4 { [0.03, -0.02, 0.05] } else { [0.0; 3] }).collect();
        let (mut gram, mut crossed) = (vec![0.0; width * width], vec![[0.0; 3]; width]);
        for _ in 0..FRAMES {
            let x: Vec<f64> = (0..width).map(|at| number(scales[at % 4])).collect();
            let y = [0, 1, 2].map(|axis| x.iter().zip(&truth).map(|(x, p)| x * p[axis]).sum::<f64>() + number(0.004));
            for (row, one) in x.iter().enumerate() {
                x.iter().enumerate().for_each(|(column, other)| gram[row * width + column] += one * other);
                (0..3).for_each(|axis| crossed[row][axis] += one * y[axis]);
            }
        }
        (gram, crossed)
    }

    // The conditions of Karush, Kuhn and Tucker: C_j - (G p)_j = kappa_j p_j / |p_j| where p_j is not zero, no longer than kappa_j where it is.
    #[test]
    fn what_is_found_is_the_optimum() {
        let (gram, crossed) = sums();
        let lasso = GroupLasso::new(&gram, PER_JOINT * GROUPS, FRAMES);
        let prices: Vec<f64> = (0..GROUPS).map(|group| 2e-4 * (1.0 + group as f64 / 3.0)).collect();
        let problem = GroupProblem { crossed: &crossed, frames: FRAMES, prices: &prices };
        let blocks = lasso.solve(problem, &[]);
        let support: Vec<usize> = blocks.iter().map(|(group, _)| *group).collect();
        assert_eq!(support, [1, 4]);
        for (group, price) in prices.iter().enumerate() {
            let left = lasso.correlation(problem, 1.0 / FRAMES as f64, &blocks, group);
            match blocks.iter().find(|(of, _)| *of == group) {
                None => assert!(norm(&left) <= price * (1.0 + 1e-6)),
                Some((_, block)) => {
                    let wanted = block.map(|row| row.map(|value| price * value / norm(block)));
                    assert!(norm(&difference(&left, &wanted)) < 1e-5 * price, "{group}");
                }
            }
        }
        let highest = lasso.highest_price(problem, &[1.0; GROUPS]);
        let dear = [highest * 1.0001; GROUPS];
        assert!(lasso.solve(GroupProblem { prices: &dear, ..problem }, &[]).is_empty());
        let cheap = [highest * 0.9999; GROUPS];
        assert_eq!(lasso.solve(GroupProblem { prices: &cheap, ..problem }, &[]).len(), 1);
    }

    #[test]
    fn least_squares_on_the_support_gain_the_most_and_as_much_as_is_said() {
        let (gram, crossed) = sums();
        let lasso = GroupLasso::new(&gram, PER_JOINT * GROUPS, FRAMES);
        let fitted = lasso.refit(&crossed, FRAMES, &[1, 4]);
        let gain = lasso.gain(&crossed, FRAMES, &fitted);
        let truth: Vec<(usize, Block)> = [1, 4].map(|group| (group, [[0.03, -0.02, 0.05]; 4])).to_vec();
        assert!(gain < lasso.gain(&crossed, FRAMES, &truth) && gain < 0.0);
        // At the minimum of p . G p - 2 p . C it is -p . C.
        let along: f64 = fitted.iter().map(|(group, own)| dot(own, &block(&crossed, *group, 1.0))).sum();
        assert!((gain + along).abs() < 1e-3 * along);
    }
}
