//! Settings of a run that simulation and hosts share: every parameter of tissue, needle and force with its validation,
//! the built-in scenes by name, and the sizes that a scene may have.
//!
//! ```
//! use stylet_settings::{ParameterId, ParameterSet};
//!
//! let mut set = ParameterSet::default();
//! set.set(ParameterId::PunctureDepth, 1.0);
//! let problems = set.problems();
//! assert_eq!(problems[0].parameters(), [ParameterId::PunctureDepth]);
//! println!("{}", problems[0]);
//! ```

#![warn(missing_docs)]

mod problem;
mod scene;
mod set;
mod table;

pub use problem::{ParameterProblem, ParameterProblems, folding};
pub use scene::{BUILTIN_SCENES, GridInfo, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_STRUCTURES};
pub use set::ParameterSet;
pub use table::{PARAMETER_COUNT, PARAMETERS, ParameterId};

/// Part of the dialog that a parameter stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterGroup {
    /// Limits of the tissue.
    Tissue,
    /// Coefficients of eq. 6.
    Needle,
    /// Coefficients of eq. 8 to 10, and the gate.
    Force,
    /// What the needle goes through besides the gland.
    Layers,
    /// What seeds do after they were dropped.
    Seeds,
}

impl ParameterGroup {
    /// In the order of the dialog.
    pub const ALL: [Self; 5] = [Self::Tissue, Self::Needle, Self::Force, Self::Layers, Self::Seeds];

    /// Heading of the group.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "Tissue",
            Self::Needle => "Needle",
            Self::Force => "Force",
            Self::Layers => "Layers",
            Self::Seeds => "Seeds",
        }
    }
}

/// One row of the table. `min`, `max`, `default` are SI; a person reads `value * display_per_si` in `unit`.
#[derive(Clone, Copy, Debug)]
pub struct ParameterSpec {
    /// Number of the parameter.
    pub id: ParameterId,
    /// Name in files, `group.name`.
    pub key: &'static str,
    /// Name in the dialog.
    pub label: &'static str,
    /// Where it stands in the dialog.
    pub group: ParameterGroup,
    /// Unit that a person reads; empty for a pure number.
    pub unit: &'static str,
    /// Factor from SI to `unit`.
    pub display_per_si: f64,
    /// Least value, SI.
    pub min: f64,
    /// Largest value, SI.
    pub max: f64,
    /// Value at the start, SI.
    pub default: f64,
    /// Where the default comes from: paper, publication, or our own reasons (`docs/physics.md`).
    pub source: &'static str,
    /// What the parameter does.
    pub help: &'static str,
}

impl ParameterId {
    /// Returns the parameter of a number, or `None` for a number that no parameter has.
    pub fn from_number(number: u32) -> Option<Self> {
        PARAMETERS.get(number as usize).map(|spec| spec.id)
    }

    /// Returns its row of the table.
    pub fn spec(self) -> &'static ParameterSpec {
        &PARAMETERS[self as usize]
    }
}

impl ParameterSpec {
    /// Whether `value` (SI) is a number within the limits.
    pub fn allows(&self, value: f64) -> bool {
        // Not a number is in no range.
        (self.min..=self.max).contains(&value)
    }

    /// `None` when `value` (SI) is allowed.
    pub fn problem(&self, value: f64) -> Option<ParameterProblem> {
        (!self.allows(value)).then_some(ParameterProblem::OutOfLimits { id: self.id, value })
    }
}

#[cfg(test)]
mod tests;
