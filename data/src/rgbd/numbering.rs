//! Which frame a file is of, by its name: `color_0012.jpg`, `frame-000012.depth.png`, `1305031102.175304.png`.
//!
//! The number may stand anywhere: it is what differs from name to name. Where several numbers differ, each is a candidate, and
//! that counts which most files of the other kind have too. Times are no numbers: two sensors never agree on them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use xavatar_formats::{Error, Result, excerpt};

use crate::xhumans::file_names;

/// Digits of the seconds since 1970, and the fewest of a whole number that is a time of a finer unit.
const SECONDS_DIGITS: usize = 10;
const TIME_DIGITS: usize = 13;

/// Files by the number in their names.
pub(super) type ByNumber = BTreeMap<u32, PathBuf>;

/// The files of a folder by what their names count.
pub(super) enum NumberedFiles {
    /// The files by each number in their names that could be the frame's, the likeliest first; at least one.
    Numbers(Vec<ByNumber>),
    /// The files in the order of time, seconds.
    Times(Vec<(f64, PathBuf)>),
}

/// A name cut into numbers and what stands around them.
struct Name {
    path: PathBuf,
    stem: String,
    numbers: Vec<String>,
    /// One more than numbers.
    around: Vec<String>,
}

impl NumberedFiles {
    /// The files of a folder with one of these extensions, in lower case, whose names are wanted.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a name without a number; [`Error::Mismatch`] for two files of the same frame.
    pub(super) fn read(folder: &Path, extensions: &[&str], is_wanted: impl Fn(&str) -> bool) -> Result<Self> {
        let names = file_names(folder)?.into_iter().filter(|name| is_wanted(name));
        let names: Vec<Name> = names.filter_map(|name| Name::of(folder, &name, extensions)).collect();
        if let Some(name) = names.iter().find(|name| name.numbers.is_empty()) {
            return Err(without_number(name));
        }
        if let Some(times) = times(&names) {
            return Ok(Self::Times(times));
        }
        let (mut candidates, mut why) = (Vec::new(), None);
        for place in places(&names) {
            match by_number(&names, place) {
                Ok(files) => candidates.push(files),
                Err(error) => why = why.or(Some(error)),
            }
        }
        match why {
            Some(error) if candidates.is_empty() => Err(error),
            _ => Ok(Self::Numbers(candidates)),
        }
    }

    /// The files by number, so that as many of these frames as possible have one; none if the names are times.
    pub(super) fn of_frames(&self, frames: &BTreeSet<u32>) -> ByNumber {
        let Self::Numbers(candidates) = self else { return ByNumber::new() };
        let common = |files: &&ByNumber| files.keys().filter(|number| frames.contains(number)).count();
        best(candidates.iter(), common).cloned().unwrap_or_default()
    }

    /// The file of the time nearest to this one, seconds, if it is near enough.
    pub(super) fn at_time(&self, time: f64) -> Option<&Path> {
        let Self::Times(times) = self else { return None };
        let distance = |entry: &&(f64, PathBuf)| (entry.0 - time).abs();
        let nearest = times.iter().min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
        (distance(&nearest) <= SAME_MOMENT).then_some(&nearest.1)
    }
}

/// Times that are no farther apart are of one moment, seconds: the tolerance of the TUM benchmark's tools.
pub(super) const SAME_MOMENT: f64 = 0.02;

/// The candidates of two kinds of files that have the most numbers in common.
pub(super) fn agreeing<'a>(one: &'a [ByNumber], other: &'a [ByNumber]) -> Option<(&'a ByNumber, &'a ByNumber)> {
    let pairs = one.iter().flat_map(|ours| other.iter().map(move |theirs| (ours, theirs)));
    best(pairs, |(ours, theirs)| ours.keys().filter(|number| theirs.contains_key(number)).count())
}

/// The first of those with the highest score.
fn best<T>(items: impl Iterator<Item = T>, score: impl Fn(&T) -> usize) -> Option<T> {
    let scored = items.map(|item| (score(&item), item));
    scored.reduce(|best, next| if next.0 > best.0 { next } else { best }).map(|(_, item)| item)
}

impl Name {
    fn of(folder: &Path, name: &str, extensions: &[&str]) -> Option<Self> {
        let (stem, extension) = name.rsplit_once('.')?;
        if !extensions.contains(&extension.to_ascii_lowercase().as_str()) {
            return None;
        }
        let (mut numbers, mut around) = (Vec::new(), vec![String::new()]);
        let mut is_inside = false;
        for letter in stem.chars() {
            if letter.is_ascii_digit() && !is_inside {
                numbers.push(String::new());
                around.push(String::new());
            }
            is_inside = letter.is_ascii_digit();
            let part = if is_inside { numbers.last_mut() } else { around.last_mut() };
            part?.push(letter);
        }
        Some(Self { path: folder.join(name), stem: stem.into(), numbers, around })
    }

    /// The time that the name is: seconds with a fraction, or a whole number of a finer unit since 1970.
    fn time(&self) -> Option<f64> {
        let (seconds, fraction) = match &self.numbers[..] {
            [seconds, fraction] if self.around == ["", ".", ""] => (seconds.as_str(), fraction.as_str()),
            [number] if number.len() >= TIME_DIGITS && !number.starts_with('0') => number.split_at(SECONDS_DIGITS),
            _ => return None,
        };
        format!("{seconds}.{fraction}").parse().ok()
    }
}

