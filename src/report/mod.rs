//! A run as one page to look at and to send: `report.html`, and the page of `xavatar view`.
//!
//! One file without a single request: styles, script, pictures and the avatar itself are inside it (docs/report.md). The page is
//! made of templates in `assets/report/`; its viewer draws a [`RiggedMesh`] with WebGL.

mod chart;
mod closeup;
mod dancing;
mod figure;
mod machine;
mod metrics;
mod overlay;
mod page;
mod part_colours;
mod picture;
mod registration;
mod scene;
mod training;

use std::io::Write;
use std::path::Path;

use glam::Vec3;
use image::RgbImage;

pub use closeup::closeup;
pub(crate) use dancing::quick_dancing_rig;
pub use dancing::{danced_poses, dancing_rig, viewer_rig};
pub use figure::LineFigure;
pub use machine::machine;
pub use page::Fact;
pub(crate) use page::{KeyFigure, index_page};
pub use part_colours::{part_colour, part_colours, part_names};
pub use registration::{REGISTRATION_PAGE, write_registration_page};

use self::chart::{grouped, number};
use self::metrics::MetricsTable;
use self::overlay::overlay;
use self::page::{LivePage, Picture, ReportPage, ViewerPart};
use self::picture::data_uri;
use self::scene::ViewerScene;
use self::training::TrainingRecord;
use crate::Result;
use crate::avatar::Avatar;
use crate::body::Role;
use crate::evaluate;
use crate::export::RiggedMesh;
use crate::mesh::camera::{PinholeCamera, THREE_QUARTER};
use crate::render::{View, render_mesh};
use xavatar_formats::write_atomically;

/// The file's name in a run folder.
pub const REPORT_FILE: &str = "report.html";
/// Widest picture of the page, pixels.
const PICTURE_WIDTH: u32 = 1000;
/// The viewer's still picture, pixels.
const POSTER: (u32, u32) = (720, 900);

/// What a report tells; everything but the avatar may be missing.
pub struct Report<'a> {
    /// What the page is called.
    pub title: String,
    /// The command that was given, as one line.
    pub command: String,
    /// The avatar.
    pub avatar: &'a Avatar,
    /// The avatar for the viewer.
    pub rig: Option<&'a RiggedMesh>,
    /// The folder with the metrics and previews of its training.
    pub run: Option<&'a Path>,
    /// How good it is, and on which frames.
    pub evaluation: Option<(&'a evaluate::Report, String)>,
    /// Frames that are shown: the best and the worst.
    pub frames: Vec<ShownFrame>,
    /// More pictures, instead of the previews.
    pub pictures: Vec<RgbImage>,
    /// What else is known: data, hardware.
    pub facts: Vec<Fact>,
}

/// A frame that is looked at closely.
pub struct ShownFrame {
    /// `Best` or `Worst`, say.
    pub name: String,
    /// The frame, its error, what the picture's columns are.
    pub caption: String,
    /// Scan, avatar and error, side by side.
    pub picture: RgbImage,
}

