//! Validates a set of parameters: one function for the core and for the window.

use super::{PARAMETERS, ParameterId, ParameterSet, ProblemList};
use ParameterId as P;

/// A problem with a set of parameters; each names the parameters involved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterProblem {
    /// A value outside the limits of its row, or not a number.
    #[error("{}", out_of_limits(*id, *value))]
    OutOfLimits {
        /// The parameter.
        id: ParameterId,
        /// The value, SI.
        value: f64,
    },
    /// A corner of three links with these shear angles could fold (eq. 1 in three dimensions).
    #[error(
        "{}: tx ty + ty tz + tz tx + 2 tx ty tz is {folding:.6}, must be at most 1 (eq. 1 in three dimensions): lower an \
         angle, or cells fold over",
        keys(&SHEARS)
    )]
    CellsFold {
        /// See [`folding`].
        folding: f64,
    },
    /// A spring stiffer than the device can hold.
    #[error(
        "{}: a stiffness of {stiffness_n_per_m:.1} N/m; the device holds at most {limit_n_per_m:.1} N/m at this force scale",
        keys(parameters)
    )]
    TooStiff {
        /// Parameters that determine the stiffness.
        parameters: &'static [ParameterId],
        /// Before the force scale, N/m.
        stiffness_n_per_m: f64,
        /// Largest stiffness before the force scale, N/m.
        limit_n_per_m: f64,
    },
    /// A model refuses values that the table allows. Tests check that this does not happen.
    #[error("{0}")]
    Unusable(String),
}

/// All problems of one set; at least one.
pub type ParameterProblems = ProblemList<ParameterProblem>;

const SHEARS: [P; 2] = [P::ShearHorizontal, P::ShearVertical];
const GLAND: &[P] = &[P::MembranePeak, P::PunctureDepth, P::MembraneGain, P::ForceScale];
const SKIN: &[P] = &[P::SkinPeak, P::SkinPunctureDepth, P::MembraneGain, P::ForceScale];
const WALL: &[P] = &[P::WallPeak, P::WallPunctureDepth, P::MembraneGain, P::ForceScale];
const GUIDE: &[P] = &[P::GuideStiffness, P::GuideGain, P::ForceScale];
const COUPLED: &[P] = &[P::TissueStiffness, P::Coupling, P::ForceScale];

impl ParameterProblem {
    /// Returns the parameters involved.
    pub fn parameters(&self) -> &[ParameterId] {
        match self {
            Self::OutOfLimits { id, .. } => std::slice::from_ref(id),
            Self::CellsFold { .. } => &SHEARS,
            Self::TooStiff { parameters, .. } => parameters,
            Self::Unusable(_) => &[],
        }
    }
}

impl ParameterSet {
    /// Returns every value outside its limits or, if there is none, every combination forbidden on any device.
    pub fn problems(&self) -> Vec<ParameterProblem> {
        let out: Vec<_> = PARAMETERS
            .iter()
            .zip(self.values)
            .filter_map(|(p, v)| p.problem(v))
            .collect();
        if !out.is_empty() {
            return out;
        }
        let [horizontal, vertical] = SHEARS.map(|id| self.get(id).to_degrees());
        let folding = folding([horizontal, vertical, vertical]);
        // NaN is a problem as well.
        let folds = folding.is_nan() || folding > 1.0;
        folds
            .then_some(ParameterProblem::CellsFold { folding })
            .into_iter()
            .collect()
    }

    /// As [`problems`](Self::problems), and every spring stiffer than `max_stiffness_n_per_m`, the most that the device
    /// can hold. The spring of stuck friction is excluded: its force is bounded, so its limit is found by trial
    /// (`docs/stability.md`), and the passivity controller softens it.
    pub fn problems_on(&self, max_stiffness_n_per_m: f64) -> Vec<ParameterProblem> {
        let mut problems = self.problems();
        if problems
            .iter()
            .any(|p| matches!(p, ParameterProblem::OutOfLimits { .. }))
        {
            return problems;
        }
        let scale = self.get(P::ForceScale);
        let membrane = |peak, depth| self.get(peak) / self.get(depth) * self.get(P::MembraneGain);
        let springs = [
            (GLAND, membrane(P::MembranePeak, P::PunctureDepth)),
            (SKIN, membrane(P::SkinPeak, P::SkinPunctureDepth)),
            (WALL, membrane(P::WallPeak, P::WallPunctureDepth)),
            (GUIDE, self.get(P::GuideStiffness) * self.get(P::GuideGain)),
            (COUPLED, self.get(P::TissueStiffness) * self.get(P::Coupling)),
        ];
        for (parameters, stiffness_n_per_m) in springs {
            // NaN fails as well.
            let felt_n_per_m = stiffness_n_per_m * scale;
            if felt_n_per_m.is_nan() || felt_n_per_m > max_stiffness_n_per_m {
                problems.push(ParameterProblem::TooStiff {
                    parameters,
                    stiffness_n_per_m,
                    limit_n_per_m: max_stiffness_n_per_m / scale,
                });
            }
        }
        problems
    }
}

/// Returns how close a corner of three links with these shear angles can come to folding: at 1 its volume can be zero,
/// above it negative (`docs/physics.md`, Tissue: constraints).
pub fn folding(shear_deg: [f64; 3]) -> f64 {
    let [x, y, z] = shear_deg.map(|angle| angle.to_radians().tan());
    x * y + y * z + z * x + 2.0 * x * y * z
}

fn out_of_limits(id: ParameterId, value: f64) -> String {
    let spec = id.spec();
    let (key, unit) = (spec.key, spec.unit);
    let [low, high, value] = [spec.min, spec.max, value].map(|v| v * spec.display_per_si);
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    if value.is_finite() {
        format!("{key} = {value:.6}{unit}; it must be {low:.6} to {high:.6}{unit}")
    } else {
        format!("{key} is not a number; it must be {low:.6} to {high:.6}{unit}")
    }
}

fn keys(parameters: &[ParameterId]) -> String {
    let keys: Vec<_> = parameters.iter().map(|id| id.spec().key).collect();
    keys.join(", ")
}
