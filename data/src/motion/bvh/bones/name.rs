//! A bone's name, taken apart: its side, its word, its numbers.
//!
//! A name is split at punctuation, before capitals and between letters and digits; namespaces (`mixamorig:`, `Armature|`) and what
//! all names of a skeleton begin with (`Character1_`, `Bip01 `, `J_Bip_`) are left off. `LeftUpLeg`, `lThigh`, `thigh.L`,
//! `upperleg01.L` and `leftupleg` have the side left and a word for the same joint.

use super::table;

/// A side of the body.
pub(super) const LEFT: &str = "left";
pub(super) const RIGHT: &str = "right";

/// Names that fewer joints than this share a beginning by chance.
const SHARED_BY: f64 = 0.8;
/// Beginnings that only some of a skeleton's names have.
const PREFIXES: [&str; 13] =
    ["def", "org", "mixamorig", "bip", "character", "armature", "skeleton", "avg", "j", "b", "c", "f", "m"];
/// Endings that say what every joint is, or that it is in the middle.
const SUFFIXES: [&str; 6] = ["jnt", "jt", "bind", "bone", "m", "c"];
/// Words for the bones of a finger, from the palm on.
const PHALANXES: [(&str, Phalanx); 5] = [
    ("metacarpal", Phalanx::Metacarpal),
    ("proximal", Phalanx::Proximal),
    ("intermediate", Phalanx::Middle),
    ("medial", Phalanx::Middle),
    ("distal", Phalanx::Distal),
];

/// A bone of a finger, where words say which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phalanx {
    Metacarpal,
    Proximal,
    Middle,
    Distal,
}

/// A bone's name.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Name {
    pub(super) side: Option<&'static str>,
    /// The words between side and numbers, joined, in lower case.
    pub(super) word: String,
    /// The numbers after it, as written.
    pub(super) numbers: Vec<String>,
    pub(super) phalanx: Option<Phalanx>,
}

impl Name {
    /// The names of a skeleton's bones.
    pub(super) fn all<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Self> {
        let mut names: Vec<Vec<String>> = names.map(|name| parts(without_namespace(name))).collect();
        while let Some(shared) = shared_beginning(&names) {
            for name in &mut names {
                if name.first() == Some(&shared) {
                    name.remove(0);
                }
            }
        }
        names.into_iter().map(|parts| Self::of(&parts)).collect()
    }

    fn of(parts: &[String]) -> Self {
        let mut parts = parts;
        while let [first, rest @ ..] = parts
            && !rest.is_empty()
            && PREFIXES.contains(&first.as_str())
        {
            parts = rest;
        }
        if let [rest @ .., last] = parts
            && !rest.is_empty()
            && SUFFIXES.contains(&last.as_str())
        {
            parts = rest;
        }
        let mut name = Self::default();
        for part in parts {
            let phalanx = PHALANXES.iter().find(|(word, _)| word == part).map(|(_, phalanx)| *phalanx);
            match part.as_str() {
                "left" | "l" | "lft" if name.side.is_none() => name.side = Some(LEFT),
                "right" | "r" | "rgt" if name.side.is_none() => name.side = Some(RIGHT),
                part if part.starts_with(|first: char| first.is_ascii_digit()) => {
                    if !name.word.is_empty() {
                        name.numbers.push(part.to_owned());
                    }
                }
                _ if phalanx.is_some() => name.phalanx = phalanx,
                part => name.word.push_str(part),
            }
        }
        if name.side.is_none() {
            name.take_side_off_word();
        }
        name
    }

    /// Names without capitals or punctuation: `leftupleg`, `lshoulder`, `handright`.
    fn take_side_off_word(&mut self) {
        if table::is_middle(&self.word) {
            return;
        }
        for (letters, side) in [(LEFT, LEFT), (RIGHT, RIGHT), ("l", LEFT), ("r", RIGHT)] {
            let after = self.word.strip_prefix(letters);
            let before = self.word.strip_suffix(letters).filter(|_| letters.len() > 1);
            let word = [after, before].into_iter().flatten().find(|word| table::has_side(word)).map(str::to_owned);
            if let Some(word) = word {
                (self.side, self.word) = (Some(side), word);
                return;
            }
        }
    }

    /// The numbers by value: of several bones of one joint, the one of the lowest is meant.
    pub(super) fn rank(&self) -> Vec<u64> {
        self.numbers.iter().map(|number| number.parse().unwrap_or(u64::MAX)).collect()
    }
}

fn without_namespace(name: &str) -> &str {
    name.rsplit([':', '|']).next().unwrap_or(name)
}

/// The first part of nearly all names, if there is one and it is no bone's own.
fn shared_beginning(names: &[Vec<String>]) -> Option<String> {
    let named = names.iter().filter(|parts| !parts.is_empty());
    let (count, first) = (named.clone().count(), named.clone().next()?.first()?);
    let candidates = named.clone().nth(count / 2)?.first()?;
    [first, candidates].into_iter().find_map(|part| {
        let sharing = named.clone().filter(|parts| parts.first() == Some(part)).count();
        // A skeleton of one side has "left" in all of its names.
        let is_own = matches!(part.as_str(), "left" | "l" | "right" | "r") || table::is_middle(part);
        (count > 4 && sharing as f64 >= SHARED_BY * count as f64 && !is_own).then(|| part.clone())
    })
}

/// The parts of a name in lower case, split at punctuation, before capitals, and between letters and digits.
fn parts(name: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut before = ' ';
    let mut characters = name.chars().peekable();
    while let Some(character) = characters.next() {
        let next_is_lower = characters.peek().is_some_and(|next| next.is_lowercase());
        let begins = character.is_uppercase() && (before.is_lowercase() || next_is_lower);
        if begins || character.is_ascii_digit() != before.is_ascii_digit() || !character.is_alphanumeric() {
            parts.push(String::new());
        }
        if let Some(part) = parts.last_mut().filter(|_| character.is_alphanumeric()) {
            part.extend(character.to_lowercase());
        }
        before = character;
    }
    parts.retain(|part| !part.is_empty());
    parts
}
