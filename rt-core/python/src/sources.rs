//! Sources of TG-43U1, and the dose of their seeds at points and on grids.

use crate::arrays::{self, M_PER_MM, Numbers, Rows};
use crate::work::refused;
use numpy::{PyArray1, PyArray3};
use pyo3::prelude::*;
use stylet_dose::decay::{Interval, s_to_days};
use stylet_dose::tg43::Formalism;
use stylet_dose::{DoseGrid, DoseKernel, DosePoints, Seed};

/// 1 Gy/s in cGy/h.
const CGY_PER_H: f64 = 100.0 * 3600.0;

type Column<'py> = Bound<'py, PyArray1<f64>>;

/// Returns the models of the sources that come with the package, for `Source(model)`.
#[pyfunction]
pub fn sources() -> Vec<String> {
    stylet_dose::Source::all_known().map(|source| source.model).collect()
}

/// Model of a seed with its tables of TG-43U1 (Rivard et al., Med. Phys. 31, 633, 2004).
///
/// `Source("6711")`; :func:`sources` lists the models, :meth:`parse` takes a source file (``host-ui sources``). The
/// dose is that of water everywhere, without shielding of one seed by another.
#[pyclass(frozen, module = "stylet")]
pub struct Source {
    source: stylet_dose::Source,
    whole_life: DoseKernel,
}

impl Source {
    fn of(source: stylet_dose::Source) -> Self {
        Self {
            whole_life: DoseKernel::new(&source, Interval::ALL),
            source,
        }
    }

    /// Lets `work` have the kernel over so many days, without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        days: Option<(f64, f64)>,
        work: impl FnOnce(&DoseKernel) -> T + Send,
    ) -> PyResult<T> {
        let Some((from, to)) = days else {
            return Ok(py.detach(|| work(&self.whole_life)));
        };
        if !(from >= 0.0 && to > from) {
            return Err(refused(format!(
                "days is ({from}, {to}); it must rise, from 0 or later"
            )));
        }
        Ok(py.detach(|| work(&DoseKernel::new(&self.source, Interval::days(from, to)))))
    }
}

#[pymethods]
impl Source {
    #[new]
    fn new(model: &str) -> PyResult<Self> {
        stylet_dose::Source::named(model).map(Self::of).map_err(refused)
    }

