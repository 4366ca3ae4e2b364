//! What `train`, `eval` and `demo` tell the report, beside what the library knows.

use std::path::Path;

use xavatar::avatar::Avatar;
use xavatar::body::{BodyModel, PartLabels};
use xavatar::data::ScanFrame;
use xavatar::evaluate;
use xavatar::mesh::TriangleMesh;
use xavatar::report::{Fact, ShownFrame, closeup};

use crate::cli::options::inputs::SubjectArguments;

/// The frames with the smallest and the largest error, as `frame` gives them: the scan and the avatar's mesh.
pub fn best_and_worst(
    report: &evaluate::Report,
    mut frame: impl FnMut(&str) -> anyhow::Result<(ScanFrame, TriangleMesh)>,
) -> anyhow::Result<Vec<ShownFrame>> {
    let Some((best, worst)) = report.best_and_worst() else { return Ok(Vec::new()) };
    let mut shown = vec![("Best", best)];
    if worst.frame != best.frame {
        shown.push(("Worst", worst));
    }
    let show = |(name, measured): (&str, &evaluate::FrameReport)| {
        let (scan, mesh) = frame(&measured.frame)?;
        let distance = measured.metrics.all.map_or_else(String::new, |all| format!(", CD {:.2} mm", all.cd_mm));
        let caption = format!("{}{distance}", measured.frame);
        Ok(ShownFrame { name: name.into(), caption, picture: closeup(&scan.scan, &mesh)? })
    };
    shown.into_iter().map(show).collect()
}

/// What a page about the avatar in a file or folder is called.
pub fn title(avatar: &Path) -> String {
    let named =
        if avatar.file_name().is_some_and(|name| name == Avatar::FILE) { avatar.parent() } else { Some(avatar) };
    let named = named.and_then(|path| std::path::absolute(path).ok());
    let name = named.as_deref().and_then(Path::file_stem).map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "avatar".into())
}

/// The command as it was given, quoted so that a shell would take it again.
pub fn command_line() -> String {
    let arguments = std::env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    std::iter::once("xavatar".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// What an avatar was learned from or measured on.
pub fn data_facts(arguments: &SubjectArguments, body: &BodyModel, labels: &PartLabels) -> Vec<Fact> {
    vec![
        Fact::new("Data", arguments.data.display().to_string()),
        Fact::new("Body model", body.path().display().to_string()),
        Fact::new("Part labels", labels.source.to_string()),
    ]
}

fn quoted(argument: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_./=+,:@%".contains(&byte);
    if !argument.is_empty() && argument.bytes().all(is_plain) {
        return argument.into();
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_quoted_for_a_shell() {
        assert_eq!(quoted("--set=a.b=1e-3"), "--set=a.b=1e-3");
        assert_eq!(quoted("my data"), "'my data'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn avatars_are_called_by_their_folder_or_file() {
        assert_eq!(title(Path::new("runs/00016")), "00016");
        assert_eq!(title(Path::new("runs/00016/avatar.safetensors")), "00016");
        assert_eq!(title(Path::new("kept/anna.safetensors")), "anna");
    }
}
