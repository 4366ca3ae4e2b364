//! The words of a BVH file, and the line that each stands on. What follows `#` or `//` is a comment.

use xavatar_formats::{Fault, excerpt};

pub(super) type Parsed<T> = std::result::Result<T, Fault>;

/// A line up to its comment, which the format does not have but some tools write; of a name such as `bone#1` nothing is one.
pub(super) fn without_comment(line: &str) -> &str {
    let marks = line.match_indices('#').chain(line.match_indices("//")).map(|(place, _)| place);
    let begins = |place: &usize| line[..*place].chars().next_back().is_none_or(char::is_whitespace);
    &line[..marks.filter(begins).min().unwrap_or(line.len())]
}

/// A text, read word by word.
pub(super) struct Words<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { rest: text, line: 1 }
    }

    /// What has not been read, and the line that it begins on.
    pub(super) fn rest(&self) -> (&'a str, usize) {
        (self.rest, self.line)
    }

    /// The next word; braces are words of their own, whatever they touch.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        self.skip_blank();
        let end = self.rest.find(char::is_whitespace).unwrap_or(self.rest.len());
        let end = match self.rest[..end].find(['{', '}']) {
            Some(0) => 1,
            Some(brace) => brace,
            None => end,
        };
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    /// What is left of the line but a comment, up to an opening brace, which is left.
    pub(super) fn rest_of_line(&mut self) -> &'a str {
        let end = self.rest.find(['\n', '{']).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest;
        without_comment(line)
    }

    pub(super) fn expect(&mut self, expected: &str) -> Parsed<&'a str> {
        self.next().ok_or_else(|| Fault::malformed("the end", "nothing", expected))
    }

    /// A word of the format, in any case.
    pub(super) fn keyword(&mut self, keyword: &str) -> Parsed<()> {
        let word = self.expect(keyword)?;
        if word.eq_ignore_ascii_case(keyword) { Ok(()) } else { Err(self.fault(excerpt(word), keyword)) }
    }

    /// A word before a value, which its colon may touch: `Frames: 5`, `Frames:5`.
    pub(super) fn label(&mut self, label: &str) -> Parsed<()> {
        self.skip_blank();
        let Some(rest) = self
            .rest
            .get(label.len()..)
            .filter(|_| self.rest.get(..label.len()).is_some_and(|word| word.eq_ignore_ascii_case(label)))
        else {
            let word = self.expect(label)?;
            return Err(self.fault(excerpt(word), label));
        };
        let rest = rest.trim_start_matches([' ', '\t']);
        self.rest = rest.strip_prefix(':').unwrap_or(rest);
        Ok(())
    }

    pub(super) fn number<T: std::str::FromStr>(&mut self, expected: &str) -> Parsed<T> {
        let word = self.expect(expected)?;
        word.parse().map_err(|_| self.fault(excerpt(word), expected))
    }

    pub(super) fn finite(&mut self) -> Parsed<f64> {
        let value: f64 = self.number("a number")?;
        if value.is_finite() { Ok(value) } else { Err(self.fault(value, "a finite number")) }
    }

    pub(super) fn fault(&self, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Fault {
        Fault::malformed(format_args!("line {}", self.line), found, expected)
    }

    /// Goes on to the next word, past comments.
    fn skip_blank(&mut self) {
        loop {
            let start = self.rest.find(|character: char| !character.is_whitespace()).unwrap_or(self.rest.len());
            self.line += self.rest[..start].matches('\n').count();
            self.rest = &self.rest[start..];
            if !(self.rest.starts_with('#') || self.rest.starts_with("//")) {
                return;
            }
            let end = self.rest.find('\n').unwrap_or(self.rest.len());
            self.rest = &self.rest[end..];
        }
    }
}
