//! The rows of the table.

use std::collections::BTreeMap;

use xavatar::doctor::Seconds;

/// Row names and numbers, printed as they come.
#[derive(Debug, Default)]
pub struct Report(BTreeMap<String, f64>);

impl Report {
    /// Starts a group of rows.
    pub fn section(&mut self, title: &str) {
        println!("\n{title}");
    }

    /// A number that is no time.
    pub fn number(&mut self, name: &str, value: f64, note: &str) {
        println!("  {name:<38}{value:>12.3}  {note}");
        self.0.insert(name.into(), value);
    }

    /// The median time of a case.
    pub fn seconds(&mut self, name: &str, seconds: &Seconds) {
        self.number(name, seconds.median(), &format!("s, shortest {:.3}", seconds.shortest()));
    }

    /// `amount` per second at the median time; `unit` is what the amount counts.
    pub fn rate(&mut self, name: &str, amount: f64, seconds: &Seconds, unit: &str) {
        let note = format!("{unit}/s, best {:.3}", amount / seconds.shortest());
        self.number(name, amount / seconds.median(), &note);
    }

    /// Writes all rows as JSON.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &str) -> std::io::Result<()> {
        std::fs::write(path, serde_json::to_string_pretty(&self.0)?)
    }
}
