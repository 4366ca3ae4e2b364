//! Instances of the few classes that data files are known to hold, as the arrays inside them.
//!
//! - scipy `csc_matrix`, `csr_matrix` (and `_array`): densified, duplicates added up, as `toarray()` does;
//! - joblib `NumpyArrayWrapper`: an array already, once it has its state (see [`super::callables`]);
//! - modules of TorchScript: the dict of their attributes;
//! - chumpy `Ch`: its array `x`; `Select` (`shapedirs` of SMPL files): the elements `idxs` of the flattened `a`.

use std::sync::Arc;

use super::value::Value;
use crate::budget::Budget;
use crate::element::element_count;
use crate::fault::Fault;
use crate::{Array, ArrayData};

/// Whether instances of the class, a dotted name, may be made.
pub(super) fn is_known_class(class: &str) -> bool {
    class.starts_with("chumpy.") || sparse_layout(class).is_some() || is_inline_array(class)
}

/// Whether the class is one that TorchScript wrote with its code, which is not looked at.
pub(super) fn is_scripted(class: &str) -> bool {
    class.starts_with("__torch__.")
}

/// Whether the class stands for an array whose bytes come after it in the file.
pub(super) fn is_inline_array(class: &str) -> bool {
    class == "joblib.numpy_pickle.NumpyArrayWrapper"
}

/// The value that an instance with this state stands for.
pub(super) fn resolve(class: &str, state: Value, budget: &Budget) -> Result<Value, Fault> {
    if is_scripted(class) {
        return Ok(state);
    }
    let value = match sparse_layout(class) {
        Some(layout) => dense(layout, &state, budget),
        None => wrapped(class, &state, budget),
    };
    value.map_err(|fault| fault.within(class))
}

/// Which axis of a compressed sparse matrix `indptr` walks along.
#[derive(Clone, Copy)]
enum SparseLayout {
    Rows,
    Columns,
}

fn sparse_layout(class: &str) -> Option<SparseLayout> {
    // The module between package and class differs between versions: `csc`, `_csc`, or none.
    match class.strip_prefix("scipy.sparse.")?.rsplit('.').next()? {
        "csr_matrix" | "csr_array" => Some(SparseLayout::Rows),
        "csc_matrix" | "csc_array" => Some(SparseLayout::Columns),
        _ => None,
    }
}

/// The array of a chumpy object.
fn wrapped(class: &str, state: &Value, budget: &Budget) -> Result<Value, Fault> {
    if let Some(inner @ (Value::Array(_) | Value::Int(_) | Value::Float(_))) = state.get("x") {
        return Ok(inner.clone());
    }
    let (Some(Value::Array(source)), Some(Value::Array(selection))) = (state.get("a"), state.get("idxs")) else {
        return Err(Fault::refused(format_args!("evaluating the chumpy expression `{class}`")));
    };
    let (elements, chosen) = (source.elements(), selection.elements());
    budget.spend((elements + 2 * chosen).saturating_mul(size_of::<f64>()), "a selection")?;
    let values = source.to_f64().ok_or_else(|| Fault::malformed("a", source.description(), "numbers"))?;
    let selection = selection
        .to_indices(values.len())
        .ok_or_else(|| Fault::malformed("idxs", selection.description(), "indices of elements of a"))?;
    let selected: Vec<f64> = selection.iter().map(|&index| values[index as usize]).collect();
    let shape = state.get("preferred_shape").map_or(Some(vec![selected.len()]), extents);
    let shape = shape.filter(|shape| element_count(shape).is_ok_and(|count| count == selected.len()));
    let shape = shape.ok_or_else(|| {
        Fault::malformed("preferred_shape", "something else", format_args!("a shape of {} elements", selected.len()))
    })?;
    Ok(Value::Array(Arc::new(Array { shape, data: ArrayData::F64(selected) })))
}

/// The full matrix of a compressed one: row (or column) i holds `data[k]` at `indices[k]`, indptr[i] <= k < indptr[i+1].
fn dense(layout: SparseLayout, state: &Value, budget: &Budget) -> Result<Value, Fault> {
    let array = |key: &str| match state.get(key) {
        Some(Value::Array(array)) => Ok(array),
        other => Err(Fault::malformed(key, other.map_or("missing", Value::kind), "an array")),
    };
    let shape = state.get("_shape").or(state.get("shape")).and_then(extents);
    let Some(&[rows, columns]) = shape.as_deref() else {
        return Err(Fault::malformed("shape", "something else", "rows and columns"));
    };
    let size = element_count(&[rows, columns])?;
    let mut dense: Vec<f64> = budget.vector(size, "a dense matrix")?;
    dense.resize(size, 0.0);
    let (major, minor) = match layout {
        SparseLayout::Rows => (rows, columns),
        SparseLayout::Columns => (columns, rows),
    };
    let (data, indices, starts) = (array("data")?, array("indices")?, array("indptr")?);
    let stored = data.elements() + indices.elements() + starts.elements();
    budget.spend(stored.saturating_mul(size_of::<f64>()), "the entries of a matrix")?;
    let values = data.to_f64().ok_or_else(|| Fault::malformed("data", data.description(), "numbers"))?;
    let (indices, starts) = match (indices.to_indices(minor), starts.to_indices(values.len() + 1)) {
        (Some(indices), Some(starts))
            if starts.len() == major + 1 && starts.is_sorted() && indices.len() == values.len() =>
        {
            (indices, starts)
        }
        _ => return Err(Fault::malformed("indices, indptr", "inconsistent", "those of a compressed matrix")),
    };
    for (outer, range) in starts.windows(2).enumerate() {
        for entry in range[0] as usize..range[1] as usize {
            let inner = indices[entry] as usize;
            let position = match layout {
                SparseLayout::Rows => outer * columns + inner,
                SparseLayout::Columns => inner * columns + outer,
            };
            dense[position] += values[entry];
        }
    }
    Ok(Value::Array(Arc::new(Array { shape: vec![rows, columns], data: ArrayData::F64(dense) })))
}

/// A tuple or list of non-negative integers.
fn extents(value: &Value) -> Option<Vec<usize>> {
    let (Value::Tuple(items) | Value::List(items)) = value else { return None };
    let extent = |item: &Value| match item {
        &Value::Int(extent) => usize::try_from(extent).ok(),
        Value::Array(array) if array.shape.is_empty() => array.to_indices(usize::MAX)?.first().map(|&one| one as usize),
        _ => None,
    };
    items.iter().map(extent).collect()
}
