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

mod phase;
mod problem;
mod problem_list;
mod scene;
mod seed;
mod set;
mod table;

pub use phase::Phase;
pub use problem::{ParameterProblem, ParameterProblems, folding};
pub use problem_list::ProblemList;
pub use scene::{BUILTIN_SCENES, GridInfo, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_STRUCTURES};
pub use seed::{SEED_LENGTH_M, SEED_RADIUS_M, TOUCHING_M};
pub use set::ParameterSet;
pub use table::{PARAMETER_COUNT, PARAMETERS, ParameterId};

/// Section of the dialog that holds a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterGroup {
    /// Limits of the tissue.
    Tissue,
    /// Coefficients of eq. 6.
    Needle,
    /// Coefficients of eq. 8 to 10, and the gate.
    Force,
    /// Tissue other than the gland on the needle's path.
    Layers,
    /// Migration of dropped seeds.
    Seeds,
}

impl ParameterGroup {
    /// All groups in the order of the dialog.
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

/// One row of the table. `min`, `max`, `default` are SI; users see `value * display_per_si` in `unit`.
#[derive(Clone, Copy, Debug)]
pub struct ParameterSpec {
    /// Number of the parameter.
    pub id: ParameterId,
    /// Name in files, `group.name`.
    pub key: &'static str,
    /// Name in the dialog.
    pub label: &'static str,
    /// Group in the dialog.
    pub group: ParameterGroup,
    /// Unit shown to users; empty for a pure number.
    pub unit: &'static str,
    /// Factor from SI to `unit`.
    pub display_per_si: f64,
    /// Smallest value, SI.
    pub min: f64,
    /// Largest value, SI.
    pub max: f64,
    /// Default value, SI.
    pub default: f64,
    /// Source of the default: paper, publication, or our own reasons (`docs/physics.md`).
    pub source: &'static str,
    /// Effect of the parameter.
    pub help: &'static str,
}

impl ParameterId {
    /// Returns the parameter of a number, or `None` for an unknown number.
    pub fn from_number(number: u32) -> Option<Self> {
        PARAMETERS.get(number as usize).map(|spec| spec.id)
    }

    /// Returns its row of the table.
    pub fn spec(self) -> &'static ParameterSpec {
        &PARAMETERS[self as usize]
    }
}

impl ParameterSpec {
    /// Returns whether the parameter acts on a needle that slips by force along its line.
    pub fn acts_on_a_line(&self) -> bool {
        use ParameterId as P;
        let of_the_paper = [
            P::SpeedCoefficient,
            P::DepthCoefficient,
            P::StaticSpeed,
            P::RetractionRatio,
            P::StickStiffness,
        ];
        let cutting = [P::CuttingForce, P::SkinCutting, P::SurroundingsCutting, P::WallCutting];
        !of_the_paper.contains(&self.id) && !cutting.contains(&self.id)
    }

    /// True if `value` (SI) is a number within the limits.
    pub fn allows(&self, value: f64) -> bool {
        // NaN is in no range.
        (self.min..=self.max).contains(&value)
    }

    /// Returns the problem with `value` (SI); `None` if it is allowed.
    pub fn problem(&self, value: f64) -> Option<ParameterProblem> {
        (!self.allows(value)).then_some(ParameterProblem::OutOfLimits { id: self.id, value })
    }
}

#[cfg(test)]
mod tests;
