//! How sparse correctives are, judged by frames that were held out (METHOD-BODY D2, section 16).
//!
//! On some vertices the group lasso is solved for prices from the one at which nothing is let in down, each support again by least squares, and again
//! without blocks that move the vertex by less than a threshold. Of price and threshold the sparsest pair is taken whose error on the held-out frames is
//! within one standard error of the smallest. Dense correctives are ridge regression, its price chosen alike. V vertices; metres.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::correctives::{PER_JOINT, SparseCorrectives};
use super::group_lasso::{GroupLasso, directions};
use super::moments::Moments;

/// Vertices that the choice is made on.
const JUDGES: usize = 400;
/// Prices that are tried, each a factor below the one before.
const PRICES: usize = 14;
const FACTOR: f64 = 0.6;
/// Thresholds that are tried, metres root mean square.
const THRESHOLDS: [f64; 8] = [0.0, 1e-4, 2e-4, 3.5e-4, 5e-4, 8e-4, 1.2e-3, 2e-3];
/// A joint's own ring costs this much, of a vertex at the mean distance.
const NEAREST: f64 = 0.1;
/// Ridge prices that are tried, of the mean of the diagonal.
const RIDGES: [f64; 7] = [1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 1.0];

/// What correctives a body gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// None: linear blend skinning alone.
    Plain,
    /// Of every vertex by every joint, by ridge regression: as SMPL's are.
    Dense,
    /// The group lasso's.
    Sparse,
}

/// The correctives that were chosen, and why.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// Fitted to the frames that are not held out.
    pub correctives: SparseCorrectives,
    /// The group lasso's price, or the ridge's.
    pub price: f64,
    /// Blocks that move less are none, metres.
    pub threshold: f64,
}

/// The correctives that do best on `held` frames, fitted to `trained` ones alone, so that rounds are judged by frames that nothing was fitted to. `distances` (groups, V) say how far
/// joints are; what is chosen for sparse ones is then multiplied by `strictness`.
pub fn chosen(kind: Kind, trained: &Moments, held: &Moments, distances: &[Vec<f64>], strictness: f64) -> Chosen {
    let vertices = trained.squares.len();
    let none = Chosen { correctives: SparseCorrectives::none(vertices), price: f64::INFINITY, threshold: 0.0 };
    if trained.frames < 2 {
        return none;
    }
    match kind {
        Kind::Plain => none,
        Kind::Dense => dense(trained, held),
        Kind::Sparse => sparse(trained, held, &prices(distances, vertices), strictness),
    }
}

/// What each group costs each vertex (V, groups): the distance over the joint's mean.
fn prices(distances: &[Vec<f64>], vertices: usize) -> Vec<Vec<f64>> {
    let mean = |row: &Vec<f64>| row.iter().sum::<f64>() / vertices.max(1) as f64;
    let means: Vec<f64> = distances.iter().map(mean).collect();
    let price = |vertex: usize| {
        distances.iter().zip(&means).map(|(row, mean)| NEAREST + row[vertex] / mean.max(f64::MIN_POSITIVE)).collect()
    };
    (0..vertices).map(price).collect()
}

fn sparse(trained: &Moments, held: &Moments, prices: &[Vec<f64>], strictness: f64) -> Chosen {
    let lasso = GroupLasso::new(&trained.gram, trained.features, trained.frames);
    let judge = GroupLasso::new(&held.gram, held.features, held.frames);
    let judges: Vec<usize> = judges(prices.len());
    let highest = judges
        .par_iter()
        .map(|vertex| lasso.highest_price(trained.problem(*vertex, &prices[*vertex]), &prices[*vertex]))
        .reduce(|| 0.0, f64::max);
    let path: Vec<f64> = (1..=PRICES as i32).map(|step| highest * FACTOR.powi(step)).collect();
    // Of each judge, what every price and threshold leaves of its held-out squares.
    let errors = |vertex: &usize| -> Vec<f64> {
        let mut blocks = Vec::new();
        let mut errors = Vec::with_capacity(path.len() * THRESHOLDS.len());
        for price in &path {
            let own: Vec<f64> = prices[*vertex].iter().map(|weight| weight * price).collect();
            blocks = lasso.solve(trained.problem(*vertex, &own), &blocks);
            let support: Vec<usize> = blocks.iter().map(|(group, _)| *group).collect();
            let full = lasso.refit(trained.crossed(*vertex), trained.frames, &support);
            for threshold in THRESHOLDS {
                let kept = pruned(&lasso, trained, *vertex, &full, threshold);
                errors.push(held.squares[*vertex] + judge.gain(held.crossed(*vertex), held.frames, &kept));
            }
        }
        errors
    };
    let errors: Vec<Vec<f64>> = judges.par_iter().map(errors).collect();
    // Sparser pairs come first: higher prices, then higher thresholds.
    let order: Vec<usize> = (0..path.len())
        .flat_map(|price| (0..THRESHOLDS.len()).rev().map(move |threshold| price * THRESHOLDS.len() + threshold))
        .collect();
    let pick = within_one_error(&errors, &order);
    let (price, threshold) =
        (strictness * path[pick / THRESHOLDS.len()], strictness * THRESHOLDS[pick % THRESHOLDS.len()]);
    let of_vertex = |vertex: usize| {
        let own: Vec<f64> = prices[vertex].iter().map(|weight| weight * price).collect();
        let blocks = lasso.solve(trained.problem(vertex, &own), &[]);
        let support: Vec<usize> = blocks.iter().map(|(group, _)| *group).collect();
        let full = lasso.refit(trained.crossed(vertex), trained.frames, &support);
        directions(pruned(&lasso, trained, vertex, &full, threshold))
    };
    let vertices = (0..prices.len()).into_par_iter().map(of_vertex).collect();
    Chosen { correctives: SparseCorrectives { vertices }, price, threshold }
}

