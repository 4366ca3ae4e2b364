//! The page itself: the templates of `assets/report/`, filled in. Whatever is put in is escaped, so that no name of a file, an
//! avatar or a loss is ever markup or script; and only the page's own script runs, and nothing is loaded.

use std::hash::{BuildHasher, Hasher, RandomState};

use minijinja::Environment;
use minijinja::value::Serde;
use serde::Serialize;

use super::chart::Chart;
use super::metrics::MetricsTable;
use crate::{Error, InputError, Result};

const STYLE: &str = include_str!("../../assets/report/style.css");
/// One module in the page, in this order.
const SCRIPT: [&str; 7] = [
    include_str!("../../assets/report/viewer/rotation.js"),
    include_str!("../../assets/report/viewer/avatar.js"),
    include_str!("../../assets/report/viewer/drawing.js"),
    include_str!("../../assets/report/viewer/handles.js"),
    include_str!("../../assets/report/viewer/orbit.js"),
    include_str!("../../assets/report/viewer/viewer.js"),
    include_str!("../../assets/report/viewer/live.js"),
];
const START: &str = include_str!("../../assets/report/viewer/main.js");
const TEMPLATES: [(&str, &str); 7] = [
    ("page.html", include_str!("../../assets/report/page.html")),
    ("index.html", include_str!("../../assets/report/index.html")),
    ("report.html", include_str!("../../assets/report/report.html")),
    ("view.html", include_str!("../../assets/report/view.html")),
    ("viewer.html", include_str!("../../assets/report/viewer.html")),
    ("chart.html", include_str!("../../assets/report/chart.html")),
    ("figure.xml", include_str!("../../assets/report/figure.xml")),
];

/// Its own styles, and pictures beside the page.
const INDEX_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' file: data:";

/// A label and its value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fact {
    /// What it is.
    pub label: String,
    /// What was found.
    pub value: String,
}

impl Fact {
    /// A fact.
    pub fn new(label: impl Into<String>, value: impl Into<String>) -> Self {
        Self { label: label.into(), value: value.into() }
    }
}

/// All that the report's template takes.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct ReportPage {
    pub(super) title: String,
    pub(super) kicker: &'static str,
    pub(super) lead: String,
    pub(super) figures: Vec<KeyFigure>,
    pub(super) viewer: Option<ViewerPart>,
    pub(super) metrics: Option<MetricsTable>,
    pub(super) frames_heading: &'static str,
    pub(super) frames: Vec<Picture>,
    pub(super) training_caption: String,
    pub(super) curves: Vec<Curve>,
    pub(super) pictures_heading: &'static str,
    pub(super) pictures: Vec<Picture>,
    pub(super) command: String,
    pub(super) facts: Vec<Fact>,
    pub(super) configuration: String,
}

/// All that the live view's template takes.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LivePage {
    pub(super) title: String,
    pub(super) lead: String,
    pub(super) viewer: ViewerPart,
}

/// A number worth a large font.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct KeyFigure {
    pub(crate) label: &'static str,
    pub(crate) value: String,
    pub(crate) unit: &'static str,
}

/// The viewer: its data as JSON that may stand in a script element, and what is seen without it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ViewerPart {
    pub(super) heading: &'static str,
    pub(super) scene: String,
    pub(super) poster: Option<String>,
}

/// A picture with its texts.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Picture {
    pub(super) name: String,
    pub(super) caption: String,
    pub(super) alternative: String,
    /// A data URI.
    pub(super) picture: String,
}

/// A loss over the steps.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Curve {
    pub(super) name: String,
    pub(super) caption: String,
    pub(super) chart: Chart,
}

/// What both templates take beside their own.
#[derive(Serialize)]
struct Filled<'a, T> {
    #[serde(flatten)]
    page: &'a T,
    version: &'static str,
    style: &'static str,
    script: String,
    /// What the page's own script is known by: drawn anew for each page, so that no text written before can guess it.
    nonce: String,
    policy: String,
}

impl ReportPage {
    /// The page as one file.
    pub(super) fn html(&self) -> Result<String> {
        filled("report.html", self, &format!("{:016x}", random()))
    }
}

impl LivePage {
    /// The page, and the policy that it has to be sent with.
    pub(super) fn html_and_policy(&self) -> Result<(String, String)> {
        let nonce = format!("{:016x}", random());
        Ok((filled("view.html", self, &nonce)?, policy(&nonce, "'self'")))
    }
}

