//! Pictures of meshes without a GPU: a z-buffered, multisampled software rasteriser, and sheets of labelled pictures.
//!
//! Metres; the world is Y up. Pixels count from the top left, pixel (column, row) has its centre at (column + 0.5, row + 0.5).
//! Every picture is a function of its inputs alone: the number of threads changes nothing.

mod camera;
mod png;
mod rasterize;
mod shading;
mod sheet;

pub use camera::{Camera, FRONT, THREE_QUARTER};
pub use png::write_png;
pub use shading::{View, render_depth, render_mesh};
pub use sheet::{Tile, contact_sheet};
