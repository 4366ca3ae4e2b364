//! Subjects: scans of a person, each with the SMPL-X body that was registered to it, in any layout that people have them in.
//!
//! [`Subject::open`] finds out how a folder is laid out ([`layout`]) and which files make a frame ([`pairing`]), and reads none
//! of them but registrations, for a shape that no file states; [`read_frame`] reads one. A `subject.toml`
//! ([`description`]) says what a folder leaves open. Metres, Y up, whatever the files are in.

mod description;
mod fit_file;
mod frame;
mod layout;
mod pairing;
mod rules;
mod scan_file;
mod scans;
mod unseen;

use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use frame::{FrameFile, FrameFiles, read_frame};
pub use layout::Layout;
pub use rules::HandZero;
pub use scans::Scans;

use self::description::Description;
use self::fit_file::{Registered, read_fit};
use self::layout::{DRESS_INFO, Sequence, find, named_sequence};
use self::pairing::{Paired, last_number};
use self::rules::{Rules, Settled};
use crate::placement::ScanPlacement;
use crate::rgbd::Shape;
use crate::xhumans::{Common, GENDER_FILE, SHAPE_FILE, gender_in, mean_shape};
use crate::{FrameId, ScanFrames, Split};
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::{Error, Result, Value, read_pickle};

/// Registrations that are read for a shape that no file states.
const SHAPES_READ: usize = 200;

/// Families of whole bodies, as registrations name them.
const WHOLE_BODIES: [&str; 3] = ["SMPL-X", "SMPL+H", "SMPL"];

/// A subject on disk: what is common to its frames, and which frames there are.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The subject's folder.
    pub folder: PathBuf,
    /// How it is laid out.
    pub layout: Layout,
    /// Which body model fits the subject.
    pub gender: Gender,
    /// Shape coefficients beta, common to all frames.
    pub betas: Vec<f32>,
    /// How far the registrations' own shapes are apart in the coefficient that differs most, where `betas` is their mean.
    pub shape_spread: Option<f32>,
    /// Parameters that the first registration does not have, so that they are zero.
    pub absent: Vec<String>,
    /// The first registration, and the skeleton it is of.
    registered: Option<(PathBuf, Registered)>,
    /// Training frames, by sequence and number.
    pub train: Vec<FrameFiles>,
    /// Test frames, by sequence and number.
    pub test: Vec<FrameFiles>,
}

impl Subject {
    /// The file that says what a subject's folder leaves open.
    pub const DESCRIPTION_FILE: &str = Description::FILE;

