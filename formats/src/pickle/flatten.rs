//! From a tree of Python values to arrays by name.

use std::sync::Arc;

use super::budget::Budget;
use super::value::Value;
use crate::fault::Fault;
use crate::{Array, ArrayData, ArrayMap};

/// Adds everything under `value` that has an array form to `arrays`: a dict's entries as `name.key` (or `key`, where
/// `name` is empty), a list with a single dict in it as that dict, the items of a list of dicts as `name[0]`, `name[1]`, ...,
/// nested lists of numbers as one array.
pub(crate) fn flatten(name: &str, value: Value, file_bytes: usize, arrays: &mut ArrayMap) -> Result<(), Fault> {
    insert(name, value, &mut Budget::for_file(file_bytes), arrays)
}

fn insert(name: &str, value: Value, budget: &mut Budget, arrays: &mut ArrayMap) -> Result<(), Fault> {
    match value {
        Value::Dict(entries) => {
            for (key, value) in entries {
                let key = match key {
                    Value::Text(key) => key,
                    Value::Int(key) => key.to_string(),
                    _ => continue,
                };
                let path = if name.is_empty() { key } else { format!("{name}.{key}") };
                budget.spend(path.len(), "names")?;
                insert(&path, value, budget, arrays)?;
            }
        }
        // A dict that numpy saved is an array of one object.
        Value::List(items) if matches!(items[..], [Value::Dict(_)]) => {
            for item in items {
                insert(name, item, budget, arrays)?;
            }
        }
        // A dict a frame, as pose estimators have them.
        Value::List(items) if items.iter().any(|item| matches!(item, Value::Dict(_))) => {
            for (index, item) in items.into_iter().enumerate() {
                let path = format!("{name}[{index}]");
                budget.spend(path.len(), "names")?;
                insert(&path, item, budget, arrays)?;
            }
        }
        value => {
            if let Some(array) = array(value, budget)? {
                arrays.insert(name.to_owned(), array);
            }
        }
    }
    Ok(())
}

/// The array form of a value, if it has one.
fn array(value: Value, budget: &mut Budget) -> Result<Option<Array>, Fault> {
    let scalar = |data| Some(Array { shape: Vec::new(), data });
    Ok(match value {
        Value::Bool(value) => scalar(ArrayData::U8(vec![value.into()])),
        Value::Int(value) => scalar(ArrayData::I64(vec![value])),
        Value::Float(value) => scalar(ArrayData::F64(vec![value])),
        Value::Text(text) => Some(Array::from_text(text)),
        Value::Array(shared) => match Arc::try_unwrap(shared) {
            Ok(array) => Some(array),
            Err(shared) => {
                budget.spend(shared.data.bytes(), "an array that several names share")?;
                Some(Array::clone(&shared))
            }
        },
        Value::List(items) | Value::Tuple(items) => {
            let mut rows = Vec::with_capacity(items.len());
            for item in items {
                budget.spend(2 * size_of::<Array>(), "rows")?;
                match array(item, budget)? {
                    Some(row) => rows.push(row),
                    None => return Ok(None),
                }
            }
            stacked(rows)
        }
        Value::None | Value::Bytes(_) | Value::Dict(_) => None,
    })
}

/// Rows of one shape as one array with one more axis; `None` if the shapes differ or there is text among them.
fn stacked(rows: Vec<Array>) -> Option<Array> {
    let inner = rows.first().map_or(&[][..], |row| &row.shape);
    if rows.iter().any(|row| row.shape != inner || row.text().is_some()) {
        return None;
    }
    let shape = [&[rows.len()], inner].concat();
    let integers: Option<Vec<&[i64]>> = rows
        .iter()
        .map(|row| match &row.data {
            ArrayData::I64(values) => Some(values.as_slice()),
            _ => None,
        })
        .collect();
    let data = match integers {
        Some(integers) if !integers.is_empty() => ArrayData::I64(integers.concat()),
        _ => ArrayData::F64(rows.iter().filter_map(Array::to_f64).flatten().collect()),
    };
    Some(Array { shape, data })
}
