//! Values as USD's text has them.

use std::fmt::Write;

use glam::{Affine3A, Quat, Vec3};

/// Digits after the point: micrometres of places, millionths of weights.
const SCALE: f64 = 1e6;

/// A number, as short as it can be.
pub(super) fn number(value: f32) -> String {
    let rounded = (f64::from(value) * SCALE).round() / SCALE;
    // Not -0.
    format!("{}", rounded + 0.0)
}

/// A tuple of numbers.
pub(super) fn tuple(values: &[f32]) -> String {
    let mut text = String::from("(");
    for (place, value) in values.iter().enumerate() {
        let _ = write!(text, "{}{}", if place > 0 { ", " } else { "" }, number(*value));
    }
    text + ")"
}

/// A list of what `text` makes of items.
pub(super) fn list<T>(items: impl IntoIterator<Item = T>, text: impl Fn(T) -> String) -> String {
    let mut all = String::from("[");
    for (place, item) in items.into_iter().enumerate() {
        if place > 0 {
            all += ", ";
        }
        all += &text(item);
    }
    all + "]"
}

pub(super) fn vector(value: Vec3) -> String {
    tuple(&value.to_array())
}

/// The real part first.
pub(super) fn quaternion(value: Quat) -> String {
    tuple(&[value.w, value.x, value.y, value.z])
}

/// Rows are what columns are elsewhere.
pub(super) fn matrix(value: Affine3A) -> String {
    let rows = glam::Mat4::from(value).to_cols_array_2d();
    format!("({})", rows.map(|row| tuple(&row)).join(", "))
}

/// A token or a text in quotes.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}

/// A name that a prim may have: of letters, digits and `_`, not beginning with a digit.
pub(super) fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '_' }).collect();
    match plain.chars().next() {
        Some(first) if !first.is_ascii_digit() => plain,
        _ => format!("_{plain}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_short_as_they_can_be() {
        assert_eq!([0.5, -0.0, 1e-9, 1.234_567_8, 3.0].map(number), ["0.5", "0", "0", "1.234568", "3"]);
        assert_eq!(quaternion(Quat::IDENTITY), "(1, 0, 0, 0)");
        let moved = matrix(Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(moved, "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1))");
        assert_eq!(list([1, 2], |number| number.to_string()), "[1, 2]");
        assert_eq!([identifier("left_hip"), identifier("2 eyes.l"), identifier("")], ["left_hip", "_2_eyes_l", "_"]);
        assert_eq!(quoted("a \"b\" \\"), r#""a \"b\" \\""#);
    }
}
