//! A folder of labelled pictures: a file a picture and kind of label, and tables of all of them.
//!
//! | | |
//! |---|---|
//! | `pictures/000000.png` | colour |
//! | `masks/` | 8 bits: 255 where the person is |
//! | `joints/` | 8 bits: the joint of each pixel, counted from 1 as `dataset.json` names them; 0 nobody |
//! | `depth/` | 16 bits, fifths of a millimetre; 65535 nobody |
//! | `normals/` | red right, green up, blue towards the camera |
//! | `labels/000000.json` | [`Labels`] |
//! | `coco.json` | COCO and COCO-WholeBody |
//! | `dataset.json` | [`Recipe`], and the joints' names |
//! | `sheet.png` | some pictures with their labels drawn |
//!
//! A picture is complete when its labels are there, the last file of it. The same recipe goes on where it was stopped, or adds pictures.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use image::codecs::png::PngEncoder;
use image::imageops::{FilterType, resize};
use image::{ExtendedColorType, GrayImage, ImageEncoder, RgbImage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::labels::Labels;
use super::picture::LabelledPicture;
use super::{coco, overlay};
use crate::Result;
use crate::body::Skeleton;
use crate::data::{DepthFormat, read_depth, write_depth};
use crate::formats::{Error, FolderLock, create_folder, read_picture, read_text, write_atomically};
use crate::render::{ColourMap, Tile, contact_sheet, write_png};

const PICTURES: &str = "pictures";
const MASKS: &str = "masks";
const JOINTS: &str = "joints";
const DEPTH: &str = "depth";
const NORMALS: &str = "normals";
const LABELS: &str = "labels";
const DATASET: &str = "dataset.json";
/// Pictures on the sheet, and the longer side of each, pixels.
const SHOWN: usize = 8;
const SHOWN_SIDE: u32 = 300;

/// What all pictures of a folder are made by.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recipe {
    /// Who is pictured.
    pub people: String,
    /// How many poses there are of them.
    pub poses: usize,
    /// Names of the pictures behind.
    pub backdrops: Vec<String>,
    /// Columns and rows, pixels.
    pub size: [u32; 2],
    /// What chance begins with.
    pub seed: u64,
}

/// A folder that no other process fills.
pub struct PictureFolder {
    folder: PathBuf,
    skeleton: Skeleton,
    _lock: FolderLock,
}

impl PictureFolder {
    /// Begins a folder, or goes on with one that was begun by the same recipe.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if it was begun by another, or another process fills it; those of writing.
    pub fn open(folder: &Path, recipe: &Recipe, skeleton: &Skeleton) -> Result<Self> {
        let lock = FolderLock::take(folder)?;
        let path = folder.join(DATASET);
        if path.exists() {
            let found: Recipe = parse(&path)?;
            if found != *recipe {
                return Err(Error::Mismatch {
                    path,
                    found: format!(
                        "pictures of {}, {} x {}, seed {}",
                        found.people, found.size[0], found.size[1], found.seed
                    ),
                    expected: format!(
                        "those of {}, {} x {}, seed {}, with the same poses and backgrounds",
                        recipe.people, recipe.size[0], recipe.size[1], recipe.seed
                    ),
                    remedy: "give a new folder, or what this one was begun with".into(),
                }
                .into());
            }
        }
        for kind in [PICTURES, MASKS, JOINTS, DEPTH, NORMALS, LABELS] {
            create_folder(&folder.join(kind))?;
        }
        let mut described = serde_json::to_value(recipe).unwrap_or_default();
        described["joints"] = json!(skeleton.joints);
        write_json(&path, &described)?;
        Ok(Self { folder: folder.into(), skeleton: skeleton.clone(), _lock: lock })
    }

    /// Whether the picture of a number is complete.
    pub fn has(&self, number: usize) -> bool {
        self.path(LABELS, number).is_file()
    }

    /// Writes a picture.
    ///
    /// # Errors
    /// Those of writing.
    pub fn write(&self, picture: &LabelledPicture) -> Result<()> {
        let LabelledPicture { colour, mask, joints, depth, normals, labels } = picture;
        let path = |kind| self.path(kind, labels.number);
        write_png(path(PICTURES), colour)?;
        write_grey(&path(MASKS), mask)?;
        write_grey(&path(JOINTS), joints)?;
        write_depth(path(DEPTH), depth, labels.camera.size, DepthFormat::Png)?;
        write_png(path(NORMALS), normals)?;
        write_json(&path(LABELS), labels)
    }

