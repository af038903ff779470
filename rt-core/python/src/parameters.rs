//! The table of parameters, and values by key in the units of the programs.

use crate::work::refused;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{PARAMETERS, ParameterSet};
use stylet_sim::active::{Active, activate};
use stylet_sim::scene::TissueKind;

/// Values by key, or none.
pub type Given<'a, 'py> = Option<&'a Bound<'py, PyDict>>;

/// One parameter of tissue, needle, force, layers or seeds, as `rt-core`, the window and study files know it.
#[pyclass(frozen, get_all, module = "stylet")]
pub struct Parameter {
    /// Name in files and in `parameters={...}`, such as "force.shaft_friction".
    key: &'static str,
    /// Name in the window.
    label: &'static str,
    /// Unit of `default`, `least` and `most`; empty for a pure number.
    unit: &'static str,
    /// Value of a run that sets none.
    default: f64,
    /// Least value.
    least: f64,
    /// Largest value.
    most: f64,
    /// Source of the default: the paper, a publication, or "ours".
    source: &'static str,
    /// Effect.
    help: &'static str,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let Self {
            key,
            default,
            unit,
            least,
            most,
            ..
        } = self;
        format!("<Parameter {key} = {default} {unit}, from {least} to {most}>")
    }
}

/// Returns every parameter, in the order of the programs' table: a list of :class:`Parameter`.
#[pyfunction]
pub fn parameters() -> Vec<Parameter> {
    let of = |spec: &stylet_shm_schema::ParameterSpec| {
        let [default, least, most] = [spec.default, spec.min, spec.max].map(|si| si * spec.display_per_si);
        Parameter {
            key: spec.key,
            label: spec.label,
            unit: spec.unit,
            default,
            least,
            most,
            source: spec.source,
            help: spec.help,
        }
    };
    PARAMETERS.iter().map(of).collect()
}

/// Returns the tissue models, `{name: purpose}`; "chainmail" is the default.
#[pyfunction]
pub fn tissues() -> BTreeMap<&'static str, &'static str> {
    TissueKind::ALL.iter().map(|kind| (kind.name(), kind.help())).collect()
}

/// Returns the tissue model of a name.
pub fn tissue(name: &str) -> PyResult<TissueKind> {
    TissueKind::of_name(name).ok_or_else(|| {
        let known = TissueKind::ALL.map(TissueKind::name).join(", ");
        refused(format!("tissue {name:?} is not known; known are {known}"))
    })
}

/// Returns the defaults with the given values, in the units of the table.
pub fn set(given: Given) -> PyResult<ParameterSet> {
    let mut set = ParameterSet::default();
    for (key, value) in given.into_iter().flatten() {
        let (key, value): (String, f64) = (key.extract()?, value.extract()?);
        let spec = PARAMETERS.iter().find(|spec| spec.key == key);
        let spec = spec.ok_or_else(|| refused(format!("no parameter {key:?}; stylet.parameters() lists them")))?;
        let si = value / spec.display_per_si;
        // The factor to a person's unit and back may leave the limits by a bit.
        let inside = si.clamp(spec.min, spec.max);
        let is_rounding = (si - inside).abs() <= 1e-12 * si.abs();
        set.set(spec.id, if is_rounding { inside } else { si });
    }
    Ok(set)
}

/// Returns what a run of these values uses, or every problem with them.
pub fn active(set: &ParameterSet, device: &DeviceInfo) -> PyResult<Active> {
    activate(set, device).map_err(refused)
}
