//! What readers have to say of a file that they could read, but not wholly.

use std::fmt;

use serde::{Deserialize, Serialize};
use xavatar_formats::excerpt;

use super::Colouring;

/// Something that a file says, or should say, and that is not in what was read of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Note {
    /// What is missing from the result.
    pub lost: Loss,
    /// Which part of the file, why, and what can be done.
    pub why: String,
}

/// What a reader could not take from a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// All colours: the mesh has none.
    Colours,
    /// Colours of some places, or the better ones of two kinds.
    SomeColours,
    /// Normals: those of the faces stand in.
    Normals,
    /// Faces.
    Faces,
    /// What a scan shows besides its subject.
    Surroundings,
    /// Anything else.
    Other,
}

impl Note {
    /// A note that says why.
    pub fn new(lost: Loss, why: impl Into<String>) -> Self {
        Self { lost, why: why.into() }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lost = match self.lost {
            Loss::Colours => "colours are lost",
            Loss::SomeColours => "some colours are lost",
            Loss::Normals => "normals are not used",
            Loss::Faces => "faces are left out",
            Loss::Surroundings => "what is beside the person is left out",
            Loss::Other => "not read",
        };
        write!(formatter, "{lost}: {}", self.why)
    }
}

/// Names of a file, quoted: the first three, and how many others there are.
pub(super) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let mut list = names.iter().take(SHOWN).map(|name| excerpt(name)).collect::<Vec<_>>().join(", ");
    if let Some(others) = names.len().checked_sub(SHOWN).filter(|others| *others > 0) {
        list += &format!(" and {others} more");
    }
    list
}

/// Why colours are lost, as notes: all of them if the mesh ended without any.
pub(super) fn colour_notes(reasons: Vec<String>, colouring: &Colouring) -> impl Iterator<Item = Note> {
    let lost = if matches!(colouring, Colouring::None) { Loss::Colours } else { Loss::SomeColours };
    reasons.into_iter().map(move |why| Note::new(lost, why))
}

/// Why colours are lost: the pictures of these names, if there are any, are not there.
pub(super) fn missing_pictures(names: &[String]) -> Option<String> {
    match names {
        [] => None,
        [name] => Some(format!("the picture {} is not beside the mesh; put it there", excerpt(name))),
        names => Some(format!("the pictures {} are not beside the mesh; put them there", listed(names))),
    }
}

/// A number with what it counts: `1 face`, `2 faces`.
pub(super) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
