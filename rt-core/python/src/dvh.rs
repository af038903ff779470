//! Dose-volume histograms and the metrics of a plan.

use crate::arrays::{self, Numbers};
use crate::work::refused;
use numpy::PyArray1;
use pyo3::prelude::*;
use stylet_dose::Metric;

const M3_PER_CC: f64 = 1e-6;

/// Cumulative dose-volume histogram of a structure, of points that each stand for a volume; exact, without bins.
///
/// :param dose_gy: shape (N,).
/// :param volumes_cc: one for all or shape (N,), as :meth:`Scene.points` gives them.
/// :raises ValueError: no point, or no volume.
///
/// >>> dvh = stylet.Dvh(dose_gy, volumes_cc)
/// >>> dvh.metric("D90", 145.0), dvh.metric("V150", 145.0)      # Gy, %
#[pyclass(frozen, module = "stylet")]
pub struct Dvh(stylet_dose::Dvh);

#[pymethods]
impl Dvh {
    #[new]
    fn new(py: Python<'_>, dose_gy: Numbers<'_>, volumes_cc: Numbers<'_>) -> PyResult<Self> {
        let count = dose_gy.as_array().len();
        let dose_gy = arrays::numbers("dose_gy", &dose_gy, count)?;
        let volumes_m3 = arrays::numbers("volumes_cc", &volumes_cc, count)?
            .into_iter()
            .map(|cc| cc * M3_PER_CC);
        let volumes_m3: Vec<f64> = volumes_m3.collect();
        let dvh = py.detach(|| stylet_dose::Dvh::new(&dose_gy, &volumes_m3));
        dvh.map(Self).ok_or_else(|| refused("the points have no volume"))
    }

    /// Volume of the structure, cc.
    #[getter]
    fn volume_cc(&self) -> f64 {
        self.0.volume_m3() / M3_PER_CC
    }

    /// Mean dose, Gy.
    #[getter]
    fn mean_gy(&self) -> f64 {
        self.0.mean_gy()
    }

    /// Returns a metric: Gy for "D90", "D2cc", "Dmean", "Dmax", "Dmin"; % of the volume for "V150" (of the
    /// prescription) and "V200Gy".
    ///
    /// :raises ValueError: a name that is none; a structure smaller than the volume.
    fn metric(&self, name: &str, prescription_gy: f64) -> PyResult<f64> {
        let value = Metric::parse(name).map_err(refused)?.of(&self.0, prescription_gy);
        let cc = self.volume_cc();
        value
            .main()
            .ok_or_else(|| refused(format!("{name}: the structure has {cc:.3} cc")))
    }

    /// Returns the volume with at least each dose, cc; both of shape (K,).
    fn at_least_cc<'py>(&self, py: Python<'py>, dose_gy: Numbers<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let doses = arrays::numbers("dose_gy", &dose_gy, dose_gy.as_array().len())?;
        let cc = |gy: &f64| self.0.at_least_m3(*gy) / M3_PER_CC;
        Ok(arrays::column(py, doses.iter().map(cc).collect()))
    }
}
