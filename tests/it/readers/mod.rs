//! Files that users have, sound and damaged.

mod check;
mod damaged_files;
mod hostile_files;
mod motion;
mod motion_bvh;
mod official;
mod pickle;
mod rgbd;
mod xhumans;
