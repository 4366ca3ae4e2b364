//! Body parameters by name, as pose estimators, fitting tools and data sets store them (docs/motion.md has the table).
//!
//! arrays by name -> sets with one prefix each ([`place`]) -> of the person and the coordinates that are wanted -> frames ([`record`]).
//! Each parameter goes by several names ([`names`]), and may be of one frame, of all, or of a batch; rotations are told by the shape
//! of their array ([`layout`]). Names tell the tool too, and with it what its numbers mean ([`tools`]).

mod easymocap;
mod layout;
mod motion_x;
mod names;
mod place;
mod record;
mod rows;
mod tools;

use std::collections::BTreeMap;
use std::path::Path;

use super::{Coordinates, Motion, UpAxis};
use crate::fields::Fields;
use layout::{Layout, is_vposer_code};
use place::Place;
use record::Record;
use tools::Tool;
use xavatar_formats::{ArrayMap, Result};

pub(super) use motion_x::columns as motion_x;
pub(super) use names::RATE as RATE_NAMES;

const FORMAT: &str = "file of body parameters";

/// Which of a file's motions to read, where it has several.
#[derive(Clone, Debug, Default)]
pub(super) struct Choice {
    pub(super) coordinates: Option<Coordinates>,
    /// The person; after reading, the one that was read.
    pub(super) person: Option<String>,
}

pub(crate) fn recognised(arrays: &ArrayMap) -> std::result::Result<(), String> {
    let found = sets(arrays).next().is_some() || easymocap::spread(arrays).is_some();
    found.then_some(()).ok_or_else(|| format!("no {}, alone or under a prefix", names::quoted(names::BODY)))
}

/// Reads the parameters of the person of whom there is most.
pub(crate) fn read_named(path: &Path, arrays: &ArrayMap) -> Result<Motion> {
    read(path, arrays, &mut Choice::default())
}

/// The prefixes of sets of parameters, in the order of their names.
fn sets(arrays: &ArrayMap) -> impl Iterator<Item = &str> {
    let is_set = |(key, array): &(&String, &xavatar_formats::Array)| {
        let name = leaf(key);
        let is_body = names::BODY.iter().any(|(known, _)| *known == name);
        let is_pose = || Layout::of(&array.shape).is_some() || is_vposer_code(&array.shape);
        is_body || (names::is_body(name) && is_pose())
    };
    arrays.iter().filter(is_set).map(|(key, _)| &key[..key.len() - leaf(key).len()])
}

/// One person's sets, in order.
struct Person<'a> {
    label: String,
    places: Vec<Place<'a>>,
    coordinates: Option<Coordinates>,
    frames: usize,
}

/// Reads the parameters of the person, and in the coordinates, that are wanted: by default of whom there is most, in the world's.
pub(super) fn read(path: &Path, arrays: &ArrayMap, choice: &mut Choice) -> Result<Motion> {
    let spread = easymocap::spread(arrays);
    let arrays = spread.as_ref().unwrap_or(arrays);
    let fields = Fields { path, format: FORMAT, arrays };
    let tool_of = |prefix: &str| Tool::of(|name| is_beside(arrays, prefix, name));
    let record = |place: &Place, coordinates: Coordinates| -> Result<(Motion, &'static Tool)> {
        let tool = tool_of(place.prefix);
        Ok((Record { fields: &fields, place, tool, coordinates }.motion()?, tool))
    };
    let mut people = people(&fields, tool_of);
    let has = |coordinates| people.iter().any(|person| person.coordinates == Some(coordinates));
    let has_both_sets = has(Coordinates::World) && has(Coordinates::Camera);
    let wanted = choice.coordinates.unwrap_or(Coordinates::World);
    if has(wanted) {
        people.retain(|person| person.coordinates == Some(wanted));
    }
    if let Some(chosen) = choice.person.as_ref().filter(|label| people.iter().any(|person| person.label == **label)) {
        people.sort_by_key(|person| person.label != *chosen);
    }
    let others: Vec<String> =
        people.iter().skip(1).map(|person| format!("{} ({} frames)", person.label, person.frames)).collect();
    let Person { label, places, coordinates: said, .. } = people.swap_remove(0);
    let tool = tool_of(places[0].prefix);
    let has_both_names = has_worlds_names(arrays, places[0].prefix);
    let coordinates = if has_both_names { wanted } else { said.unwrap_or(tool.plain) };

    let mut motion = Motion::default();
    for place in &places {
        let (part, _) = record(place, coordinates)?;
        motion.frames.extend(part.frames);
        motion.zeroed.extend(part.zeroed);
        motion.notes.extend(part.notes);
    }
    for lines in [&mut motion.zeroed, &mut motion.notes] {
        lines.sort();
        lines.dedup();
    }
    if has_both_sets || has_both_names {
        let other = if coordinates == Coordinates::World { Coordinates::Camera } else { Coordinates::World };
        motion.notes.push(format!("in {coordinates} coordinates; the file has a motion in {other} too"));
    }
    if !others.is_empty() {
        motion.notes.push(format!("the file's longest motion; others in it are left out: {}", others.join(", ")));
    }
    motion.frames_per_second = rate(&fields, places[0].prefix)?.or(tool.rate);
    motion.up_is_certain = tool.is_certain || said.is_some() && coordinates == Coordinates::Camera;
    motion.up = match coordinates {
        Coordinates::Camera => UpAxis::MinusY,
        Coordinates::World => tool.up,
    };
    motion.coordinates = motion.up_is_certain.then_some(coordinates);
    motion.up_reason = match motion.up_is_certain {
        true => format!("by {}, in {coordinates} coordinates", tool.name),
        false => format!("usual of {}, in {coordinates} coordinates", tool.name),
    };
    motion.source = format!("{} ({})", path.display(), tool.name);
    choice.person = Some(label);
    Ok(motion)
}

