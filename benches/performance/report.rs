//! The rows of the table, and the timing they rest on.

use std::collections::BTreeMap;
use std::time::Instant;

/// Seconds of several runs.
#[derive(Clone, Debug)]
pub struct Seconds(Vec<f64>);

impl Seconds {
    /// Runs `work` once unmeasured, then `repeats` times.
    pub fn of(repeats: usize, mut work: impl FnMut()) -> Self {
        work();
        let measured = (0..repeats).map(|_| {
            let begin = Instant::now();
            work();
            begin.elapsed().as_secs_f64()
        });
        Self::from(measured.collect::<Vec<_>>())
    }

    /// The middle one.
    pub fn median(&self) -> f64 {
        self.0[self.0.len() / 2]
    }

    /// The shortest.
    pub fn shortest(&self) -> f64 {
        self.0[0]
    }
}

impl From<Vec<f64>> for Seconds {
    fn from(mut seconds: Vec<f64>) -> Self {
        assert!(!seconds.is_empty(), "no run was measured");
        seconds.sort_by(f64::total_cmp);
        Self(seconds)
    }
}

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