    /// Finds the frames of the subject in `folder`.
    ///
    /// A frame of which one file is there counts, so that [`read_frame`] can say what it lacks.
    ///
    /// # Errors
    /// [`Error::Missing`] if the folder, its gender, shape or every frame is missing; [`Error::Unrecognised`] if it is in no
    /// layout; [`Error::Mismatch`] or [`Error::Malformed`] for what is wrong with the files that describe it.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        if !folder.is_dir() {
            return Err(Error::Missing {
                path: folder.into(),
                what: "subject folder".into(),
                remedy: "give the folder of one subject (docs/formats.md has the layouts)".into(),
            });
        }
        let description = Description::read(folder)?;
        let data = description.data.as_ref().map_or_else(|| folder.to_path_buf(), |data| folder.join(data));
        let (layout, sequences) = sequences_of(&data, &description)?;
        let conventions = layout.conventions();
        let fits: Vec<&Path> =
            sequences.iter().flat_map(|sequence| &sequence.frames).filter_map(|frame| frame.fit.as_deref()).collect();
        let stated = Stated::of(layout, &data)?;
        let stated_betas = match &description.betas {
            Some(Shape::Numbers(betas)) => Some(betas.clone()),
            Some(Shape::File(file)) => Some(mean_shape(&folder.join(file))?),
            None => stated.betas,
        };
        // What is wrong with the first is its frame's error, where nothing is needed of it.
        let first = match fits.first().map(|fit| read_fit(fit)).transpose() {
            Err(_) if layout == Layout::XHumans => None,
            first => first?,
        };
        let gender = description.gender.or(stated.gender).or(first.as_ref().and_then(|fit| fit.gender));
        let gender = gender.or(dress_gender(&sequences)).or(conventions.gender).ok_or_else(|| Error::Missing {
            path: folder.join(Description::FILE),
            what: "the subject's gender".into(),
            remedy: "write `gender = \"neutral\"` (or female, male: that of the registered body model) into it".into(),
        })?;
        let (betas, shape_spread) = match stated_betas {
            Some(betas) => (betas, None),
            None => mean_of_shapes(folder, &fits)?,
        };
        let mended = ScanPlacement::read(folder)?;
        let of_layout = ScanPlacement { origin: conventions.origin, ..ScanPlacement::default() };
        let rules = Arc::new(Rules {
            hands: description.hands.unwrap_or(conventions.hands),
            placements: [Some(description.scans.unwrap_or(of_layout)), mended].into_iter().flatten().collect(),
            settled: None,
            unseen: unseen::read(&data)?,
        });
        let [train, test] = frames_by_split(&sequences, &description.test, &rules);
        Ok(Self {
            folder: folder.into(),
            layout,
            gender,
            betas,
            shape_spread,
            registered: first.as_ref().zip(fits.first()).map(|(fit, path)| (path.to_path_buf(), fit.registered)),
            absent: first.map(|fit| fit.absent).unwrap_or_default(),
            train,
            test,
        })
    }

    /// The subject with what depends on its body model settled: where a pelvis is, what hands' coefficients are of. Layouts
    /// that need it refuse to read frames without.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if the frames were registered with a model of another family; those of [`BodyModel::pose`] for the
    /// subject's shape.
    pub fn settled(mut self, body: &BodyModel) -> Result<Self> {
        let skeleton = body.skeleton();
        let of_other = self.registered.iter().find(|(_, registered)| registered.joints != skeleton.joints.len());
        if let Some((path, registered)) = of_other {
            let family = registered.family;
            let wants_whole_body = !skeleton.is_whole_body() && WHOLE_BODIES.contains(&family);
            return Err(match wants_whole_body {
                true => Error::Mismatch {
                    path: body.path().into(),
                    found: format!("this is {}", skeleton.family),
                    expected: format!("a whole body: {} is a registration of {family}", path.display()),
                    remedy: format!("give a body model of {family}").into(),
                },
                false => Error::Mismatch {
                    path: path.clone(),
                    found: format!("a registration of {family} ({} joints)", registered.joints),
                    expected: format!("one of {}, as {} is", skeleton.description(), body.path().display()),
                    remedy: format!("give a body model of {family}, or fit the scans again").into(),
                },
            });
        }
        let mut frames: Vec<&mut FrameFiles> = self.train.iter_mut().chain(&mut self.test).collect();
        if let Some(first) = frames.first() {
            let settled = Some(Settled::of(body, &self.betas)?);
            let rules = Arc::new(Rules { settled, ..Rules::clone(&first.rules) });
            frames.iter_mut().for_each(|files| files.rules = rules.clone());
        }
        Ok(self)
    }

    /// The training frames as a source.
    pub fn training_frames(&self) -> ScanFrames {
        self.frames(Split::Train)
    }

    /// The frames of one split.
    pub fn files(&self, split: Split) -> &[FrameFiles] {
        match split {
            Split::Train => &self.train,
            Split::Test => &self.test,
        }
    }

    /// The frames of one split as a source.
    pub fn frames(&self, split: Split) -> ScanFrames {
        ScanFrames::new(self, self.files(split))
    }

    /// Whether bodies are registered to frames in a folder, be there what else a subject needs or not.
    #[must_use]
    pub fn has_registrations(folder: &Path) -> bool {
        let sequences = Description::read(folder).and_then(|description| {
            let data = description.data.as_ref().map_or_else(|| folder.to_path_buf(), |data| folder.join(data));
            sequences_of(&data, &description)
        });
        let is_registered = |sequence: &Sequence| sequence.frames.iter().any(|frame| frame.fit.is_some());
        sequences.is_ok_and(|(_, sequences)| sequences.iter().any(is_registered))
    }

    /// Whether any frame has a scan.
    #[must_use]
    pub fn has_scans(&self) -> bool {
        self.train.iter().chain(&self.test).any(|files| files.scan.path().is_some())
    }
}

