//! Data that the program makes itself: a dressed subject, a dance for any avatar, and a camera that films scans.

mod dance;
mod labelled;
mod mannequin;
mod virtual_camera;

pub use dance::{DANCE, dance, load_clip, load_poses};
pub use labelled::{
    Backdrops, CameraLabels, JointLabel, LabelledPicture, LabelledPictures, Labels, People, Person, PictureFolder,
    Recipe, RegisteredPeople, Visibility,
};
pub use mannequin::{BuiltInSubject, FilmedTake};

pub use crate::data::Split;
pub use virtual_camera::{FilmedScans, Turntable, film};
