//! Files that users have, sound and damaged.

mod check;
mod damaged_files;
mod hostile_files;
mod meshes;
mod motion;
mod motion_bvh;
mod mutated_files;
mod official;
mod pickle;
mod rgbd;
mod subjects;
mod xhumans;