    /// Reads the text of a source file (TOML); the error lists every problem in it.
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        stylet_dose::Source::parse(text).map(Self::of).map_err(refused)
    }

    /// Name of the model.
    #[getter]
    fn model(&self) -> &str {
        &self.source.model
    }

    /// Isotope, such as "I-125".
    #[getter]
    fn nuclide(&self) -> &str {
        &self.source.nuclide
    }

    /// Half-life, days.
    #[getter]
    fn half_life_days(&self) -> f64 {
        s_to_days(self.source.half_life_s)
    }

    /// Dose rate constant, cGy/(h U).
    #[getter]
    fn dose_rate_constant(&self) -> f64 {
        self.source.tables.dose_rate_constant_gy_per_s * CGY_PER_H
    }

    /// Usual prescription, Gy.
    #[getter]
    fn prescription_gy(&self) -> Option<f64> {
        self.source.prescription_gy
    }

    /// Publication of its tables.
    #[getter]
    fn publication(&self) -> Option<&str> {
        self.source.reference.as_ref().map(|r| r.publication.as_str())
    }

    /// Returns the dose rate of 1 U at each point, cGy/h, shape (N,), by the formulae.
    ///
    /// :param across_mm, along_mm: from the axis and from the middle of the source, shape (N,).
    /// :param line: about the source's axis (2D, F); False averages over its directions (1D, φ_an).
    #[pyo3(signature = (across_mm, along_mm, *, line=true))]
    fn dose_rate<'py>(
        &self,
        py: Python<'py>,
        across_mm: Numbers<'py>,
        along_mm: Numbers<'py>,
        line: bool,
    ) -> PyResult<Column<'py>> {
        let count = across_mm.as_array().len();
        let across = arrays::numbers("across_mm", &across_mm, count)?;
        let along = arrays::numbers("along_mm", &along_mm, count)?;
        let formalism = if line { Formalism::TwoD } else { Formalism::OneD };
        let rate = |(across, along): (&f64, &f64)| {
            let [across_m, along_m] = [across, along].map(|mm| mm * M_PER_MM);
            self.source.tables.rate_gy_per_s(formalism, across_m, along_m) * CGY_PER_H
        };
        Ok(arrays::column(py, across.iter().zip(&along).map(rate).collect()))
    }

    /// Returns the dose of seeds at points, Gy, shape (N,).
    ///
    /// :param points_mm: shape (N, 3).
    /// :param seeds_mm: middles of the seeds, shape (M, 3).
    /// :param strength_u: air kerma strength, U (1 U = 1 µGy m²/h), one for all or shape (M,).
    /// :param axes: direction of each seed, shape (M, 3); without it all directions are averaged (1D).
    /// :param days: ``(from, to)`` after the implant; the whole life of the seeds without it.
    /// :raises ValueError: shapes that do not fit.
    #[pyo3(signature = (points_mm, seeds_mm, strength_u, axes=None, *, days=None))]
    fn dose<'py>(
        &self,
        py: Python<'py>,
        points_mm: Rows<'py>,
        seeds_mm: Rows<'py>,
        strength_u: Numbers<'py>,
        axes: Option<Rows<'py>>,
        days: Option<(f64, f64)>,
    ) -> PyResult<Column<'py>> {
        let points_m = arrays::rows("points_mm", &points_mm, M_PER_MM)?;
        let seeds = seeds(&seeds_mm, &strength_u, axes.as_ref())?;
        let work = |kernel: &DoseKernel| DosePoints::new(&points_m).of_seeds_gy(kernel, &seeds);
        Ok(arrays::column(py, self.with(py, days, work)?))
    }

    /// Returns the dose of seeds on a grid, Gy, of shape `shape`, indexed [x, y, z].
    ///
    /// :param origin_mm: centre of voxel [0, 0, 0].
    /// :param spacing_mm: edges of a voxel.
    ///
    /// The others are as of :meth:`dose`.
    #[pyo3(signature = (origin_mm, spacing_mm, shape, seeds_mm, strength_u, axes=None, *, days=None))]
    #[allow(clippy::too_many_arguments)]
    fn dose_grid<'py>(
        &self,
        py: Python<'py>,
        origin_mm: [f64; 3],
        spacing_mm: [f64; 3],
        shape: [usize; 3],
        seeds_mm: Rows<'py>,
        strength_u: Numbers<'py>,
        axes: Option<Rows<'py>>,
        days: Option<(f64, f64)>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let seeds = seeds(&seeds_mm, &strength_u, axes.as_ref())?;
        let [origin_m, spacing_m] = [origin_mm, spacing_mm].map(|mm| mm.map(|mm| mm * M_PER_MM));
        let mut grid = DoseGrid::new(origin_m, spacing_m, shape).map_err(refused)?;
        let dose_gy = self.with(py, days, |kernel| {
            grid.add(kernel, &seeds);
            grid.dose_gy().to_vec()
        })?;
        arrays::volume(py, dose_gy, shape)
    }

    fn __repr__(&self) -> String {
        format!("<Source {}, {}>", self.source.model, self.source.nuclide)
    }
}

fn seeds(places: &Rows<'_>, strength_u: &Numbers<'_>, axes: Option<&Rows<'_>>) -> PyResult<Vec<Seed>> {
    let places_m = arrays::rows("seeds_mm", places, M_PER_MM)?;
    let strengths = arrays::numbers("strength_u", strength_u, places_m.len())?;
    let axes = axes.map(|axes| arrays::rows("axes", axes, 1.0)).transpose()?;
    if let Some(axes) = &axes
        && axes.len() != places_m.len()
    {
        let (given, seeds) = (axes.len(), places_m.len());
        return Err(refused(format!("{given} axes for {seeds} seeds")));
    }
    let seed = |(n, (&position_m, &strength_u)): (usize, (&[f64; 3], &f64))| {
        let axis = axes
            .as_ref()
            .map(|axes| arrays::direction("axes", axes[n]))
            .transpose()?;
        Ok(Seed {
            position_m,
            axis: axis.map(|axis| axis.into_inner().into()),
            strength_u,
        })
    };
    places_m.iter().zip(&strengths).enumerate().map(seed).collect()
}
