//! Numbers, text and bytes as a pickle spells them, binary or (protocol 0) on a line of text.

use std::borrow::Cow;

use super::cursor::Cursor;
use super::node::Node;
use crate::fault::{Fault, excerpt};

fn broken(cursor: &Cursor, found: impl std::fmt::Display, expected: &str) -> Fault {
    Fault::malformed(format_args!("the value that ends at byte {}", cursor.position()), found, expected)
}

/// Text of a counted length, UTF-8.
pub(super) fn text<'a, const WIDTH: usize>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let bytes = cursor.counted::<WIDTH>()?;
    let text = std::str::from_utf8(bytes).map_err(|_| broken(cursor, "invalid UTF-8", "text"))?;
    Ok(Node::Text(Cow::Borrowed(text)))
}

/// Bytes of a counted length.
pub(super) fn bytes<'a, const WIDTH: usize>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    Ok(Node::Bytes(Cow::Borrowed(cursor.counted::<WIDTH>()?)))
}

/// A Python 2 string, which does not say whether it is text: what is valid UTF-8 is, and keeps its bytes either way.
pub(super) fn python2_string<'a, const WIDTH: usize>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let bytes = cursor.counted::<WIDTH>()?;
    let text = std::str::from_utf8(bytes).map(|text| Node::Text(Cow::Borrowed(text)));
    Ok(text.unwrap_or(Node::Bytes(Cow::Borrowed(bytes))))
}

/// A two's-complement little-endian integer of a counted length.
pub(super) fn long<'a, const WIDTH: usize>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let bytes = cursor.counted::<WIDTH>()?;
    let negative = bytes.last().is_some_and(|&byte| byte & 0x80 != 0);
    let sign = if negative { 0xff } else { 0x00 };
    let (low, high) = bytes.split_at(bytes.len().min(8));
    let mut wide = [sign; 8];
    wide[..low.len()].copy_from_slice(low);
    let value = i64::from_le_bytes(wide);
    if high.iter().any(|&byte| byte != sign) || (value < 0) != negative {
        return Err(broken(cursor, "an integer of more than 64 bits", "a 64-bit integer"));
    }
    Ok(Node::Int(value))
}

/// `12`, or `00` and `01` for the booleans of protocols 0 and 1.
pub(super) fn decimal_or_bool<'a>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    match cursor.line()? {
        "00" => Ok(Node::Bool(false)),
        "01" => Ok(Node::Bool(true)),
        digits => decimal(cursor, digits),
    }
}

/// `12L`.
pub(super) fn decimal_long<'a>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let line = cursor.line()?;
    decimal(cursor, line.strip_suffix('L').unwrap_or(line))
}

fn decimal<'a>(cursor: &Cursor<'a>, digits: &str) -> Result<Node<'a>, Fault> {
    digits.trim().parse().map(Node::Int).map_err(|_| broken(cursor, excerpt(digits), "a 64-bit integer"))
}

/// The memo index of GET and PUT.
pub(super) fn decimal_index(cursor: &mut Cursor) -> Result<u32, Fault> {
    let line = cursor.line()?;
    line.trim().parse().map_err(|_| broken(cursor, excerpt(line), "a memo index"))
}

/// `1.5`, `-inf`, `nan`.
pub(super) fn decimal_float<'a>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let line = cursor.line()?;
    line.trim().parse().map(Node::Float).map_err(|_| broken(cursor, excerpt(line), "a number"))
}

/// Protocol 0 text: Latin-1 with `\uXXXX` and `\UXXXXXXXX` escapes (Python's raw-unicode-escape).
pub(super) fn escaped_unicode<'a>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let mut rest = cursor.line_bytes()?;
    let mut text = String::with_capacity(rest.len());
    while let Some((&first, after)) = rest.split_first() {
        let digits = match (first, after.first()) {
            (b'\\', Some(b'u')) => 4,
            (b'\\', Some(b'U')) => 8,
            _ => {
                text.push(char::from(first));
                rest = after;
                continue;
            }
        };
        let code = after.get(1..=digits).and_then(|code| std::str::from_utf8(code).ok());
        let code = code.and_then(|code| u32::from_str_radix(code, 16).ok()).and_then(char::from_u32);
        text.push(code.ok_or_else(|| broken(cursor, "an invalid escape", "a Unicode escape"))?);
        rest = &after[1 + digits..];
    }
    Ok(Node::Text(Cow::Owned(text)))
}

/// Protocol 0 Python 2 string: a quoted literal with backslash escapes.
pub(super) fn quoted_string<'a>(cursor: &mut Cursor<'a>) -> Result<Node<'a>, Fault> {
    let line = cursor.line_bytes()?.trim_ascii();
    let inside = match line {
        [b'\'', inside @ .., b'\''] | [b'"', inside @ .., b'"'] => inside,
        _ => return Err(broken(cursor, "an unquoted string", "a quoted string")),
    };
    let mut bytes = Vec::with_capacity(inside.len());
    let mut rest = inside.iter().copied();
    while let Some(byte) = rest.next() {
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        bytes.push(match rest.next() {
            Some(b'n') => b'\n',
            Some(b'r') => b'\r',
            Some(b't') => b'\t',
            Some(escaped @ (b'\\' | b'\'' | b'"')) => escaped,
            Some(b'x') => {
                let mut digit = || rest.next().and_then(|byte| char::from(byte).to_digit(16));
                match (digit(), digit()) {
                    (Some(high), Some(low)) => (high << 4 | low) as u8,
                    _ => return Err(broken(cursor, "an invalid escape", "two hexadecimal digits")),
                }
            }
            _ => return Err(broken(cursor, "an unknown escape", "an escape that Python's repr writes")),
        });
    }
    Ok(match String::from_utf8(bytes) {
        Ok(text) => Node::Text(Cow::Owned(text)),
        Err(error) => Node::Bytes(Cow::Owned(error.into_bytes())),
    })
}