impl Report<'_> {
    /// Writes the page, in the place of an earlier one.
    ///
    /// # Errors
    /// [`InputError::Io`](crate::InputError::Io) if a preview cannot be read or the page not written;
    /// [`InputError::Value`](crate::InputError::Value) for a rig that the viewer cannot draw.
    pub fn write(&self, path: &Path) -> Result<()> {
        let html = self.html()?;
        Ok(write_atomically(path, |file| file.write_all(html.as_bytes()))?)
    }

    /// The page.
    ///
    /// # Errors
    /// As [`Report::write`], but for the writing.
    pub fn html(&self) -> Result<String> {
        let training = self.run.map(TrainingRecord::read).transpose()?.unwrap_or_default();
        let pictures = match self.pictures.is_empty() {
            true => training.previews(PICTURE_WIDTH)?,
            false => self.pictures.iter().map(own_picture).collect::<Result<_>>()?,
        };
        let frames = self.frames.iter().map(ShownFrame::picture).collect::<Result<_>>()?;
        let metrics = self.evaluation.as_ref().map(|(report, frames)| MetricsTable::of(report, frames));
        let viewer = self.rig.map(|rig| viewer_part(rig, ViewerScene::of(rig)?)).transpose()?;
        ReportPage {
            title: self.title.clone(),
            kicker: if self.evaluation.is_some() { "Avatar, measured" } else { "Avatar, trained" },
            lead: self.lead(&training),
            figures: self.figures(&training),
            viewer,
            metrics,
            frames_heading: "Best and worst",
            frames,
            training_caption: training.caption(),
            curves: training.curves(),
            pictures_heading: if self.pictures.is_empty() { "While it learned" } else { "In unseen poses" },
            pictures,
            command: self.command.clone(),
            facts: self.all_facts(&training),
            configuration: self.avatar.config.to_toml()?,
        }
        .html()
    }

    fn lead(&self, training: &TrainingRecord) -> String {
        let Avatar { config, subject, steps, .. } = self.avatar;
        let time = training.seconds().map_or_else(String::new, |seconds| format!(" in {}", duration(seconds)));
        format!(
            "A {} body, learned from {} frames in {} steps of the preset {}{time}.",
            subject.gender,
            subject.frames,
            grouped(*steps as i64),
            config.preset
        )
    }

    fn figures(&self, training: &TrainingRecord) -> Vec<KeyFigure> {
        let mut figures = Vec::new();
        if let Some((report, _)) = &self.evaluation {
            let mean = report.mean();
            let parts =
                [("Body, CD", mean.all), ("Hands, CD", mean.of(Role::Hands)), ("Face, CD", mean.of(Role::Face))];
            let distance = |(label, part): (_, Option<evaluate::PartMetrics>)| {
                Some(KeyFigure { label, value: format!("{:.2}", part?.cd_mm), unit: "mm" })
            };
            figures.extend(parts.into_iter().filter_map(distance));
        } else if let Some(loss) = training.final_loss() {
            figures.push(KeyFigure { label: "Loss, mean of the last steps", value: number(loss), unit: "" });
        }
        if let Some(seconds) = training.seconds_per_step() {
            figures.push(KeyFigure { label: "A training step", value: number(1000.0 * seconds), unit: "ms" });
        }
        figures.push(KeyFigure { label: "Training frames", value: self.avatar.subject.frames.to_string(), unit: "" });
        figures
    }

    fn all_facts(&self, training: &TrainingRecord) -> Vec<Fact> {
        let Avatar { fields, config, .. } = self.avatar;
        let parameters: usize = fields.parameters().map(<[f32]>::len).named().iter().map(|(_, count)| count).sum();
        let mut facts = vec![Fact::new("Preset", config.preset.clone())];
        facts.extend(self.facts.iter().cloned());
        facts.push(Fact::new("Parameters", grouped(parameters as i64)));
        if let Some(seconds) = training.seconds() {
            facts.push(Fact::new("Time in training steps", duration(seconds)));
        }
        facts
    }
}

impl ShownFrame {
    fn picture(&self) -> Result<Picture> {
        Ok(Picture {
            name: self.name.clone(),
            caption: self.caption.clone(),
            alternative: format!("{}: {}", self.name, self.caption),
            picture: data_uri(&self.picture, PICTURE_WIDTH)?,
        })
    }
}

fn own_picture(picture: &RgbImage) -> Result<Picture> {
    Ok(Picture {
        name: String::new(),
        caption: "The subject, the avatar, and the avatar's shape".into(),
        alternative: "Rows of pictures: the subject, the avatar and its shape in poses that were not trained on".into(),
        picture: data_uri(picture, 2 * PICTURE_WIDTH)?,
    })
}

fn viewer_part(rig: &RiggedMesh, scene: ViewerScene) -> Result<ViewerPart> {
    let mut posed = rig.mesh.clone();
    if rig.animation.frames() > 0 {
        posed.vertices = rig.posed(0);
        posed.normals = None;
    }
    let corner = |fold: fn(Vec3, Vec3) -> Vec3| posed.vertices.iter().copied().reduce(fold).unwrap_or_default();
    let camera = PinholeCamera::framing(corner(Vec3::min), corner(Vec3::max), THREE_QUARTER, POSTER.0, POSTER.1)?;
    let poster = data_uri(&render_mesh(&posed, &camera, View::Colour)?, POSTER.0)?;
    Ok(ViewerPart { heading: "The avatar", scene: scene.json(), poster: Some(poster) })
}

/// The page of a server that answers posts to `endpoint` with the field's meshes, if it does; and the policy to send with it.
///
/// # Errors
/// As [`Report::html`].
pub(crate) fn live_page(
    title: String,
    lead: String,
    rig: &RiggedMesh,
    endpoint: Option<&'static str>,
) -> Result<(String, String)> {
    let scene = ViewerScene::of(rig)?;
    let scene = match endpoint {
        Some(endpoint) => scene.live(endpoint),
        None => scene,
    };
    LivePage { title, lead, viewer: viewer_part(rig, scene)? }.html_and_policy()
}

/// `75` seconds are `1 min 15 s`, on one line.
fn duration(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, _) => format!("{}\u{a0}s", number(seconds)),
        (0, minutes, seconds) => format!("{minutes}\u{a0}min\u{a0}{seconds}\u{a0}s"),
        (hours, minutes, _) => format!("{hours}\u{a0}h\u{a0}{minutes}\u{a0}min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_at_a_glance() {
        let texts = [0.25, 59.0, 75.0, 3600.0, 86399.0].map(|seconds| duration(seconds).replace('\u{a0}', " "));
        assert_eq!(texts, ["0.25 s", "59 s", "1 min 15 s", "1 h 0 min", "23 h 59 min"]);
    }
}
