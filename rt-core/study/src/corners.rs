//! Parameters that are valid one by one may not be together: the device holds only so stiff a membrane.

use crate::problem::StudyProblem;
use crate::quantity::has_no_part;
use crate::spread::Spread;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{ParameterSet, ParameterSpec};
use stylet_sim::active::activate;
use stylet_sim::scene::TissueKind;

/// Largest number of parameters whose corners are tried.
const MOST: usize = 12;

/// Returns the problem of one of the corners of what varies, if there is one.
pub fn problem(parameters: &[(&'static ParameterSpec, Spread)], tissue: TissueKind) -> Option<StudyProblem> {
    let varied: Vec<_> = parameters
        .iter()
        .filter(|(spec, _)| !has_no_part(spec, tissue))
        .collect();
    if varied.len() > MOST {
        return Some(StudyProblem::TooManyParameters {
            given: varied.len(),
            most: MOST,
        });
    }
    (0..1_usize << varied.len()).find_map(|corner| {
        let mut set = ParameterSet::default();
        let mut names = Vec::new();
        for (n, (spec, spread)) in varied.iter().enumerate() {
            let value = spread.bounds()[corner >> n & 1];
            set.set(spec.id, (value / spec.display_per_si).clamp(spec.min, spec.max));
            names.push(format!("{} = {value}", spec.key));
        }
        let why = activate(&set, &DeviceInfo::phantom_premium_1_5()).err()?;
        let values = names.join(", ");
        Some(StudyProblem::Together { values, why })
    })
}
