//! The table of targets: a reader, and small sound files to begin with.

mod arrays;
mod avatars;
mod bodies;
mod folders;
mod landmarks;
mod meshes;
mod motions;
mod pictures;
mod requests;
mod settings;

/// A reader of untrusted bytes.
pub struct Target {
    /// As cargo-fuzz and `corpus/` name it.
    pub name: &'static str,
    /// Reads; whether it had nothing to refuse.
    pub read: fn(&[u8]) -> bool,
    /// Files that it reads.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All of them.
pub const TARGETS: &[Target] = &[
    Target { name: "npy", read: arrays::npy, seeds: arrays::npy_seeds },
    Target { name: "npz", read: arrays::npz, seeds: arrays::npz_seeds },
    Target { name: "npz_member", read: arrays::npz_member, seeds: arrays::npz_member_seeds },
    Target { name: "pickle", read: arrays::pickle, seeds: arrays::pickle_seeds },
    Target { name: "torch", read: arrays::torch, seeds: arrays::torch_seeds },
    Target { name: "torch_pickle", read: arrays::torch_pickle, seeds: arrays::torch_pickle_seeds },
    Target { name: "safetensors", read: arrays::safetensors, seeds: arrays::safetensors_seeds },
    Target { name: "picture", read: pictures::picture, seeds: pictures::picture_seeds },
    Target { name: "png", read: pictures::png, seeds: pictures::png_seeds },
    Target { name: "depth", read: pictures::depth, seeds: pictures::depth_seeds },
    Target { name: "ply", read: meshes::ply, seeds: meshes::ply_seeds },
    Target { name: "obj", read: meshes::obj, seeds: meshes::obj_seeds },
    Target { name: "glb", read: meshes::glb, seeds: meshes::glb_seeds },
    Target { name: "glb_chunks", read: meshes::glb_chunks, seeds: meshes::glb_chunks_seeds },
    Target { name: "motion", read: motions::motion, seeds: motions::motion_seeds },
    Target { name: "bvh", read: motions::bvh, seeds: motions::bvh_seeds },
    Target { name: "avatar", read: avatars::avatar, seeds: avatars::avatar_seeds },
    Target { name: "avatar_texts", read: avatars::avatar_texts, seeds: avatars::avatar_texts_seeds },
    Target { name: "body", read: bodies::body, seeds: bodies::body_seeds },
    Target { name: "blsm", read: bodies::blsm, seeds: bodies::blsm_seeds },
    Target { name: "feet", read: bodies::feet, seeds: bodies::feet_seeds },
    Target { name: "subject", read: folders::subject, seeds: folders::subject_seeds },
    Target { name: "cameras", read: folders::cameras, seeds: folders::cameras_seeds },
    Target { name: "rgbd_layout", read: folders::rgbd_layout, seeds: folders::rgbd_layout_seeds },
    Target { name: "config", read: settings::config, seeds: settings::config_seeds },
    Target { name: "manifest", read: settings::manifest, seeds: settings::manifest_seeds },
    Target { name: "manifest_table", read: settings::manifest_table, seeds: settings::manifest_table_seeds },
    Target { name: "landmarks", read: landmarks::landmarks, seeds: landmarks::landmarks_seeds },
    Target { name: "network", read: landmarks::network, seeds: landmarks::network_seeds },
    Target { name: "request", read: requests::request, seeds: requests::request_seeds },
    Target { name: "pose", read: requests::pose, seeds: requests::pose_seeds },
    Target { name: "mesh_message", read: requests::mesh_message, seeds: requests::mesh_message_seeds },
];

/// Lets the target of this name read; nothing if there is none.
pub fn run(name: &str, bytes: &[u8]) {
    if let Some(target) = TARGETS.iter().find(|target| target.name == name) {
        (target.read)(bytes);
    }
}
