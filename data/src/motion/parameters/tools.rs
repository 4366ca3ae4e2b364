//! Tools whose files say by their names what they are, and what their numbers mean (docs/motion.md has the table).

use crate::motion::{Coordinates, UpAxis};

/// A tool's conventions.
#[derive(Debug, PartialEq)]
pub(super) struct Tool {
    /// Its name, as the table has it.
    pub(super) name: &'static str,
    /// Names that its files have beside the pose, one of each.
    marks: &'static [&'static [&'static str]],
    /// The world's axis that is up, if its files have a motion in a world's coordinates.
    pub(super) up: UpAxis,
    /// What plain numbers are relative to.
    pub(super) plain: Coordinates,
    /// Whether that is so in every file, so that a body that lies is not taken for a world that does.
    pub(super) is_certain: bool,
    /// Frames a second, where the tool has one rate.
    pub(super) rate: Option<f32>,
    /// Whether the vectors of hands that have arrays of their own are absolute.
    pub(super) flat_hands: bool,
    /// Whether those of hands in a whole pose are.
    pub(super) whole_poses_are_flat: bool,
    /// Whether the rows of an array are people, not frames.
    pub(super) rows_are_people: bool,
}

const ANY: Tool = Tool {
    name: "SMPL-X parameters",
    marks: &[],
    up: UpAxis::Y,
    plain: Coordinates::Camera,
    is_certain: false,
    rate: None,
    flat_hands: false,
    whole_poses_are_flat: true,
    rows_are_people: false,
};

/// The tools, those of more particular names first.
pub(super) const TOOLS: [Tool; 15] = [
    Tool { name: "WHAM", marks: &[&["pose_world"], &["trans_world"]], is_certain: true, ..ANY },
    Tool { name: "GLAMR", marks: &[&["smpl_orient_world", "smpl_orient_cam"]], up: UpAxis::Z, is_certain: true, ..ANY },
    Tool {
        name: "GVHMR",
        marks: &[&["smpl_params_global.body_pose"], &["smpl_params_incam.body_pose"]],
        is_certain: true,
        rate: Some(30.0),
        ..ANY
    },
    Tool {
        name: "AIST++",
        marks: &[&["smpl_poses"], &["smpl_trans"]],
        plain: Coordinates::World,
        is_certain: true,
        rate: Some(60.0),
        ..ANY
    },
    Tool { name: "EasyMocap", marks: &[&["Rh"], &["Th"]], up: UpAxis::Z, plain: Coordinates::World, ..ANY },
    Tool {
        name: "Motion-X",
        marks: &[&["face_shape"], &["pose_hand"]],
        plain: Coordinates::World,
        rate: Some(30.0),
        flat_hands: true,
        ..ANY
    },
    Tool {
        name: "BEAT2",
        marks: &[&["expressions"], &["poses"]],
        plain: Coordinates::World,
        is_certain: true,
        whole_poses_are_flat: false,
        ..ANY
    },
    Tool { name: "4D-Humans (PHALP)", marks: &[&["tid"], &["tracked_ids", "camera"]], is_certain: true, ..ANY },
    Tool {
        name: "ROMP",
        marks: &[&["center_confs", "center_preds"], &["cam"]],
        is_certain: true,
        rows_are_people: true,
        ..ANY
    },
    Tool { name: "VIBE", marks: &[&["pred_cam", "orig_cam"], &["pose"]], is_certain: true, ..ANY },
    Tool { name: "HybrIK", marks: &[&["pred_thetas", "pred_theta_mats"]], is_certain: true, ..ANY },
    Tool { name: "TRAM", marks: &[&["pred_rotmat"]], is_certain: true, ..ANY },
    Tool { name: "SMPLify-X", marks: &[&["camera_rotation"], &["camera_translation"]], is_certain: true, ..ANY },
    // AMASS's names without its frame rate.
    Tool { name: "SMPL poses", marks: &[&["poses"], &["trans"]], up: UpAxis::Z, plain: Coordinates::World, ..ANY },
    ANY,
];

impl Tool {
    /// The tool of a file in which these names are.
    pub(super) fn of(has: impl Fn(&str) -> bool) -> &'static Self {
        let has_marks = |tool: &&Tool| tool.marks.iter().all(|names| names.iter().any(|name| has(name)));
        // The last has no marks.
        TOOLS.iter().find(has_marks).unwrap_or(&TOOLS[TOOLS.len() - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::parameters::names;

    const DOCUMENT: &str = include_str!("../../../../docs/motion.md");

    #[test]
    fn tools_are_told_by_what_their_files_have() {
        let of = |names: &[&str]| Tool::of(|name| names.contains(&name)).name;
        assert_eq!(of(&["pose", "trans", "pose_world", "trans_world", "betas"]), "WHAM");
        assert_eq!(of(&["pose", "pred_cam", "orig_cam", "betas"]), "VIBE");
        assert_eq!(of(&["smpl_thetas", "cam", "center_confs", "global_orient", "body_pose"]), "ROMP");
        assert_eq!(of(&["poses", "Rh", "Th", "shapes", "id"]), "EasyMocap");
        assert_eq!(of(&["poses", "trans", "betas", "gender"]), "SMPL poses");
        assert_eq!(of(&["pose", "trans", "betas"]), "SMPL-X parameters");
    }

    #[test]
    fn the_document_has_every_tool_and_every_name() {
        for tool in &TOOLS {
            assert!(DOCUMENT.contains(&format!("\n| {}", tool.name)), "{}", tool.name);
        }
        let right = |name: &str| name.contains("right") || name.contains("rhand") || name.contains("reye");
        let lists = [
            names::BODY,
            names::POSE,
            names::ROOT,
            names::LEFT_HAND,
            names::HANDS,
            names::JAW,
            names::LEFT_EYE,
            names::EXPRESSION,
            names::BETAS,
            names::TRANSLATION,
        ];
        for (name, _) in lists.into_iter().flatten().filter(|(name, _)| !right(name)) {
            assert!(DOCUMENT.contains(&format!("`{name}`")), "{name}");
        }
        assert!(names::RATE.iter().all(|name| DOCUMENT.contains(&format!("`{name}`"))));
    }
}
