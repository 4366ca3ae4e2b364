//! The lines of mesh files that are text, whoever wrote them: any line end, lines that a backslash continues.

use std::borrow::Cow;

/// The lines of a text with their numbers, from 1. One that ends in a backslash goes on in the next, unless it is a comment.
pub(super) fn numbered_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let mut lines = text.split(end).map(str::trim).enumerate();
    std::iter::from_fn(move || {
        let (index, line) = lines.next()?;
        let mut line = Cow::Borrowed(line);
        while !line.starts_with('#') && line.ends_with('\\') {
            let owned = line.to_mut();
            owned.pop();
            let Some((_, next)) = lines.next() else { break };
            owned.push(' ');
            owned.push_str(next);
        }
        Some((index + 1, line))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_any_way_and_go_on_after_a_backslash() {
        for text in [
            "a\n\nf 1 \\\n2\\\n3\n# C:\\\nb\\",
            "a\r\n\r\nf 1 \\\r\n2\\\r\n3\r\n# C:\\\r\nb\\",
            "a\r\rf 1 \\\r2\\\r3\r# C:\\\rb\\",
        ] {
            let lines: Vec<(usize, Cow<str>)> = numbered_lines(text).filter(|(_, line)| !line.is_empty()).collect();
            assert_eq!(lines, [(1, "a".into()), (3, "f 1  2 3".into()), (6, "# C:\\".into()), (7, "b".into())]);
        }
    }
}
