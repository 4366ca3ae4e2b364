//! MHR's joints, in the order of its arrays, and the joint of SMPL-X that each becomes.
//!
//! The names are public, and not in the file. A joint without one of its own in SMPL-X goes with that of the bone that it twists or lies in.

use std::sync::LazyLock;

use crate::smplx;

/// `NAME JOINT`, a line a joint; `here` where SMPL-X's joint is.
const TABLE: &str = include_str!("joints.txt");

/// Which joints of MHR become which of SMPL-X.
pub(super) struct JointMap {
    pub names: Vec<&'static str>,
    /// The joint of SMPL-X (127).
    pub becomes: Vec<usize>,
    /// The joint of MHR that is where each of SMPL-X's is (55).
    pub at: Vec<usize>,
}

/// The map.
pub(super) fn map() -> &'static JointMap {
    static MAP: LazyLock<JointMap> = LazyLock::new(JointMap::of_table);
    &MAP
}

impl JointMap {
    fn of_table() -> Self {
        let skeleton = smplx::skeleton();
        let mut map = Self { names: Vec::new(), becomes: Vec::new(), at: vec![0; smplx::joint::COUNT] };
        for (index, line) in TABLE.lines().enumerate() {
            let mut words = line.split(' ');
            let (name, joint) = words.next().zip(words.next()).unwrap_or_default();
            let joint = skeleton.joint(joint).unwrap_or_default();
            map.names.push(name);
            map.becomes.push(joint);
            if words.next().is_some() {
                map.at[joint] = index;
            }
        }
        map
    }

    /// The place of a joint in MHR's arrays.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| *own == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_of_smplx_is_where_one_of_its_own_is() {
        let map = map();
        assert_eq!(map.names.len(), 127);
        for (joint, at) in map.at.iter().enumerate() {
            assert_eq!(map.becomes[*at], joint, "{}", smplx::skeleton().joints[joint]);
        }
        assert_eq!(map.names[map.at[smplx::joint::LEFT_WRIST]], "l_wrist");
        assert!(map.names.iter().all(|name| map.joint(name).is_some()));
    }
}