fn sequences_of(data: &Path, description: &Description) -> Result<(Layout, Vec<Sequence>)> {
    if !description.sequences.is_empty() {
        let sequence = |described: &description::DescribedSequence| {
            let found = named_sequence(&data.join(&described.folder), &described.scans, &described.fits)?;
            let name = described.name.clone().unwrap_or(found.name);
            Ok(Sequence { split: Some(described.split.name()), name, ..found })
        };
        let sequences = description.sequences.iter().map(sequence).collect::<Result<Vec<_>>>()?;
        if sequences.iter().all(|sequence| sequence.frames.is_empty()) {
            let looked: Vec<String> =
                sequences.iter().map(|sequence| sequence.scan_folder.display().to_string()).collect();
            return Err(Error::Missing {
                path: data.join(Description::FILE),
                what: format!("a scan or a registration in {}", looked.join(", ")),
                remedy: "correct the `scans` and `fits` of its sequences".into(),
            });
        }
        return Ok((Layout::Plain, sequences));
    }
    if let Some(found) = find(data)? {
        return Ok(found);
    }
    // A folder that has begun to be an X-Humans subject is told what it lacks of one.
    if data.join(GENDER_FILE).is_file() {
        Stated::of(Layout::XHumans, data)?;
        return Err(Error::Missing {
            path: data.into(),
            what: "a frame (train/<sequence>/SMPLX/mesh-f00001_smplx.pkl with its scan)".into(),
            remedy: "check that this is one subject's folder, unpacked whole".into(),
        });
    }
    Err(Error::Unrecognised {
        path: data.into(),
        what: "subject",
        tried: vec![
            "X-Humans: no train/<sequence> or test/<sequence> with SMPLX and meshes_pkl or meshes_ply".into(),
            "4D-DRESS: no <take>/Meshes_pkl with <take>/SMPLX".into(),
            "THuman2, CustomHumans, RVH: no scan (.obj, .ply, .glb) with smplx_param.pkl, .json or _smplx.pkl beside it".into(),
            "scans/ and fits/: no such folders, and no subject.toml that names others".into(),
        ],
        remedy: "docs/formats.md has the layouts".into(),
    })
}

/// What files beside the frames say of a subject.
struct Stated {
    gender: Option<Gender>,
    betas: Option<Vec<f32>>,
}

impl Stated {
    /// Reads `gender.txt` and the mean shape; only in the X-Humans layout do they have to be there.
    fn of(layout: Layout, folder: &Path) -> Result<Self> {
        if layout == Layout::XHumans {
            let Common { gender, betas } = Common::read(folder)?;
            return Ok(Self { gender: Some(gender), betas: Some(betas) });
        }
        let (gender, shape) = (folder.join(GENDER_FILE), folder.join(SHAPE_FILE));
        Ok(Self {
            gender: gender.is_file().then(|| gender_in(&gender)).transpose()?,
            betas: shape.is_file().then(|| mean_shape(&shape)).transpose()?,
        })
    }
}

/// The gender that 4D-DRESS notes with its sequences.
fn dress_gender(sequences: &[Sequence]) -> Option<Gender> {
    sequences.iter().find_map(|sequence| {
        let info = read_pickle(sequence.folder.join(DRESS_INFO)).ok()?;
        let Value::Text(gender) = info.get("gender")? else { return None };
        gender.parse().ok()
    })
}

