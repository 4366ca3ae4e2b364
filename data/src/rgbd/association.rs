//! Which colour and depth pictures belong together: those of the same number, or of the nearest time.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use xavatar_formats::{Error, Result};

use super::numbering::{ByNumber, NumberedFiles, SAME_MOMENT, agreeing};

/// The pictures of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pictures {
    /// That in the names; from 1 in the order of time if these are times.
    pub(super) number: u32,
    /// If the names are times.
    pub(super) moment: Option<Moment>,
    pub(super) colour: PathBuf,
    pub(super) depth: PathBuf,
    pub(super) mask: Option<PathBuf>,
}

/// When a frame's colour picture was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    pub(super) seconds: f64,
    /// The picture's place among all colour pictures, with those that have no depth.
    pub(super) place: usize,
}

/// The folder of each kind of pictures.
pub(super) struct Folders<'a> {
    pub(super) colour: &'a Path,
    pub(super) depth: &'a Path,
    pub(super) mask: Option<&'a Path>,
}

/// The frames, in order. Of pictures with numbers, a frame of which one picture is there counts, so that reading it can say what
/// it lacks; of pictures with times, those of which both are there.
///
/// # Errors
/// [`Error::Mismatch`] if no colour picture has a depth picture.
pub(super) fn frames(
    folders: &Folders,
    colour: &NumberedFiles,
    depth: &NumberedFiles,
    masks: Option<&NumberedFiles>,
) -> Result<Vec<Pictures>> {
    let mut frames = match (colour, depth) {
        (NumberedFiles::Numbers(colour), NumberedFiles::Numbers(depth)) => of_numbers(folders, colour, depth)?,
        (NumberedFiles::Times(colour), NumberedFiles::Times(depth)) => of_times(folders, colour, depth)?,
        (colour, _) => {
            let kind = |is_times: bool| if is_times { "times" } else { "numbers" };
            let is_times = matches!(colour, NumberedFiles::Times(_));
            return Err(Error::Mismatch {
                path: folders.depth.into(),
                found: format!("pictures named by {}", kind(!is_times)),
                expected: format!("{} as in {}", kind(is_times), folders.colour.display()),
                remedy: "give both kinds the names of their frames".into(),
            });
        }
    };
    if let Some((masks, folder)) = masks.zip(folders.mask) {
        let by_number = masks.of_frames(&frames.iter().map(|frame| frame.number).collect());
        for frame in &mut frames {
            let of_time = frame.moment.and_then(|moment| masks.at_time(moment.seconds)).map(Path::to_path_buf);
            let found = of_time.or_else(|| by_number.get(&frame.number).cloned());
            frame.mask = Some(found.unwrap_or_else(|| folder.join(frame.number.to_string())));
        }
    }
    Ok(frames)
}

fn of_numbers(folders: &Folders, colour: &[ByNumber], depth: &[ByNumber]) -> Result<Vec<Pictures>> {
    let Some((colour, depth)) = agreeing(colour, depth) else { return Ok(Vec::new()) };
    let range = |files: &ByNumber| match (files.keys().next(), files.keys().next_back()) {
        (Some(first), Some(last)) if first != last => format!("{first} to {last}"),
        (Some(only), _) => only.to_string(),
        _ => String::new(),
    };
    if !colour.is_empty() && !depth.is_empty() && !colour.keys().any(|number| depth.contains_key(number)) {
        return Err(Error::Mismatch {
            path: folders.depth.into(),
            found: format!("depth pictures of the frames {}", range(depth)),
            expected: format!("some of {}, as in {}", range(colour), folders.colour.display()),
            remedy: "give both pictures of a frame the same number".into(),
        });
    }
    let numbers: BTreeSet<u32> = colour.keys().chain(depth.keys()).copied().collect();
    let file = |files: &ByNumber, folder: &Path, number: u32| {
        files.get(&number).cloned().unwrap_or_else(|| folder.join(number.to_string()))
    };
    let pictures = |number: u32| Pictures {
        number,
        moment: None,
        colour: file(colour, folders.colour, number),
        depth: file(depth, folders.depth, number),
        mask: None,
    };
    Ok(numbers.into_iter().map(pictures).collect())
}

