//! Mesh files that are text, whoever wrote them: UTF-8 or UTF-16, any line end, lines that a backslash continues.

use std::borrow::Cow;

/// The text in `bytes`: UTF-16 if a byte order mark or the zeros of its ASCII letters say so, else UTF-8. What is neither is
/// replaced: only names can be other than ASCII.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match bytes {
        [0xff, 0xfe, rest @ ..] => utf_16(rest, u16::from_le_bytes).into(),
        [0xfe, 0xff, rest @ ..] => utf_16(rest, u16::from_be_bytes).into(),
        [1..=255, 0, 1..=255, 0, ..] => utf_16(bytes, u16::from_le_bytes).into(),
        [0, 1..=255, 0, 1..=255, ..] => utf_16(bytes, u16::from_be_bytes).into(),
        _ => String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    }
}

fn utf_16(bytes: &[u8], unit: impl Fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks::<2>().0.iter().map(|&pair| unit(pair));
    char::decode_utf16(units).map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

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
    fn every_encoding_says_the_same() {
        let text = "v 1 2 3\nusemtl Größe\n";
        let units: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for bytes in [
            text.as_bytes().to_vec(),
            marked(b"\xef\xbb\xbf", text.as_bytes()),
            marked(b"\xff\xfe", &little),
            marked(b"\xfe\xff", &big),
            little,
            big,
        ] {
            assert_eq!(decode(&bytes), text, "{bytes:?}");
        }
    }

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
