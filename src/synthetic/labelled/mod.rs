//! Labelled pictures of people, to train detectors on: colour over a user's backgrounds, and what is known of every pixel and joint.
//!
//! A picture is a function of its number, the seed, the people and the backgrounds: pose, camera, light and backdrop are drawn from a
//! generator of its own. Cameras and coordinates are those of [`PinholeCamera`](crate::mesh::camera::PinholeCamera): places in a picture count
//! from its upper left corner, pixels' centres are at halves. Metres, Y up.
//!
//! [`LabelledPictures`] makes them, [`PictureFolder`] keeps them in a folder that can be gone on with.

mod backdrop;
mod coco;
mod drawn;
mod folder;
mod keypoints;
mod labels;
mod overlay;
mod picture;
mod registered;

pub use self::backdrop::Backdrops;
pub use self::folder::{PictureFolder, Recipe};
pub use self::labels::{CameraLabels, JointLabel, Labels, Visibility};
pub use self::picture::{LabelledPicture, LabelledPictures, People, Person};
pub use self::registered::RegisteredPeople;
