//! Parts of a body as data of its skeleton: which joints move them, and how each is searched, sampled, refined and measured.

use serde::{Deserialize, Serialize};

/// A part of a body: the place of its [`PartGroup`] among its skeleton's parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Part(pub u8);

impl Part {
    /// The place as an index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// What a part of a body is: its share of the samples, whether it is thin and fine, and the row of the metrics that it counts in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Torso, arms and legs; anything that is neither of the others.
    Body,
    /// Hands: thin and fine, often better registered than scanned.
    Hands,
    /// A face, with the head that it is on.
    Face,
}

impl Role {
    /// The roles of the parts that are finer than the body, in the order of the metrics.
    pub const FINE: [Self; 2] = [Self::Hands, Self::Face];
}

/// One part of a skeleton.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartGroup {
    /// In lower case, words joined by `_`, as in label files: `left_hand`.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// The joints that move it.
    pub joints: Vec<usize>,
    /// The joints that the search for a point of this part starts from (thesis A.3.2): some of `joints`.
    pub starts: Vec<usize>,
    /// What of it is sampled more densely; none if nothing is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<Detail>,
}

impl PartGroup {
    /// The name for people: `left hand`.
    pub fn title(&self) -> String {
        self.name.replace('_', " ")
    }
}

/// The places of a part that are sampled more densely: eyes and mouth.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detail {
    /// As in label files: `eyes_mouth`.
    pub name: String,
    /// The joints of the part whose surface it is, where no label file says more: the eyes.
    pub joints: Vec<usize>,
}
