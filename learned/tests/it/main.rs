//! Bodies that are trained on a made-up population.

mod attributes;
mod blsm;
mod feet;
mod personal;
mod sparse;
mod spiral;
mod tube;
