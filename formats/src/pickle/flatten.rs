//! From a tree of Python values to arrays by name.

use std::sync::Arc;

use super::value::Value;
use crate::budget::Budget;
use crate::fault::Fault;
use crate::{Array, ArrayData, ArrayMap};

/// Adds everything under `value` that has an array form to `arrays`: a dict's entries as `name.key` (or `key`, where
/// `name` is empty), a list with a single dict in it as that dict, the items of a list of dicts as `name[0]`, `name[1]`, ...,
/// nested lists of numbers as one array.
pub(crate) fn flatten(name: &str, value: Value, budget: &Budget, arrays: &mut ArrayMap) -> Result<(), Fault> {
    match value {
        Value::Dict(entries) => {
            for (key, value) in entries {
                let key = match key {
                    Value::Text(key) => key,
                    Value::Int(key) => key.to_string(),
                    // A number of numpy's, as trackers count people.
                    Value::Array(key) => match (&key.shape[..], &key.data) {
                        ([], ArrayData::I64(number)) => number[0].to_string(),
                        _ => continue,
                    },
                    _ => continue,
                };
                let path = if name.is_empty() { key } else { format!("{name}.{key}") };
                budget.spend(path.len(), "names")?;
                flatten(&path, value, budget, arrays)?;
            }
        }
        // A dict that numpy saved is an array of one object.
        Value::List(items) if matches!(items[..], [Value::Dict(_)]) => {
            for item in items {
                flatten(name, item, budget, arrays)?;
            }
        }
        // A dict a frame, as pose estimators have them.
        Value::List(items) if items.iter().any(|item| matches!(item, Value::Dict(_))) => {
            for (index, item) in items.into_iter().enumerate() {
                let path = format!("{name}[{index}]");
                budget.spend(path.len(), "names")?;
                flatten(&path, item, budget, arrays)?;
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
fn array(value: Value, budget: &Budget) -> Result<Option<Array>, Fault> {
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
        Value::List(items) | Value::Tuple(items) => match numbers(&items, budget)? {
            Some(data) => Some(Array { shape: vec![items.len()], data }),
            None => {
                let mut rows = budget.vector(items.len(), "rows")?;
                for item in items {
                    match array(item, budget)? {
                        Some(row) => rows.push(row),
                        None => return Ok(None),
                    }
                }
                stacked(rows, budget)?
            }
        },
        Value::None | Value::Bytes(_) | Value::Dict(_) => None,
    })
}

/// A list of plain numbers: integers if all are, else floats; `None` if anything else is among them.
fn numbers(items: &[Value], budget: &Budget) -> Result<Option<ArrayData>, Fault> {
    let integer = |item: &Value| match item {
        Value::Int(value) => Some(*value),
        _ => None,
    };
    let float = |item: &Value| match item {
        Value::Int(value) => Some(*value as f64),
        Value::Float(value) => Some(*value),
        Value::Bool(value) => Some(f64::from(u8::from(*value))),
        _ => None,
    };
    if items.iter().any(|item| float(item).is_none()) {
        return Ok(None);
    }
    if !items.is_empty() && items.iter().all(|item| integer(item).is_some()) {
        let mut values = budget.vector(items.len(), "numbers")?;
        values.extend(items.iter().filter_map(integer));
        return Ok(Some(ArrayData::I64(values)));
    }
    let mut values = budget.vector(items.len(), "numbers")?;
    values.extend(items.iter().filter_map(float));
    Ok(Some(ArrayData::F64(values)))
}

/// Rows of one shape as one array with one more axis; `None` if the shapes differ or there is text among them.
fn stacked(rows: Vec<Array>, budget: &Budget) -> Result<Option<Array>, Fault> {
    let inner = rows.first().map_or(&[][..], |row| &row.shape);
    if rows.iter().any(|row| row.shape != inner || row.text().is_some()) {
        return Ok(None);
    }
    let shape = [&[rows.len()], inner].concat();
    let elements = rows.iter().map(Array::elements).sum();
    let integers: Option<Vec<&[i64]>> = rows
        .iter()
        .map(|row| match &row.data {
            ArrayData::I64(values) => Some(values.as_slice()),
            _ => None,
        })
        .collect();
    let data = match integers {
        Some(integers) if !integers.is_empty() => {
            let mut values = budget.vector(elements, "rows")?;
            integers.into_iter().for_each(|row| values.extend_from_slice(row));
            ArrayData::I64(values)
        }
        _ => {
            let mut values = budget.vector(elements, "rows")?;
            rows.iter().filter_map(Array::to_f64).for_each(|row| values.extend(row));
            ArrayData::F64(values)
        }
    };
    Ok(Some(Array { shape, data }))
}
