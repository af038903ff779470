//! The tables of a source file, and their checks; all wrong values are reported together.

use crate::error::DoseError;
use serde::{Deserialize, Serialize};

const MAX_ENTRIES: usize = 1000;
/// Rounding allowed for g(1 cm) and F(90 deg), 1 by definition.
const ROUNDING: f64 = 0.005;

/// Tables of a source file.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SourceFile {
    pub source: Model,
    pub reference: Option<Reference>,
    pub radial: Radial,
    pub anisotropy_1d: Option<Anisotropy1d>,
    pub anisotropy_2d: Option<Anisotropy2d>,
}

/// Description of a seed model.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Name of the model.
    pub model: String,
    /// Isotope, as in I-125.
    pub nuclide: String,
    /// Half-life, in days.
    pub half_life_days: f64,
    /// Dose rate constant in cGy/h for 1 U.
    pub dose_rate_constant: f64,
    /// Active length in cm; 0 for a point source.
    #[serde(default)]
    pub active_length_cm: f64,
    /// Outer length of the capsule, in cm.
    pub physical_length_cm: Option<f64>,
    /// Outer diameter of the capsule, in cm.
    pub physical_diameter_cm: Option<f64>,
    /// Reference distance of TG-43, 1 cm.
    pub r0_cm: Option<f64>,
    /// Reference angle of TG-43, 90 degrees.
    pub theta0_deg: Option<f64>,
    /// Air kerma strength for an apparent activity of 1 mCi.
    pub strength_per_activity_u_per_mci: Option<f64>,
    /// Usual prescription.
    pub prescription_gy: Option<f64>,
}

/// Where the numbers of a source are from.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Publication of the tables.
    pub publication: String,
    /// Digital object identifier of the publication.
    pub doi: Option<String>,
    /// Publication of the half-life.
    pub half_life: Option<String>,
    /// Copies and figures that the numbers were compared with.
    pub checked: Option<String>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Radial {
    pub r_cm: Vec<f64>,
    pub g_line: Option<Vec<f64>>,
    pub g_point: Option<Vec<f64>>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Anisotropy1d {
    pub r_cm: Vec<f64>,
    pub phi_an: Vec<f64>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Anisotropy2d {
    pub r_cm: Vec<f64>,
    pub theta_deg: Vec<f64>,
    #[serde(rename = "F")]
    pub f: Vec<Vec<f64>>,
}

/// Wrong values of a file.
#[derive(Default)]
pub struct Problems(Vec<String>);

impl Problems {
    /// Fails with one message that lists all problems, if there are any.
    pub fn finish(self) -> Result<(), DoseError> {
        match self.0.as_slice() {
            [] => Ok(()),
            [one] => Err(DoseError::Source(one.clone())),
            many => Err(DoseError::Source(format!(
                "{} problems\n  {}",
                many.len(),
                many.join("\n  ")
            ))),
        }
    }

    pub fn add(&mut self, what: String) {
        self.0.push(what);
    }

    pub fn within(&mut self, name: &str, value: impl Into<Option<f64>>, least: f64, most: f64) {
        if let Some(v) = value.into()
            && !(least..=most).contains(&v)
        {
            self.add(format!("{name} = {v}; allowed are {least} to {most}"));
        }
    }

    /// Checks a list in which each entry exceeds the one before it.
    pub fn rising(&mut self, name: &str, list: &[f64], least: f64, most: f64) {
        self.list(name, list, least, most);
        if let Some(w) = list.windows(2).find(|w| w[0] >= w[1]) {
            self.add(format!("{name} must rise; {} is followed by {}", w[0], w[1]));
        }
    }

    /// Checks a list with one entry for each of `entries` in the list `of`.
    pub fn column(&mut self, name: &str, list: &[f64], (of, entries): (&str, usize), least: f64, most: f64) {
        self.list(name, list, least, most);
        if list.len() != entries {
            self.add(format!("{name} has {} entries and {of} {entries}", list.len()));
        }
    }

    fn list(&mut self, name: &str, list: &[f64], least: f64, most: f64) {
        if !(1..=MAX_ENTRIES).contains(&list.len()) {
            self.add(format!(
                "{name} has {} entries; allowed are 1 to {MAX_ENTRIES}",
                list.len()
            ));
        }
        for (value, number) in list.iter().zip(1..=MAX_ENTRIES) {
            self.within(&format!("{name}, entry {number}"), *value, least, most);
        }
    }

    pub fn must_be_one(&mut self, what: &str, place: &str, value: f64) {
        if (value - 1.0).abs() > ROUNDING {
            self.add(format!("{what} is {value:.4} at {place}, where it is 1 by definition"));
        }
    }
}
