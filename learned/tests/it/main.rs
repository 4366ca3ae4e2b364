//! Bodies that are trained on a made-up population.

mod personal;
mod sparse;
mod tube;
