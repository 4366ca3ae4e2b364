//! Registrations and cameras in JSON, as arrays by name.
//!
//! The entries of an object inside the object are named `outer.inner`; nested lists of numbers are one array. What has no array
//! form (null, lists of different lengths) is left out, as it is of a pickle.

use std::path::Path;

use serde_json::Value;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result, read_text};

const FORMAT: &str = "JSON file of parameters";

/// Reads a JSON object of numbers and lists of numbers.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] naming the line where it breaks off, or if it is no object.
pub(crate) fn read_json_arrays(path: &Path) -> Result<ArrayMap> {
    let text = read_text(path)?;
    let malformed = |place: String, found: String| Error::Malformed {
        path: path.into(),
        format: FORMAT,
        place,
        found,
        expected: "an object such as {\"body_pose\": [...]}".into(),
    };
    let value: Value =
        serde_json::from_str(&text).map_err(|error| malformed(format!("line {}", error.line()), error.to_string()))?;
    if !value.is_object() {
        return Err(malformed("the file".into(), "no object".into()));
    }
    let mut arrays = ArrayMap::new();
    insert("", &value, &mut arrays);
    Ok(arrays)
}

fn insert(name: &str, value: &Value, arrays: &mut ArrayMap) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                let path = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                insert(&path, value, arrays);
            }
        }
        Value::String(text) => {
            arrays.insert(name.to_owned(), Array::from_text(text.clone()));
        }
        Value::Number(_) | Value::Array(_) | Value::Bool(_) => {
            let mut numbers = Vec::new();
            if let Some(shape) = shape(value, &mut numbers) {
                arrays.insert(name.to_owned(), Array { shape, data: ArrayData::F64(numbers) });
            }
        }
        Value::Null => {}
    }
}

/// The extents of nested lists, whose numbers are added to `numbers`; none if rows differ in length or hold other things.
fn shape(value: &Value, numbers: &mut Vec<f64>) -> Option<Vec<usize>> {
    let Value::Array(items) = value else {
        numbers.push(value.as_f64().or_else(|| value.as_bool().map(|flag| u8::from(flag).into()))?);
        return Some(Vec::new());
    };
    let mut rows = items.iter().map(|item| shape(item, numbers));
    let first = match rows.next() {
        Some(first) => first?,
        None => return Some(vec![0]),
    };
    for row in rows {
        if row? != first {
            return None;
        }
    }
    Some([&[items.len()], first.as_slice()].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_lists_are_arrays_and_objects_are_prefixes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.json");
        std::fs::write(
            &path,
            r#"{"betas": [[1, 2.5]], "scale": 2, "smplx": {"transl": [1, 2, 3]}, "gender": "male", "ragged": [[1], [2, 3]], "none": null, "empty": []}"#,
        )
        .unwrap();
        let arrays = read_json_arrays(&path).unwrap();
        assert_eq!(arrays["betas"], Array { shape: vec![1, 2], data: ArrayData::F64(vec![1.0, 2.5]) });
        assert_eq!(arrays["scale"].shape, Vec::<usize>::new());
        assert_eq!(arrays["smplx.transl"].to_f32().unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(arrays["gender"].text(), Some("male"));
        assert_eq!(arrays["empty"].shape, [0]);
        assert!(!arrays.contains_key("ragged") && !arrays.contains_key("none"));
    }

    #[test]
    fn what_is_no_object_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.json");
        for (text, word) in [("{\n\"betas\": [1,\n", "line 3"), ("[1, 2]", "no object")] {
            std::fs::write(&path, text).unwrap();
            let error = read_json_arrays(&path).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("fit.json"), "{error}");
        }
    }
}
