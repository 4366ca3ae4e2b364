//! Pictures of meshes without a GPU: a z-buffered, anti-aliased software rasteriser, sheets of labelled pictures, and plots.
//!
//! Metres; the world is Y up. Every picture is a function of its inputs alone: the number of threads changes nothing.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod camera_bounds;
mod colour_map;
mod film;
mod floor;
mod legend;
mod light;
mod occlusion;
mod png;
mod projection;
mod rasterize;
mod rgbd;
mod scene;
mod sheet;
mod text;

pub use colour_map::{ColourMap, NAMED_COLOURS, joint_colours, weight_colours};
pub use film::{Film, FilmFormat};
pub use legend::{with_names, with_scale};
pub use light::Light;
pub use png::write_png;
pub use rgbd::{RgbdImage, SeenPoint, render_depth, render_points, render_rgbd};
pub use scene::{Scene, View, render_mesh};
pub use sheet::{Tile, contact_sheet};