fn filled(name: &'static str, page: &impl Serialize, nonce: &str) -> Result<String> {
    let filled = Filled {
        page,
        version: env!("CARGO_PKG_VERSION"),
        style: STYLE,
        script: [&SCRIPT[..], &[START]].concat().join("\n"),
        nonce: nonce.into(),
        policy: policy(nonce, "'none'"),
    };
    template(name, filled)
}

/// The index of many avatars, which leads to their pages: a page without a script, of the values that `assets/report/index.html` takes.
///
/// # Errors
/// [`InputError::Value`] if the values do not fit.
pub(crate) fn index_page(values: &impl Serialize) -> Result<String> {
    #[derive(Serialize)]
    struct Index<'a, T> {
        #[serde(flatten)]
        page: &'a T,
        version: &'static str,
        style: &'static str,
        policy: &'static str,
    }
    template(
        "index.html",
        Index { page: values, version: env!("CARGO_PKG_VERSION"), style: STYLE, policy: INDEX_POLICY },
    )
}

/// The template of that name, filled in.
pub(super) fn template(name: &'static str, values: impl Serialize) -> Result<String> {
    let broken = |error: minijinja::Error| {
        Error::from(InputError::Value {
            name: format!("the report's template {name}"),
            found: error.to_string(),
            expected: "a template that fits its page".into(),
        })
    };
    // Templates that end in .html and .xml have everything escaped that they do not call safe.
    let mut environment = Environment::new();
    for (name, source) in TEMPLATES {
        environment.add_template(name, source).map_err(broken)?;
    }
    environment.get_template(name).and_then(|template| template.render(Serde(values))).map_err(broken)
}

/// The page's own script, its own styles, pictures inside it; and requests to `servers` only.
fn policy(nonce: &str, servers: &str) -> String {
    format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src data:; connect-src {servers}; \
         base-uri 'none'; form-action 'none'"
    )
}

/// From the random keys that the standard library gives its hash tables.
fn random() -> u64 {
    RandomState::new().build_hasher().finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "\"'></title></script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;";

    // Every text of a page, from a file's name to a loss's, can be anything.
    #[test]
    fn hostile_names_are_text() {
        let hostile = || HOSTILE.to_string();
        let picture = || Picture {
            name: hostile(),
            caption: hostile(),
            alternative: hostile(),
            picture: "data:image/png;base64,".into(),
        };
        let chart = Chart::curve(hostile(), &[(1.0, 2.0), (2.0, 1.0)]).unwrap();
        let page = ReportPage {
            title: hostile(),
            lead: hostile(),
            frames: vec![picture()],
            pictures: vec![picture()],
            training_caption: hostile(),
            curves: vec![Curve { name: hostile(), caption: hostile(), chart }],
            command: hostile(),
            facts: vec![Fact::new(hostile(), hostile())],
            configuration: hostile(),
            ..ReportPage::default()
        };
        let html = page.html().unwrap();
        assert!(!html.contains("<script"), "without a viewer there is no script at all");
        assert!(!html.contains("onerror=alert(2)>"), "{html}");
        assert_eq!(html.matches("<img").count(), 2, "our own pictures");
        assert!(html.contains("&lt;script&gt;alert(1)"), "shown as it is written");
    }

    #[test]
    fn only_the_pages_own_script_may_run_and_nothing_is_loaded() {
        let viewer = ViewerPart { heading: "The avatar", scene: "{}".into(), poster: None };
        let page = ReportPage { title: "run".into(), viewer: Some(viewer), ..ReportPage::default() };
        let html = page.html().unwrap();
        let nonce = html.split("<script nonce=\"").nth(1).unwrap().split('"').next().unwrap();
        assert!(html.contains(&format!("script-src &#x27;nonce-{nonce}&#x27;")), "{}", &html[..1500]);
        assert!(html.contains("connect-src &#x27;none&#x27;"));
        assert_ne!(html, page.html().unwrap(), "a nonce is used once");
        for loaded in ["http://", "https://", "@import", "url("] {
            assert!(!html.contains(loaded), "{loaded}");
        }
        for handler in [" onclick=", " onload=", " onerror="] {
            assert!(!html.contains(handler), "{handler}");
        }
    }
}
