//! The simulator as a Python module: what `stylet` (the folder beside this one) gives to its users.
//!
//! Lengths in mm, forces in N, times in s, doses in Gy, strengths in U. An array that holds a volume is indexed [x, y,
//! z], x fastest in memory, as the simulator has it.

mod arrays;
mod dose;
mod dvh;
mod files;
mod insertion;
mod needle;
mod parameters;
mod recordings;
mod scene;
mod sources;
mod stage;
mod study;
mod work;

use pyo3::pymodule;

#[pymodule]
mod _stylet {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::dose::gamma;
    #[pymodule_export]
    use super::dvh::Dvh;
    #[pymodule_export]
    use super::files::{read_dose, read_labels, read_plan};
    #[pymodule_export]
    use super::insertion::{Insertion, State};
    #[pymodule_export]
    use super::parameters::{Parameter, parameters, tissues};
    #[pymodule_export]
    use super::recordings::{read_flight, read_recording};
    #[pymodule_export]
    use super::scene::{Scene, Structure, scenes};
    #[pymodule_export]
    use super::sources::{Source, sources};
    #[pymodule_export]
    use super::stage::{Rehearsed, Stage};
    #[pymodule_export]
    use super::study::study;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
