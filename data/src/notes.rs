//! What reading a subject's scans lost, in as few lines as there are kinds of loss.

use std::collections::BTreeMap;
use std::fmt::Display;

use xavatar_mesh::{Loss, Note};

/// Notes on many frames by what was lost: the first of each kind, and how many frames have another.
#[derive(Clone, Debug, Default)]
pub struct FrameNotes {
    kinds: BTreeMap<Loss, Kind>,
}

#[derive(Clone, Debug)]
struct Kind {
    first: String,
    note: Note,
    others: usize,
}

impl FrameNotes {
    /// Adds what is noted of a frame.
    pub fn add(&mut self, frame: &impl Display, notes: &[Note]) {
        let mut lost: Vec<&Note> = notes.iter().collect();
        lost.sort_by_key(|note| note.lost);
        lost.dedup_by_key(|note| note.lost);
        for note in lost {
            self.kinds.entry(note.lost).and_modify(|kind| kind.others += 1).or_insert_with(|| Kind {
                first: frame.to_string(),
                note: note.clone(),
                others: 0,
            });
        }
    }

    /// One line a kind: `train/Take1/f00001 and 11 others: colours are lost: ...`.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.kinds.values().map(|Kind { first, note, others }| match others {
            0 => format!("{first}: {note}"),
            1 => format!("{first} and 1 other: {note}"),
            others => format!("{first} and {others} others: {note}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameId;

    #[test]
    fn each_kind_is_said_once_with_the_number_of_frames() {
        let id = |number| FrameId { split: "train".into(), sequence: "Take1".into(), number };
        let note = |lost, why: &str| Note { lost, why: why.into() };
        let mut notes = FrameNotes::default();
        notes.add(&id(1), &[note(Loss::Faces, "one"), note(Loss::Colours, "a.png"), note(Loss::Faces, "two")]);
        notes.add(&id(2), &[note(Loss::Colours, "b.png")]);
        notes.add(&id(3), &[]);
        let lines: Vec<String> = notes.lines().collect();
        assert_eq!(
            lines,
            ["train/Take1/f00001 and 1 other: colours are lost: a.png", "train/Take1/f00001: faces are left out: one"]
        );
    }
}