/// Pairs of pictures no more than 20 ms apart, the nearest first, each picture once; as the TUM benchmark's tools do it.
fn of_times(folders: &Folders, colour: &[(f64, PathBuf)], depth: &[(f64, PathBuf)]) -> Result<Vec<Pictures>> {
    let mut pairs = Vec::new();
    for (place, (time, _)) in colour.iter().enumerate() {
        let first = depth.partition_point(|(other, _)| *other < time - SAME_MOMENT);
        let near = depth[first..].iter().enumerate().take_while(|(_, (other, _))| *other <= time + SAME_MOMENT);
        pairs.extend(near.map(|(offset, (other, _))| ((other - time).abs(), place, first + offset)));
    }
    pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
    let (mut of_colour, mut is_taken) = (vec![None; colour.len()], vec![false; depth.len()]);
    for (_, one, other) in pairs {
        if of_colour[one].is_none() && !is_taken[other] {
            (of_colour[one], is_taken[other]) = (Some(other), true);
        }
    }
    let mut frames = Vec::new();
    for (place, (time, path)) in colour.iter().enumerate() {
        let Some(other) = of_colour[place] else { continue };
        frames.push(Pictures {
            number: frames.len() as u32 + 1,
            moment: Some(Moment { seconds: *time, place }),
            colour: path.clone(),
            depth: depth[other].1.clone(),
            mask: None,
        });
    }
    if frames.is_empty() {
        return Err(Error::Mismatch {
            path: folders.depth.into(),
            found: "no depth picture within 20 ms of a colour picture".into(),
            expected: format!("pictures of the same time as in {}", folders.colour.display()),
            remedy: "check that both are of one recording".into(),
        });
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folders() -> Folders<'static> {
        Folders { colour: Path::new("rgb"), depth: Path::new("depth"), mask: Some(Path::new("mask")) }
    }

    fn numbers(folder: &str, numbers: &[u32]) -> NumberedFiles {
        let file = |number: &u32| (*number, Path::new(folder).join(format!("{number}.png")));
        NumberedFiles::Numbers(vec![numbers.iter().map(file).collect()])
    }

    fn times(folder: &str, times: &[f64]) -> NumberedFiles {
        NumberedFiles::Times(times.iter().map(|time| (*time, Path::new(folder).join(format!("{time}.png")))).collect())
    }

    #[test]
    fn pictures_of_one_number_are_a_frame_and_what_is_missing_has_a_name() {
        let masks = numbers("mask", &[2]);
        let found = frames(&folders(), &numbers("rgb", &[1, 2]), &numbers("depth", &[2, 3]), Some(&masks)).unwrap();
        assert_eq!(found.iter().map(|frame| frame.number).collect::<Vec<_>>(), [1, 2, 3]);
        let named = |path: &Path| path.to_str().unwrap().to_owned();
        assert_eq!([&found[1].colour, &found[1].depth].map(|path| named(path)), ["rgb/2.png", "depth/2.png"]);
        assert_eq!([&found[0].depth, &found[2].colour].map(|path| named(path)), ["depth/1", "rgb/3"]);
        assert_eq!([0, 1].map(|frame| named(found[frame].mask.as_ref().unwrap())), ["mask/1", "mask/2.png"]);
    }

    #[test]
    fn pictures_of_the_nearest_time_are_a_frame() {
        // 0.015 is nearer to 0.02 than to 0; 0.02 is taken then, and 0 has 0.005 left. 0.5 has nothing within 20 ms.
        let colour = times("rgb", &[0.0, 0.015, 0.5, 1.0]);
        let depth = times("depth", &[0.005, 0.02, 0.521, 1.02]);
        let found = frames(&folders(), &colour, &depth, Some(&times("mask", &[0.016, 0.9]))).unwrap();
        let pairs: Vec<_> =
            found.iter().map(|f| (f.number, f.colour.to_str().unwrap(), f.depth.to_str().unwrap())).collect();
        assert_eq!(
            pairs,
            [
                (1, "rgb/0.png", "depth/0.005.png"),
                (2, "rgb/0.015.png", "depth/0.02.png"),
                (3, "rgb/1.png", "depth/1.02.png")
            ]
        );
        assert_eq!(found.iter().map(|frame| frame.moment.unwrap().place).collect::<Vec<_>>(), [0, 1, 3]);
        let masks: Vec<_> = found.iter().map(|frame| frame.mask.as_deref().unwrap().to_str().unwrap()).collect();
        assert_eq!(masks, ["mask/0.016.png", "mask/0.016.png", "mask/3"], "the nearest, or a name that is not there");
    }

    #[test]
    fn pictures_that_have_nothing_in_common_are_an_error() {
        for (colour, depth, words) in [
            (numbers("rgb", &[1, 3]), numbers("depth", &[7, 8]), ["frames 7 to 8", "1 to 3"]),
            (times("rgb", &[1.0]), times("depth", &[1.1]), ["20 ms", "rgb"]),
            (times("rgb", &[1.0]), numbers("depth", &[1]), ["numbers", "times"]),
        ] {
            let error = frames(&folders(), &colour, &depth, None).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)) && error.starts_with("depth: "), "{error}");
        }
    }
}
