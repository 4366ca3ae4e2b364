//! The index of all subjects: a page that shows each one's state, figures and picture, and leads to its report.

use serde::Serialize;

use super::folder::{State, SubjectFolder};
use super::manifest::Manifest;
use super::summary::Summary;
use crate::Result;
use crate::report::{KeyFigure, REGISTRATION_PAGE, REPORT_FILE, index_page};

/// All that the template takes.
#[derive(Serialize)]
pub(super) struct IndexPage {
    title: String,
    kicker: &'static str,
    lead: String,
    figures: Vec<KeyFigure>,
    rows: Vec<IndexRow>,
}

#[derive(Serialize)]
struct IndexRow {
    name: String,
    state: &'static str,
    words: String,
    steps: Option<u64>,
    /// Chamfer distance in millimetres, normal consistency, overlap.
    metrics: Option<[String; 3]>,
    minutes: Option<String>,
    /// Below the folder of all.
    report: Option<String>,
    registration: Option<String>,
    picture: Option<String>,
    glb: Option<String>,
}

/// The page, whose links are below the manifest's folder.
pub(super) fn html(manifest: &Manifest, summary: &Summary) -> Result<String> {
    let rows = manifest.subjects.iter().zip(&summary.subjects).map(|(plan, row)| {
        let folder = SubjectFolder::new(&manifest.out, plan);
        let link = |path: std::path::PathBuf| {
            let below = path.strip_prefix(&manifest.out).ok().filter(|_| path.is_file())?;
            Some(below.components().map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/"))
        };
        let mark = match &row.state {
            State::Done(mark) => Some(mark),
            _ => None,
        };
        let all = mark.and_then(|mark| mark.metrics.as_ref()?.mean.all);
        let minutes = mark.map(|mark| format!("{:.1}", mark.seconds.values().sum::<f64>() / 60.0));
        IndexRow {
            name: row.name.clone(),
            state: row.state.name(),
            words: row.state.words().into(),
            steps: mark.and_then(|mark| mark.steps),
            metrics: all.map(|all| [format!("{:.2}", all.cd_mm), format!("{:.3}", all.nc), format!("{:.3}", all.iou)]),
            minutes,
            report: link(folder.run().join(REPORT_FILE)),
            registration: link(folder.registered().join(REGISTRATION_PAGE)),
            picture: link(folder.picture()),
            glb: link(folder.glb()),
        }
    });
    let figure = |(label, count): (_, usize)| KeyFigure { label, value: count.to_string(), ..KeyFigure::default() };
    index_page(&IndexPage {
        title: manifest.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        kicker: "Subjects",
        lead: format!("{}.", summary.totals),
        figures: summary.totals.named().map(figure).collect(),
        rows: rows.collect(),
    })
}
