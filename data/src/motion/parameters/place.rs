//! Where in a file a set of parameters stands: whose they are, which frames, and relative to what.
//!
//! A set's arrays have one prefix. Its numbers in brackets are a list's items, in order; of sets that stand under a picture's name
//! they are people, and the name is the frame. Words such as `incam` and `global` say what the numbers are relative to.

use xavatar_formats::{Array, ArrayMap};

use crate::motion::Coordinates;

const PICTURES: [&str; 6] = [".jpg.", ".jpeg.", ".png.", ".bmp.", ".webp.", ".tif."];

/// A set of parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place<'a> {
    pub(super) prefix: &'a str,
    /// What the sets of one person have in common.
    pub(super) person: String,
    /// Sets of one person are in the order of these.
    pub(super) order: Vec<u64>,
    pub(super) coordinates: Option<Coordinates>,
    /// The prefix of what is said of the picture, and the person's item in its lists.
    pub(super) picture: Option<(&'a str, usize)>,
    /// Whether the file tells people apart from picture to picture.
    pub(super) is_tracked: bool,
}

impl<'a> Place<'a> {
    pub(super) fn of(prefix: &'a str, arrays: &ArrayMap) -> Self {
        let coordinates = coordinates(prefix);
        if let Some((picture, rest)) = after_picture(prefix) {
            let item = items(rest).first().map_or(0, |item| *item as usize);
            let tracked = numbers(arrays.get(&format!("{picture}tid")));
            let person = tracked.get(item).map_or_else(|| format!("item {item}"), |id| format!("person {id}"));
            let name = picture.trim_end_matches('.').rsplit(['/', '\\']).next().unwrap_or(picture);
            return Self {
                prefix,
                person,
                order: digits(name),
                coordinates,
                picture: Some((picture, item)),
                is_tracked: !tracked.is_empty(),
            };
        }
        let id =
            ["id", "track_id"].iter().find_map(|name| numbers(arrays.get(&format!("{prefix}{name}"))).first().copied());
        let person = id.map_or_else(|| without_items(prefix), |id| format!("{}person {id}", without_items(prefix)));
        Self { prefix, person, order: items(prefix), coordinates, picture: None, is_tracked: id.is_some() }
    }
}

/// What words in a prefix say.
fn coordinates(prefix: &str) -> Option<Coordinates> {
    let words = prefix.split(|character: char| !character.is_ascii_alphanumeric());
    words.rev().find_map(|word| match word {
        "incam" | "cam" | "camera" => Some(Coordinates::Camera),
        "global" | "world" => Some(Coordinates::World),
        _ => None,
    })
}

/// A prefix with a picture's name in it, cut after that.
fn after_picture(prefix: &str) -> Option<(&str, &str)> {
    let lower = prefix.to_ascii_lowercase();
    let end = PICTURES.iter().filter_map(|ending| Some(lower.rfind(ending)? + ending.len())).max()?;
    prefix.split_at_checked(end)
}

/// The numbers of all items in brackets.
fn items(prefix: &str) -> Vec<u64> {
    prefix.split('[').skip(1).filter_map(|part| part.split(']').next()?.parse().ok()).collect()
}

/// The prefix with its item numbers taken out: `results[].smplx.`.
fn without_items(prefix: &str) -> String {
    let mut shown = String::new();
    let mut inside = false;
    for character in prefix.chars() {
        inside = (inside && character != ']') || character == '[';
        if !inside || character == '[' {
            shown.push(character);
        }
    }
    shown
}

/// All numbers in a name.
fn digits(name: &str) -> Vec<u64> {
    name.split(|character: char| !character.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

fn numbers(array: Option<&Array>) -> Vec<i64> {
    array.and_then(Array::to_f64).unwrap_or_default().into_iter().map(|number| number as i64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_tell_whose_which_and_relative_to_what() {
        let tracks = Array::from_f32(&[2], vec![7.0, 3.0]);
        let id = Array::from_f32(&[], vec![5.0]);
        let arrays = [("out/img/000012.jpg.tid".to_owned(), tracks), ("[1].id".to_owned(), id)].into();
        let of = |prefix: &'static str| {
            let place = Place::of(prefix, &arrays);
            (place.person, place.order, place.coordinates)
        };
        assert_eq!(of(""), (String::new(), vec![], None));
        assert_eq!(of("1."), ("1.".into(), vec![], None));
        assert_eq!(of("smplx_params[2]."), ("smplx_params[].".into(), vec![2], None));
        assert_eq!(of("[1]."), ("[].person 5".into(), vec![1], None));
        assert_eq!(of("smpl_params_incam.").2, Some(Coordinates::Camera));
        assert_eq!(of("people.1.smplx_world.").2, Some(Coordinates::World));
        assert_eq!(of("out/img/000012.jpg.smpl[1]."), ("person 3".into(), vec![12], None));
        assert_eq!(of("out/img/000012.jpg.smpl."), ("person 7".into(), vec![12], None));
        assert_eq!(of("results.00000003.png."), ("item 0".into(), vec![3], None));
    }
}