/// The files in the order of time, if all names are times.
fn times(names: &[Name]) -> Option<Vec<(f64, PathBuf)>> {
    let time = |name: &Name| Some((name.time()?, name.path.clone()));
    let mut times = names.iter().map(time).collect::<Option<Vec<_>>>()?;
    times.sort_by(|one, other| one.0.total_cmp(&other.0));
    Some(times).filter(|times| !times.is_empty())
}

/// Which numbers of the names may be the frame's, counted from the end: those that differ, the last first. Names that differ in
/// more than numbers, or in none, have it at their end.
fn places(names: &[Name]) -> Vec<usize> {
    let Some((first, others)) = names.split_first() else { return vec![0] };
    if others.iter().any(|name| name.around != first.around || name.numbers == first.numbers) {
        return vec![0];
    }
    let digits = |name: &Name, place: usize| name.numbers[name.numbers.len() - 1 - place].clone();
    let differs = |place: &usize| others.iter().any(|name| digits(name, *place) != digits(first, *place));
    (0..first.numbers.len()).filter(|place| others.is_empty() || differs(place)).collect()
}

/// The files by the number at this place, counted from the end.
fn by_number(names: &[Name], place: usize) -> Result<ByNumber> {
    let mut files = ByNumber::new();
    for name in names {
        let digits = &name.numbers[name.numbers.len() - 1 - place];
        let number = digits.parse().map_err(|_| without_number(name))?;
        if let Some(other) = files.insert(number, name.path.clone()) {
            return Err(Error::Mismatch {
                path: name.path.clone(),
                found: format!("frame {number} again"),
                expected: format!("one picture a frame, which is {}", other.display()),
                remedy: "keep colour, depth and masks in folders of their own, or `depth` and `mask` in their names"
                    .into(),
            });
        }
    }
    Ok(files)
}

fn without_number(name: &Name) -> Error {
    Error::Malformed {
        path: name.path.clone(),
        format: "RGB-D folder",
        place: "the name".into(),
        found: excerpt(&name.stem),
        expected: format!("the frame's number, up to {}, or a time", u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(names: &[&str]) -> Result<NumberedFiles> {
        let folder = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
        NumberedFiles::read(folder.path(), &["png", "jpg"], |_| true)
    }

    /// The numbers at each place that may be the frame's.
    fn numbers(names: &[&str]) -> Vec<Vec<u32>> {
        let NumberedFiles::Numbers(candidates) = read(names).unwrap() else { panic!("{names:?}") };
        candidates.iter().map(|files| files.keys().copied().collect()).collect()
    }

    #[test]
    fn the_number_is_what_differs_wherever_it_stands() {
        assert_eq!(numbers(&["frame-000007.color.png", "frame-000012.color.PNG"]), [[7, 12]]);
        assert_eq!(numbers(&["7.jpg", "12.jpg", "notes.txt"]), [[7, 12]]);
        assert_eq!(numbers(&["0007_rgb_640x480.png", "0012_rgb_640x480.png"]), [[7, 12]]);
        assert_eq!(numbers(&["kinect2_0007.jpg", "kinect2_0012.jpg"]), [[7, 12]]);
        assert_eq!(numbers(&["a7_33.png", "a12_66.png"]), [[33, 66], [7, 12]], "either");
        assert_eq!(numbers(&["cam1_7.png"]), [[7], [1]], "either, if there is but one");
        assert_eq!(numbers(&["m7.png", "mask_12.png"]), [[7, 12]], "the last, if the names have no pattern");
        assert_eq!(numbers(&["000000000007.png", "000000000012.png"]), [[7, 12]]);
        assert_eq!(numbers(&[]), vec![Vec::<u32>::new()]);
    }

    #[test]
    fn times_are_seconds_whatever_their_unit() {
        for names in [
            ["1305031102.175304.png", "1305031102.211214.png"],
            ["1305031102175304.png", "1305031102211214.png"],
            ["1305031102175304000.png", "1305031102211214000.png"],
        ] {
            let files = read(&names).unwrap();
            let NumberedFiles::Times(times) = &files else { panic!("{names:?}") };
            assert!((times[1].0 - times[0].0 - 0.03591).abs() < 1e-6, "{names:?}");
            assert!(files.at_time(1305031102.23).unwrap().ends_with(names[1]));
            assert_eq!(files.at_time(1305031102.232), None, "more than 20 ms away");
        }
    }

    #[test]
    fn the_numbers_that_most_files_share_are_the_frames() {
        let NumberedFiles::Numbers(colour) = read(&["a7_33.png", "a12_66.png"]).unwrap() else { panic!() };
        let NumberedFiles::Numbers(depth) = read(&["d7_31.png", "d12_64.png", "d13_97.png"]).unwrap() else { panic!() };
        let (ours, theirs) = agreeing(&colour, &depth).unwrap();
        assert_eq!(ours.keys().collect::<Vec<_>>(), [&7, &12]);
        assert_eq!(theirs.keys().collect::<Vec<_>>(), [&7, &12, &13]);
        let masks = read(&["m7_1.png", "m12_2.png"]).unwrap();
        assert_eq!(masks.of_frames(&[7, 12].into()).into_keys().collect::<Vec<_>>(), [7, 12]);
    }

    #[test]
    fn names_without_a_number_and_two_files_of_a_frame_are_named() {
        for (names, words) in [
            (&["color.png"][..], "color"),
            (&["a99999999999.png"], "99999999999"),
            (&["1.png", "1.jpg"], "frame 1 again"),
            (&["m1.png", "n1.png"], "frame 1 again"),
        ] {
            let error = read(names).err().unwrap().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