/// The mean shape of registrations, and how far they are apart.
fn mean_of_shapes(folder: &Path, fits: &[&Path]) -> Result<(Vec<f32>, Option<f32>)> {
    let stride = fits.len().div_ceil(SHAPES_READ).max(1);
    let shapes: Vec<Vec<f32>> = fits
        .iter()
        .step_by(stride)
        // A registration that cannot be read is its frame's error.
        .filter_map(|fit| read_fit(fit).ok())
        .filter_map(|fit| fit.betas)
        .collect();
    if shapes.is_empty() {
        // If none can be read, why not is more to the point.
        if let Some(fit) = fits.first() {
            read_fit(fit)?;
        }
        return Err(Error::Missing {
            path: folder.join(Description::FILE),
            what: "the subject's shape".into(),
            remedy: "its registrations have no `betas`: write ten numbers, `betas = [...]`, into it".into(),
        });
    }
    // A coefficient that a registration leaves out is zero.
    let longest = shapes.iter().map(Vec::len).max().unwrap_or(0);
    let of_coefficient =
        |coefficient: usize| shapes.iter().map(move |shape| shape.get(coefficient).copied().unwrap_or(0.0));
    let mean = |coefficient: usize| of_coefficient(coefficient).sum::<f32>() / shapes.len() as f32;
    let mean = (0..longest).map(mean).collect();
    let spread = (0..longest).map(|coefficient| {
        let values = || of_coefficient(coefficient);
        values().fold(f32::MIN, f32::max) - values().fold(f32::MAX, f32::min)
    });
    Ok((mean, Some(spread.fold(0.0, f32::max))))
}

/// The frames for training and for tests. Where nothing says which is which, the last of several sequences is for tests.
fn frames_by_split(sequences: &[Sequence], test: &[String], rules: &Arc<Rules>) -> [Vec<FrameFiles>; 2] {
    let mut frames = [Vec::new(), Vec::new()];
    let undecided = test.is_empty() && sequences.len() > 1 && sequences.iter().all(|sequence| sequence.split.is_none());
    for (place, sequence) in sequences.iter().enumerate() {
        let is_last = undecided && place + 1 == sequences.len();
        let is_test = match sequence.split {
            _ if !test.is_empty() => test.contains(&sequence.name),
            Some(split) => split == "test",
            None => is_last,
        };
        let split = if is_test { "test" } else { "train" };
        frames[usize::from(is_test)].extend(frames_of(sequence, split, rules));
    }
    frames.iter_mut().for_each(|frames| frames.sort_by(|one, other| one.id.cmp(&other.id)));
    frames
}

fn frames_of(sequence: &Sequence, split: &str, rules: &Arc<Rules>) -> Vec<FrameFiles> {
    let numbers: Vec<Option<u32>> = sequence.frames.iter().map(|frame| last_number(&frame.name)).collect();
    let mut different: Vec<u32> = numbers.iter().flatten().copied().collect();
    different.sort_unstable();
    different.dedup();
    let in_order = different.len() < numbers.len();
    let frame = |(place, (frame, number)): (usize, (&Paired, &Option<u32>))| {
        let number = number.filter(|_| !in_order).unwrap_or(place as u32 + 1);
        let file = |found: &Option<PathBuf>, folder: &Path, extensions: &str| match found {
            Some(path) => FrameFile::At(path.clone()),
            None => FrameFile::Missing { folder: folder.into(), name: format!("{} as {extensions}", frame.name) },
        };
        FrameFiles {
            id: FrameId { split: split.into(), sequence: sequence.name.clone(), number },
            scan: file(&frame.scan, &sequence.scan_folder, ".ply, .obj, .glb or .pkl"),
            parameters: file(&frame.fit, &sequence.fit_folder, ".pkl, .npz or .json"),
            rules: rules.clone(),
        }
    };
    sequence.frames.iter().zip(&numbers).enumerate().map(frame).collect()
}
