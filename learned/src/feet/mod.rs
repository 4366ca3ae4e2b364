//! Feet that the ground presses (Osman ch. 5; METHOD-BODY section 5): what contact does to a foot's flesh, learned by a network a foot.
//!
//! T'_P = T_P + B_F(f), f = [q_j - q* of the foot's joints | beta_1 beta_2 of its shape | c], c_v = 1 where a vertex is in [`contact`](is_in_contact) with the
//! ground, the plane y = height. Where a body stands c and B_F determine each other: pose -> c -> B_F -> c, some rounds.
//!
//! [`Feet`] are the arrays beside a body's in its file, which other readers pass over; [`FeetTraining`] learns them of registrations,
//! [`SoftGround`] plants such contact in made-up people. F vertices of a foot, V of the body, J joints; metres, Y up.

mod file;
mod foot;
mod ground;
mod network;
mod prints;
mod soft_ground;
mod stance;
mod training;

pub use foot::Foot;
pub use ground::{ground_under, is_in_contact};
pub use soft_ground::SoftGround;
pub use stance::{Feet, Stance};
pub use training::{FeetTraining, TrainedFeet};
