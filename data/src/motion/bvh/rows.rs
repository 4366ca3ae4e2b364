//! The rows of a BVH file: one of channel values a frame, as many as the file says or, where it miscounts, as there are.
//!
//! Exporters miscount by one, and recordings are cut off: then every line must be a whole row, and what is left of the last one
//! is dropped. Memory grows only with the numbers that are there, whatever counts the file claims.

use xavatar_formats::{Fault, excerpt};

use super::text::{Parsed, without_comment};

/// The values of all whole rows of `width`, and what was odd about them. `text` begins on the given line.
pub(super) fn read(text: &str, line: usize, frames: usize, width: usize) -> Parsed<(Vec<f64>, Option<String>)> {
    let mut values = Vec::new();
    // The first line that is no row, and how many numbers it has.
    let mut uneven: Option<(usize, usize)> = None;
    let lines = text.split('\n').map(without_comment).enumerate();
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty()).peekable();
    let mut rows = 0;
    let mut cut_off = 0;
    while let Some((index, content)) = lines.next() {
        let before = values.len();
        let is_last = lines.peek().is_none();
        for word in content.split_whitespace() {
            match word.parse().ok().filter(|value: &f64| value.is_finite()) {
                Some(value) => values.push(value),
                // The end of a recording may fall into a number.
                None if is_last && content.trim_end().ends_with(word) && !text.ends_with('\n') => {}
                None => {
                    return Err(Fault::malformed(
                        format_args!("line {}", line + index),
                        excerpt(word),
                        "a finite number",
                    ));
                }
            }
        }
        let count = values.len() - before;
        match count {
            count if count == width => rows += 1,
            count if is_last && count < width => cut_off = count,
            count => _ = uneven.get_or_insert((line + index, count)),
        }
    }
    // Rows may stand on lines in any way while their number is right.
    if Some(values.len()) == frames.checked_mul(width) {
        return Ok((values, None));
    }
    if let Some((line, count)) = uneven {
        let expected = format!("{width}, the channels of the skeleton, or {frames} frames in all");
        return Err(Fault::malformed(format_args!("line {line}"), format_args!("{count} numbers"), expected));
    }
    if rows == 0 {
        let found = format!("{} numbers", values.len());
        return Err(Fault::malformed("the end", found, format_args!("{frames} frames of {width} channels")));
    }
    values.truncate(rows * width);
    let rest = match cut_off {
        0 => String::new(),
        count => format!("; the last row is cut off after {count} of {width} numbers and left out"),
    };
    Ok((values, Some(format!("the file says {frames} frames and has {rows}: {rows} are read{rest}"))))
}