/// The blocks that move a vertex by more than a threshold, fitted without the others.
fn pruned(
    lasso: &GroupLasso,
    moments: &Moments,
    vertex: usize,
    blocks: &[(usize, [[f64; 3]; PER_JOINT])],
    threshold: f64,
) -> Vec<(usize, [[f64; 3]; PER_JOINT])> {
    let moves = |(group, block): &&(usize, [[f64; 3]; PER_JOINT])| lasso.effect(*group, block) >= threshold;
    let support: Vec<usize> = blocks.iter().filter(moves).map(|(group, _)| *group).collect();
    match support.len() == blocks.len() {
        true => blocks.to_vec(),
        false => lasso.refit(moments.crossed(vertex), moments.frames, &support),
    }
}

/// Of choices in their order the first whose errors (judges, choices) are on average within one standard error of the best one's.
fn within_one_error(errors: &[Vec<f64>], order: &[usize]) -> usize {
    let mean = |choice: usize| errors.iter().map(|row| row[choice]).sum::<f64>() / errors.len().max(1) as f64;
    let best = order.iter().copied().min_by(|one, other| mean(*one).total_cmp(&mean(*other))).unwrap_or_default();
    let is_near = |choice: usize| {
        let excess: Vec<f64> = errors.iter().map(|row| row[choice] - row[best]).collect();
        let count = excess.len().max(2) as f64;
        let average = excess.iter().sum::<f64>() / count;
        let variance = excess.iter().map(|value| (value - average).powi(2)).sum::<f64>() / (count - 1.0);
        average <= (variance / count).sqrt()
    };
    order.iter().copied().find(|choice| is_near(*choice)).unwrap_or(best)
}

/// Vertices spread over all.
fn judges(vertices: usize) -> Vec<usize> {
    (0..vertices).step_by(vertices.div_ceil(JUDGES).max(1)).collect()
}

fn dense(trained: &Moments, held: &Moments) -> Chosen {
    let judges = judges(trained.squares.len());
    let ridge = |share: f64| {
        let width = trained.features;
        let mut matrix = DMatrix::from_row_slice(width, width, &trained.gram);
        let added = share * matrix.trace() / width as f64;
        (0..width).for_each(|place| matrix[(place, place)] += added);
        matrix.cholesky()
    };
    let solved = |cholesky: &nalgebra::Cholesky<f64, nalgebra::Dyn>, vertex: usize| {
        let crossed = trained.crossed(vertex);
        let columns = [0, 1, 2].map(|axis| DVector::from_iterator(crossed.len(), crossed.iter().map(|row| row[axis])));
        let solution = columns.map(|column| cholesky.solve(&column));
        let block =
            |group: usize| std::array::from_fn(|row| [0, 1, 2].map(|axis| solution[axis][PER_JOINT * group + row]));
        (0..crossed.len() / PER_JOINT).map(|group| (group, block(group))).collect::<Vec<_>>()
    };
    let judge = GroupLasso::new(&held.gram, held.features, held.frames);
    let error = |share: &f64| -> f64 {
        let Some(cholesky) = ridge(*share) else { return f64::INFINITY };
        let of_vertex = |vertex: &usize| judge.gain(held.crossed(*vertex), held.frames, &solved(&cholesky, *vertex));
        judges.par_iter().map(of_vertex).collect::<Vec<f64>>().iter().sum()
    };
    let best = RIDGES.into_iter().min_by(|one, other| error(one).total_cmp(&error(other))).unwrap_or(1.0);
    let count = trained.squares.len();
    let vertices = match ridge(best) {
        Some(cholesky) => (0..count).into_par_iter().map(|vertex| directions(solved(&cholesky, vertex))).collect(),
        None => vec![Vec::new(); count],
    };
    Chosen { correctives: SparseCorrectives { vertices }, price: best, threshold: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sparsest_choice_that_is_as_good_is_taken() {
        // The last is best, the second within the scatter of judges, the first is not.
        let errors: Vec<Vec<f64>> = (0..8).map(|judge| vec![5.0, 1.0 + f64::from(judge % 2) * 0.2, 1.09]).collect();
        assert_eq!(within_one_error(&errors, &[0, 1, 2]), 1);
    }
}
