//! Part-aware starts (thesis ch. 4.2.3, A.3.2): which bones start the search for a point of which part.
//!
//! A part is a list of bone ids; a label is a part's place in the list. What parts a body has is the caller's knowledge.

use crate::{Error, Result};

/// The bones that start the search, per part label, and for points whose part is unknown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartGroups {
    joints: usize,
    parts: Vec<Vec<usize>>,
    full: Vec<usize>,
}

impl StartGroups {
    /// Groups for a skeleton of `joints` bones: `parts[label]` for labelled points, `full` for unlabelled ones.
    ///
    /// # Errors
    /// If there are more than 256 parts, or a group is empty, names a bone twice or names one that does not exist.
    pub fn new(joints: usize, parts: Vec<Vec<usize>>, full: Vec<usize>) -> Result<Self> {
        if parts.len() > usize::from(u8::MAX) + 1 {
            return Err(Error::Skeleton {
                name: "the number of part groups",
                found: parts.len().to_string(),
                expected: "at most 256, so that a label is one byte".to_owned(),
            });
        }
        for (label, group) in parts.iter().enumerate() {
            validate(joints, group, &format!("part {label}"))?;
        }
        validate(joints, &full, "the full group")?;
        Ok(Self { joints, parts, full })
    }

    /// Every bone starts the search of every point, whatever its label (ablation A2).
    ///
    /// # Errors
    /// If `joints` is zero.
    pub fn all(joints: usize) -> Result<Self> {
        Self::new(joints, Vec::new(), (0..joints).collect())
    }

    /// J: how many bones the skeleton has.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// How many labels there are.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// All groups: the parts in the order of their labels, then the full group.
    pub(crate) fn each(&self) -> impl Iterator<Item = &[usize]> {
        self.parts.iter().chain([&self.full]).map(Vec::as_slice)
    }

    /// The bones that start the search for a point, in order; `None` for a point without a label.
    ///
    /// # Errors
    /// If no part has this label.
    pub fn bones(&self, label: Option<u8>) -> Result<&[usize]> {
        let Some(label) = label else { return Ok(&self.full) };
        self.parts.get(usize::from(label)).map(Vec::as_slice).ok_or_else(|| Error::Skeleton {
            name: "a point's part label",
            found: label.to_string(),
            expected: format!("less than the {} parts of the start groups", self.parts.len()),
        })
    }
}

fn validate(joints: usize, group: &[usize], name: &str) -> Result<()> {
    let mut seen = vec![false; joints];
    let fault = if group.is_empty() {
        Some("empty".to_owned())
    } else {
        group.iter().find_map(|&bone| match seen.get_mut(bone) {
            None => Some(format!("naming bone {bone}")),
            Some(seen) if *seen => Some(format!("naming bone {bone} twice")),
            Some(seen) => {
                *seen = true;
                None
            }
        })
    };
    match fault {
        None => Ok(()),
        Some(fault) => Err(Error::Skeleton {
            name: "a start group",
            found: format!("{fault} ({name})"),
            expected: format!("one or more different bones below {joints}"),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_choose_their_bones_and_unlabelled_points_the_full_group() {
        let groups = StartGroups::new(6, vec![vec![0, 1], vec![5]], vec![0, 1, 5]).expect("valid");
        assert_eq!(groups.bones(Some(1)).expect("a part"), [5]);
        assert_eq!(groups.bones(None).expect("full"), [0, 1, 5]);
        assert_eq!((groups.parts(), groups.joints()), (2, 6));
        assert!(groups.bones(Some(2)).is_err());
    }

    #[test]
    fn groups_that_cannot_start_a_search_are_refused_by_name() {
        for (parts, full, name) in [
            (vec![vec![]], vec![0], "part 0"),
            (vec![vec![0], vec![1, 1]], vec![0], "bone 1 twice (part 1)"),
            (vec![vec![3]], vec![0], "bone 3 (part 0)"),
            (vec![], vec![], "the full group"),
        ] {
            let message = StartGroups::new(3, parts, full).expect_err("invalid").to_string();
            assert!(message.contains(name), "{message}");
        }
        assert!(StartGroups::new(1, vec![vec![0]; 257], vec![0]).is_err());
        assert!(StartGroups::all(0).is_err());
    }
}
