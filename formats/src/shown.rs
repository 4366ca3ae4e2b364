//! Text that came from elsewhere, as messages show it: one line of bounded length that no terminal obeys.
//!
//! Control characters move the cursor, retitle the window or hide what stands before them; the marks of writing direction reorder
//! it. They are shown as `\u001b`, which is the same character to a reader of JSON.

use std::fmt::{self, Display, Formatter, Write};

/// Characters shown of a text; the rest is counted.
const SHOWN: usize = 600;

/// A text on one line, cut.
pub struct Shown<T>(pub T);

impl<T: Display> Display for Shown<T> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let mut line = Line { formatter, shown: 0, left_out: 0 };
        write!(line, "{}", self.0)?;
        match line.left_out {
            0 => Ok(()),
            count => write!(formatter, "… ({count} characters more)"),
        }
    }
}

struct Line<'a, 'b> {
    formatter: &'a mut Formatter<'b>,
    shown: usize,
    left_out: usize,
}

impl Write for Line<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            if self.shown == SHOWN {
                self.left_out += 1;
                continue;
            }
            self.shown += 1;
            match character {
                '\n' => self.formatter.write_str("\\n")?,
                '\t' => self.formatter.write_str("\\t")?,
                character => write_harmless(self.formatter, character)?,
            }
        }
        Ok(())
    }
}

/// A text whose lines and columns stay, and in which nothing else steers a terminal; valid JSON stays valid JSON.
pub fn harmless(text: &str) -> std::borrow::Cow<'_, str> {
    let is_laid_out = |character| matches!(character, '\n' | '\t');
    if !text.chars().any(|character| steers(character) && !is_laid_out(character)) {
        return text.into();
    }
    let mut harmless = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if is_laid_out(character) {
            harmless.push(character);
        } else {
            // Writing to a string does not fail.
            let _ = write_harmless(&mut harmless, character);
        }
    }
    harmless.into()
}

fn write_harmless(to: &mut impl Write, character: char) -> fmt::Result {
    if steers(character) { write!(to, "\\u{:04x}", u32::from(character)) } else { to.write_char(character) }
}

/// Whether the character does something other than being seen.
fn steers(character: char) -> bool {
    character.is_control()
        // Marks, embeddings, overrides and isolates of writing direction; separators of lines and paragraphs.
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "a\u{1b}]0;title\u{7}\u{1b}[2J\r\n\tb\u{9b}31m\u{7f}\u{202e}é";

    #[test]
    fn what_is_shown_is_one_line_that_no_terminal_obeys() {
        assert_eq!(
            Shown(HOSTILE).to_string(),
            "a\\u001b]0;title\\u0007\\u001b[2J\\u000d\\n\\tb\\u009b31m\\u007f\\u202eé"
        );
    }

    #[test]
    fn long_texts_are_cut_and_say_so() {
        let shown = Shown("é".repeat(100_000)).to_string();
        assert_eq!(shown.chars().filter(|character| *character == 'é').count(), SHOWN);
        assert!(shown.ends_with("… (99400 characters more)"), "{shown}");
        assert_eq!(Shown("é".repeat(SHOWN)).to_string(), "é".repeat(SHOWN));
    }

    #[test]
    fn harmless_text_keeps_its_lines_and_its_json() {
        assert_eq!(harmless("two\n\tlines, é"), "two\n\tlines, é");
        assert_eq!(harmless("\u{1b}[2J\n\u{9b}"), "\\u001b[2J\n\\u009b");
        let json = serde_json::to_string(&[HOSTILE]).unwrap();
        let read: Vec<String> = serde_json::from_str(&harmless(&json)).unwrap();
        assert_eq!(read, [HOSTILE]);
    }
}