    /// Writes the tables and the sheet of the first `count` pictures.
    ///
    /// # Errors
    /// Those of reading what is in the folder, and of writing.
    pub fn finish(&self, count: usize) -> Result<()> {
        let labels: Vec<Labels> = (0..count).map(|number| parse(&self.path(LABELS, number))).collect::<Result<_>>()?;
        write_json(&self.folder.join("coco.json"), &coco::annotations(&labels, file_name))?;
        let shown = (0..count.min(SHOWN)).map(|index| index * count / count.min(SHOWN));
        let rows = shown.map(|index| self.row(&labels[index])).collect::<Result<Vec<Vec<Tile>>>>()?;
        write_png(self.folder.join("sheet.png"), &contact_sheet(&rows)?)?;
        Ok(())
    }

    /// A picture beside its labels.
    fn row(&self, labels: &Labels) -> Result<Vec<Tile>> {
        let read = |kind| read_picture(&self.path(kind, labels.number));
        let (colour, joints, normals) =
            (read(PICTURES)?.into_rgb8(), read(JOINTS)?.into_luma8(), read(NORMALS)?.into_rgb8());
        let depth = self.shown_depth(labels)?;
        let parents = &self.skeleton.parents;
        let seen = labels.keypoints.iter().flatten().filter(|point| u8::from(point.visibility) == 2).count();
        let tiles = [
            (
                overlay::with_skeleton(&smaller(&colour), labels, parents),
                format!("{}, {seen} of 133 seen", file_name(labels.number)),
            ),
            (smaller(&overlay::with_joints(&colour, &joints, parents)), "joints".to_owned()),
            (smaller(&normals), "normals".to_owned()),
            (smaller(&depth), "depth".to_owned()),
        ];
        Ok(tiles.into_iter().map(|(picture, label)| Tile::new(picture, label)).collect())
    }

    fn shown_depth(&self, labels: &Labels) -> Result<RgbImage> {
        let picture = read_depth(self.path(DEPTH, labels.number))?;
        let [width, height] = labels.camera.size;
        let metres = |value: f32| value * DepthFormat::Png.metres_per_unit();
        let nobody = f32::from(u16::MAX);
        let values = || picture.values.iter().copied().filter(|value| *value < nobody).map(metres);
        let (near, far) = values().fold((f32::MAX, 0.0_f32), |(near, far), depth| (near.min(depth), far.max(depth)));
        let colour = |value: f32| match value < nobody {
            true => ColourMap::Viridis.colour((far - metres(value)) / (far - near).max(f32::EPSILON)),
            false => [0; 3],
        };
        Ok(RgbImage::from_fn(width, height, |x, y| image::Rgb(colour(picture.values[(y * width + x) as usize]))))
    }

    fn path(&self, kind: &str, number: usize) -> PathBuf {
        let extension = if kind == LABELS { "json" } else { "png" };
        self.folder.join(kind).join(format!("{number:06}.{extension}"))
    }
}

fn file_name(number: usize) -> String {
    format!("{PICTURES}/{number:06}.png")
}

fn smaller(picture: &RgbImage) -> RgbImage {
    let scale = SHOWN_SIDE as f32 / picture.width().max(picture.height()) as f32;
    let [width, height] = [picture.width(), picture.height()].map(|side| ((side as f32 * scale) as u32).max(1));
    resize(picture, width, height, FilterType::Triangle)
}

fn parse<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T> {
    Ok(serde_json::from_str(&read_text(path)?).map_err(|error| Error::Malformed {
        path: path.into(),
        format: "file of labels",
        place: format!("line {}", error.line()),
        found: error.to_string(),
        expected: "what this program writes".into(),
    })?)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    Ok(write_atomically(path, |file| {
        serde_json::to_writer(&mut *file, value)?;
        file.write_all(b"\n")
    })?)
}

fn write_grey(path: &Path, picture: &GrayImage) -> Result<()> {
    let (width, height) = picture.dimensions();
    Ok(write_atomically(path, |writer| {
        let encoder = PngEncoder::new(writer);
        encoder.write_image(picture.as_raw(), width, height, ExtendedColorType::L8).map_err(io::Error::other)
    })?)
}
