//! A manifest as a table: a row a subject, a column a key. Columns that are no key of a subject are settings of its training.

use std::path::Path;

use toml::{Table, Value};

use super::manifest::malformed;
use crate::Result;

/// The keys of a subject that are text.
const TEXTS: [&str; 6] = ["name", "data", "body", "landmarks", "preset", "split"];
/// The keys of a subject that are numbers.
const NUMBERS: [&str; 2] = ["resolution", "texture"];
/// The keys of a subject that are lists: words apart by spaces.
const LISTS: [&str; 2] = ["stages", "accept"];

/// The subjects of a CSV (RFC 4180) with a head, as tables with the keys of TOML; empty cells say nothing.
pub(super) fn tables_of_csv(path: &Path, text: &str) -> Result<Vec<Table>> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let broken = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        malformed(path, &format!("line {line}"), &error.to_string(), "a cell for every column of the head")
    };
    let head = reader.headers().map_err(broken)?.clone();
    let mut tables = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let (mut table, mut settings) = (Table::new(), Table::new());
        for (key, cell) in head.iter().zip(&record).filter(|(_, cell)| !cell.is_empty()) {
            let word = |word: &str| Value::String(word.into());
            let value = match key {
                key if TEXTS.contains(&key) => word(cell),
                key if LISTS.contains(&key) => cell.split_whitespace().map(word).collect::<Vec<_>>().into(),
                key if NUMBERS.contains(&key) => cell.parse::<i64>().map_or_else(|_| word(cell), Value::Integer),
                _ => {
                    settings.insert(key.into(), setting(cell));
                    continue;
                }
            };
            table.insert(key.into(), value);
        }
        if !settings.is_empty() {
            table.insert("set".into(), settings.into());
        }
        tables.push(table);
    }
    Ok(tables)
}

/// A setting as TOML would have it: a number or a truth where the cell is one.
fn setting(cell: &str) -> Value {
    let integer = || cell.parse().ok().map(Value::Integer);
    let float = || cell.parse().ok().map(Value::Float);
    let boolean = || cell.parse().ok().map(Value::Boolean);
    integer().or_else(float).or_else(boolean).unwrap_or_else(|| Value::String(cell.into()))
}
