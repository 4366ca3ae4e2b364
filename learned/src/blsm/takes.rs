//! Takes of people: registrations that one folder has. A person's bones are the same in all of them, flesh is each take's own, as clothes are other ones.

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;

use xavatar_formats::Result;

use super::BlsmBody;
use super::own_bones::Person;
use crate::registrations::Registrations;

/// A person in one folder of registrations.
pub(super) struct Take<'a> {
    /// Whose it is.
    pub person: usize,
    /// The registrations.
    pub files: &'a [PathBuf],
    /// The person with the flesh of the take, and its frames alone.
    pub own: Cow<'a, Person>,
}

/// All takes, in the order of people.
pub(super) fn takes_of<'a>(
    body: &BlsmBody,
    registrations: &'a Registrations,
    people: &'a [Person],
) -> Result<Vec<Take<'a>>> {
    let mut takes = Vec::new();
    for (person, (subject, own)) in registrations.subjects.iter().zip(people).enumerate() {
        let ranges = ranges(&subject.frames);
        let is_whole = ranges.len() == 1;
        for frames in ranges {
            let files = &subject.frames[frames.clone()];
            let own = if is_whole {
                Cow::Borrowed(own)
            } else {
                let meshes = files.iter().map(|file| registrations.read(file)).collect::<Result<Vec<_>>>()?;
                Cow::Owned(own.within(body, &meshes, frames))
            };
            takes.push(Take { person, files, own });
        }
    }
    Ok(takes)
}

/// Runs of files in the same folder.
fn ranges(files: &[PathBuf]) -> Vec<Range<usize>> {
    let runs = files.chunk_by(|one, other| one.parent() == other.parent());
    let mut end = 0;
    let range = |run: &[PathBuf]| {
        end += run.len();
        end - run.len()..end
    };
    runs.map(range).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_folder_is_a_take() {
        let files = ["train/Take1/1.ply", "train/Take1/2.ply", "train/Take4/1.ply", "test/Take1/1.ply"];
        let files: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
        assert_eq!(ranges(&files), [0..2, 2..3, 3..4]);
        assert_eq!(ranges(&[]), Vec::<Range<usize>>::new());
    }
}
