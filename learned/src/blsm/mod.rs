//! BLSM, bodies whose bones and flesh are apart (Wang ch. 5; METHOD-BODY section 9): bone lengths stretch what hangs on them, shapes are what is left.
//!
//! b = mean + c_b P_b are scales of bones, V = template + c_b P_bc + c_s P_s the flesh at rest, R_j the joints' turns by atoms of limited range;
//! v = sum_j w_j A_j(b, R) V. [`ScaledSkeleton`] makes A, [`Atoms`] R, [`BlsmBody`] is all of it, with its file and exact derivatives;
//! [`BlsmFit`] finds the parameters of a registration; [`SpiralBody`] has flesh of a network. J joints, V vertices, A atoms, K bone modes, S shapes; metres, radians.

mod atoms;
mod bent;
mod body;
mod bones;
mod derivatives;
mod file;
mod first_turns;
mod fit;
mod fleshed_body;
mod own_bones;
mod parameters_file;
mod people_bones;
mod population;
mod posing;
mod shared;
mod skeleton;
mod spiral_body;
mod state;
mod takes;
mod training;
mod whole_bodies;

pub use atoms::{Atom, Atoms};
pub use body::{BlsmBody, BlsmParameters, PosedBlsm};
pub use bones::{BoneModes, bone_modes};
pub use derivatives::Columns;
pub use fit::{BlsmFit, Free};
pub use fleshed_body::FleshedBody;
pub use population::BlsmPopulation;
pub use skeleton::{PosedSkeleton, ScaledSkeleton};
pub use spiral_body::{SpiralBody, SpiralTraining};
pub use training::{BlsmTraining, TrainedBlsm};
pub use whole_bodies::whole_bodies;