/// The people of a file: the one with most frames first, and of equals those whose names are shorter.
fn people<'a>(fields: &Fields<'a>, tool_of: impl Fn(&str) -> &'static Tool) -> Vec<Person<'a>> {
    let mut people: BTreeMap<String, Person> = BTreeMap::new();
    let mut prefixes: Vec<&str> = sets(fields.arrays).collect();
    prefixes.dedup();
    for prefix in prefixes {
        let place = Place::of(prefix, fields.arrays);
        let record = Record { fields, place: &place, tool: tool_of(prefix), coordinates: Coordinates::World };
        let frames = record.body().map_or(0, |(.., layout)| if record.rows_are_people() { 1 } else { layout.frames });
        let person = people.entry(place.person.clone()).or_insert_with(|| Person {
            label: place.person.trim_end_matches('.').to_owned(),
            places: Vec::new(),
            coordinates: place.coordinates,
            frames: 0,
        });
        person.frames += frames;
        person.places.push(place);
    }
    let mut people: Vec<Person> = people.into_values().collect();
    people.iter_mut().for_each(|person| person.places.sort_by(|one, other| one.order.cmp(&other.order)));
    // People who are told apart before items of pictures, of whom each may be another.
    let is_anyone = |person: &Person| person.places.iter().any(|place| place.picture.is_some() && !place.is_tracked);
    people.sort_by_key(|person| {
        (std::cmp::Reverse(person.frames), is_anyone(person), person.label.matches(['.', '[']).count())
    });
    people
}

/// Whether an array of this name is in a set, or above it.
fn is_beside(arrays: &ArrayMap, prefix: &str, name: &str) -> bool {
    let mut above = prefix;
    loop {
        if arrays.contains_key(&format!("{above}{name}")) {
            return true;
        }
        let Some(inner) = above.strip_suffix('.') else { return above.is_empty() && arrays.contains_key(name) };
        above = inner.rfind('.').map_or("", |dot| &inner[..=dot]);
    }
}

/// Whether a set has arrays whose names say that they are in a world's coordinates, so that others are in the camera's.
fn has_worlds_names(arrays: &ArrayMap, prefix: &str) -> bool {
    let names = names::POSE.iter().chain(names::ROOT);
    let mut worlds = names.filter(|(_, coordinates)| *coordinates == Some(Coordinates::World));
    worlds.any(|(name, _)| arrays.contains_key(&format!("{prefix}{name}")))
}

/// The frame rate that the file says.
fn rate(fields: &Fields, prefix: &str) -> Result<Option<f32>> {
    let keys = names::RATE.iter().flat_map(|name| [format!("{prefix}{name}"), (*name).to_owned()]);
    let Some(key) = keys.into_iter().find(|key| fields.arrays.contains_key(key)) else { return Ok(None) };
    match fields.number(&key)? {
        rate if rate > 0.0 => Ok(Some(rate)),
        rate => Err(fields.malformed(&key, rate, "a positive number of frames a second")),
    }
}

/// The name after the last dot.
fn leaf(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}
