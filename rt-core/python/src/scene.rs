//! Scenes: built in, of an array of labels, or of a file, by the programs' own readers.

use crate::arrays::{self, M_PER_MM, MM_PER_M, Rows};
use crate::work::refused;
use nalgebra::{Matrix3, Vector3};
use numpy::{PyArray2, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;
use stylet_anatomy::{Material, PatientFrame, Role};
use stylet_dose::{Region, Structure as Scored};
use stylet_files::{LabelVolume, Progress, Tissue, VoxelFrame, Voxels, role_and_material};
use stylet_shm_schema::BUILTIN_SCENES;
use stylet_sim::limits::AxisLimits;
use stylet_sim::scene::{self, Labels, SceneSource};

const KPA_PER_PA: f64 = 1e-3;
const CC_PER_M3: f64 = 1e6;
const ROLES: [(&str, Role); 3] = [
    ("target", Role::Target),
    ("spare", Role::Spare),
    ("tissue", Role::Tissue),
];

type Table<'py> = Bound<'py, PyArray2<f64>>;

/// Returns the names of the built-in scenes, for `Scene(name)`.
#[pyfunction]
pub fn scenes() -> Vec<&'static str> {
    BUILTIN_SCENES.to_vec()
}

/// One structure of a scene, with its material.
#[pyclass(frozen, get_all, module = "stylet")]
pub struct Structure {
    /// Name.
    name: String,
    /// Label of its cells.
    label: u8,
    /// "target", "spare" or "tissue".
    role: &'static str,
    /// Young's modulus, kPa.
    young_kpa: f64,
    /// Poisson's ratio.
    poisson: f64,
    /// It never moves, as bone.
    fixed: bool,
    /// Volume, cc.
    volume_cc: f64,
    /// Least corner of the box around it at rest, scene frame, mm.
    lower_mm: [f64; 3],
    /// Largest corner of that box, scene frame, mm.
    upper_mm: [f64; 3],
}

/// A body at rest: cubic cells with a label each, and the materials of its structures.
///
/// `Scene("paper")` is the prostate of the paper, `Scene("pelvis")` and `Scene("full")` have other organs around it;
/// :func:`scenes` lists them. :meth:`of_labels` and :meth:`read` take one's own. `stiffness` multiplies Young's modulus
/// of all tissue.
///
/// Everything else in this package has positions in the frame of its scene, mm: x, y, z along the cells, cell [0, 0, 0]
/// between 0 and `spacing_mm`. For a built-in scene that is the patient's frame (RAS); for others :meth:`to_patient`
/// and :meth:`to_scene` convert.
#[pyclass(frozen, module = "stylet")]
pub struct Scene {
    pub source: SceneSource,
    body: scene::Scene,
    patient: PatientFrame,
    warnings: Vec<String>,
}

impl Scene {
    fn of(py: Python<'_>, source: SceneSource, patient: PatientFrame, warnings: Vec<String>) -> PyResult<Self> {
        let body = py.detach(|| source.build()).map_err(refused)?;
        Ok(Self {
            source,
            body,
            patient,
            warnings,
        })
    }

    fn of_volume(py: Python<'_>, volume: LabelVolume) -> PyResult<Self> {
        let labels = Labels {
            dims: volume.dims,
            spacing_m: volume.spacing_m,
            cells: volume.cells,
            structures: volume.structures.iter().map(structure).collect(),
        };
        let source = SceneSource::of_labels(&volume.name, &labels).in_layers(volume.layers);
        Self::of(py, source.map_err(refused)?, volume.patient, volume.warnings)
    }

    fn number_of(&self, name: Option<&str>) -> PyResult<usize> {
        let is_it = |s: &scene::Structure| name.map_or(s.role == Role::Target, |name| s.name == name);
        self.body.structures.iter().position(is_it).ok_or_else(|| {
            let known: Vec<&str> = self.body.structures.iter().map(|s| s.name.as_str()).collect();
            refused(format!("no structure {name:?}; there are {}", known.join(", ")))
        })
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (name="paper", *, stiffness=1.0))]
    fn new(py: Python<'_>, name: &str, stiffness: f64) -> PyResult<Self> {
        let source = SceneSource::Builtin(name.to_owned());
        let source = source.stiffened(stiffness).map_err(refused)?;
        Self::of(py, source, PatientFrame::default(), Vec::new())
    }

    /// Makes a scene of a segmentation.
    ///
    /// :param labels: array of ``uint8``, shape (X, Y, Z), indexed [x, y, z] along right, anterior, superior; 0 is no
    ///     tissue. Fortran order is read as it lies.
    /// :param spacing_mm: edges of a voxel. Unequal ones are resampled to cubes of the longest.
    /// :param structures: ``{label: name}`` or ``{label: {"name": ..., "role": "target" | "spare" | "tissue",
    ///     "young_kpa": ..., "poisson": ..., "fixed": ...}}``. What is left out follows from the name (TG-263), as in
    ///     the programs. Labels that are not named are left out. Without it all labels are one target.
    /// :param origin_mm: centre of voxel [0, 0, 0] in the patient (RAS).
    /// :raises ValueError: with every problem of labels and materials.
    ///
    /// As in the programs, a margin of 20 mm is laid around the tissue: `to_scene` gives the place of a voxel.
    #[staticmethod]
    #[pyo3(signature = (labels, spacing_mm, structures=None, *, origin_mm=[0.0; 3], name="labels"))]
    fn of_labels(
        py: Python<'_>,
        labels: PyReadonlyArray3<'_, u8>,
        spacing_mm: [f64; 3],
        structures: Option<BTreeMap<u8, Bound<'_, PyAny>>>,
        origin_mm: [f64; 3],
        name: &str,
    ) -> PyResult<Self> {
        let (cells, dims) = arrays::cells(&labels);
        let columns_m = Matrix3::from_diagonal(&(Vector3::from(spacing_mm) * M_PER_MM));
        let origin_m = arrays::place_m("origin_mm", origin_mm)?;
        let voxels = Voxels {
            dims,
            labels: cells,
            frame: VoxelFrame::new(columns_m, origin_m, "spacing_mm").map_err(refused)?,
            names: BTreeMap::new(),
            also: Vec::new(),
            overlap: None,
        };
        let tissues: Option<Vec<Tissue>> = structures
            .map(|named| named.iter().map(|(label, given)| tissue(*label, given)).collect())
            .transpose()?;
        let volume = py.detach(|| match tissues {
            Some(tissues) => LabelVolume::from_tissues(&voxels, tissues, name.to_owned(), &Progress::default()),
            None => LabelVolume::from_voxels(&voxels, None, name.to_owned(), &Progress::default()),
        });
        Self::of_volume(py, volume.map_err(refused)?)
    }

    /// Reads a label volume (NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set or Segmentation) or a scene file
    /// (`scenes/example.toml`), as ``rt-core`` and the window do. `label` takes only that label.
    #[staticmethod]
    #[pyo3(signature = (path, label=None))]
    fn read(py: Python<'_>, path: PathBuf, label: Option<u8>) -> PyResult<Self> {
        let volume = py.detach(|| stylet_files::read(&path, label, &Progress::default()));
        Self::of_volume(py, volume.map_err(refused)?)
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.body.name
    }

    /// Cells along x, y, z.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.body.lattice.dims.into()
    }

    /// Edge of a cell, mm.
    #[getter]
    fn spacing_mm(&self) -> f64 {
        self.body.lattice.spacing_m * MM_PER_M
    }

    /// Its structures, a list of :class:`Structure`.
    #[getter]
    fn structures(&self) -> Vec<Structure> {
        let lattice = &self.body.lattice;
        let cell_cc = lattice.spacing_m.powi(3) * CC_PER_M3;
        let extents = lattice.extents(self.body.structures.len());
        let of = |(s, extent): (&scene::Structure, &scene::Extent)| Structure {
            name: s.name.clone(),
            label: s.label,
            role: ROLES
                .iter()
                .find(|(_, role)| *role == s.role)
                .map_or("", |(name, _)| *name),
            young_kpa: s.material.young_pa * KPA_PER_PA,
            poisson: s.material.poisson,
            fixed: s.material.fixed,
            volume_cc: f64::from(extent.elements) * cell_cc,
            lower_mm: extent.lower_m.map(|m| m * MM_PER_M),
            upper_mm: extent.upper_m.map(|m| m * MM_PER_M),
        };
        self.body.structures.iter().zip(&extents).map(of).collect()
    }

    /// Label of each cell, ``uint8`` of shape `shape`, indexed [x, y, z]; 0 where there is no tissue.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let lattice = &self.body.lattice;
        let [x, y, z] = lattice.dims;
        let mut cells = vec![0; x * y * z];
        for element in 0..lattice.element_count() as u32 {
            let [i, j, k] = lattice.cell(element);
            let structure = usize::from(lattice.structure(element));
            cells[(k * y + j) * x + i] = self.body.structures.get(structure).map_or(1, |s| s.label);
        }
        arrays::volume(py, cells, lattice.dims)
    }

    /// Box around the targets at rest, ``((x, y, z), (x, y, z))``, mm; around the whole body without a target.
    #[getter]
    fn target_bounds_mm(&self) -> ([f64; 3], [f64; 3]) {
        let (low, high) = self.body.target_bounds_m();
        (low.map(|m| m * MM_PER_M), high.map(|m| m * MM_PER_M))
    }

    /// Remarks of the reader, for people.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Converts places of shape (N, 3), mm, from the scene to the patient (RAS).
    fn to_patient<'py>(&self, py: Python<'py>, places_mm: Rows<'py>) -> PyResult<Table<'py>> {
        let places = arrays::rows("places_mm", &places_mm, M_PER_MM)?;
        let moved = places.iter().map(|m| self.patient.patient_from_scene(*m));
        Ok(arrays::table(py, moved, MM_PER_M))
    }

    /// Converts places of shape (N, 3), mm, from the patient (RAS) to the scene.
    fn to_scene<'py>(&self, py: Python<'py>, places_mm: Rows<'py>) -> PyResult<Table<'py>> {
        let places = arrays::rows("places_mm", &places_mm, M_PER_MM)?;
        let moved = places.iter().map(|m| self.patient.scene_from_patient(*m));
        Ok(arrays::table(py, moved, MM_PER_M))
    }

    /// Returns a structure as points for its dose: ``(points_mm, volumes_cc)`` of shapes (N, 3) and (N,). One point for
    /// each cube of `pitch_mm` that it touches. Without a name: the first target.
    #[pyo3(signature = (structure=None, pitch_mm=1.0))]
    fn points<'py>(
        &self,
        py: Python<'py>,
        structure: Option<&str>,
        pitch_mm: f64,
    ) -> PyResult<(Table<'py>, Bound<'py, numpy::PyArray1<f64>>)> {
        if !(0.05..=20.0).contains(&pitch_mm) {
            return Err(refused(format!("pitch_mm is {pitch_mm}; it must be 0.05 to 20")));
        }
        let region = InBody {
            body: &self.body,
            structure: self.number_of(structure)?,
        };
        let scored = py.detach(|| Scored::of_region("", &region, pitch_mm * M_PER_MM));
        let volumes_cc = scored.volumes_m3.iter().map(|m3| m3 * CC_PER_M3).collect();
        Ok((
            arrays::table(py, scored.points_m.into_iter(), MM_PER_M),
            arrays::column(py, volumes_cc),
        ))
    }

    fn __repr__(&self) -> String {
        let (name, [x, y, z]) = (&self.body.name, self.body.lattice.dims);
        format!("<Scene {name}, {x} x {y} x {z} cells of {:.3} mm>", self.spacing_mm())
    }
}

/// One structure of a body, by its cells.
struct InBody<'a> {
    body: &'a scene::Scene,
    structure: usize,
}

impl Region for InBody<'_> {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        let extents = self.body.lattice.extents(self.body.structures.len());
        extents
            .get(self.structure)
            .map_or(([0.0; 3], [0.0; 3]), |extent| (extent.lower_m, extent.upper_m))
    }

    fn contains(&self, point_m: [f64; 3]) -> bool {
        let lattice = &self.body.lattice;
        let element = lattice.element_at_rest(point_m);
        element.is_some_and(|element| usize::from(lattice.structure(element)) == self.structure)
    }
}

/// Reads one entry of `structures`.
fn tissue(label: u8, given: &Bound<'_, PyAny>) -> PyResult<Tissue> {
    if let Ok(name) = given.extract::<String>() {
        let (role, material) = role_and_material(&name);
        return Ok(Tissue {
            label,
            name,
            role,
            material,
        });
    }
    let mut name = None;
    let (mut role, mut young_kpa, mut poisson, mut fixed) = (None, None, None, None);
    for (key, value) in given.cast::<PyDict>()? {
        match key.extract::<String>()?.as_str() {
            "name" => name = Some(value.extract::<String>()?),
            "role" => role = Some(value.extract::<String>()?),
            "young_kpa" => young_kpa = Some(value.extract::<f64>()?),
            "poisson" => poisson = Some(value.extract::<f64>()?),
            "fixed" => fixed = Some(value.extract::<bool>()?),
            key => {
                let keys = "name, role, young_kpa, poisson, fixed";
                return Err(refused(format!("structure {label} has {key:?}; known are {keys}")));
            }
        }
    }
    let name = name.ok_or_else(|| refused(format!("structure {label} has no name")))?;
    let (by_name, material) = role_and_material(&name);
    let role = match role {
        None => by_name,
        Some(text) => ROLES
            .iter()
            .find(|(known, _)| *known == text)
            .map(|(_, role)| *role)
            .ok_or_else(|| {
                refused(format!(
                    "structure {label} has the role {text:?}; known are target, spare, tissue"
                ))
            })?,
    };
    Ok(Tissue {
        label,
        name,
        role,
        material: Material {
            young_pa: young_kpa.map_or(material.young_pa, |kpa| kpa / KPA_PER_PA),
            poisson: poisson.unwrap_or(material.poisson),
            fixed: fixed.unwrap_or(material.fixed),
            ..material
        },
    })
}

/// Returns the structure as the simulation has it.
fn structure(of: &Tissue) -> scene::Structure {
    let limits = of.material.limits.map(|axes| {
        axes.map(|[min_stretch, max_stretch, shear_rad]| AxisLimits {
            min_stretch,
            max_stretch,
            shear_deg: shear_rad.to_degrees(),
        })
    });
    scene::Structure {
        name: of.name.clone(),
        label: of.label,
        role: of.role,
        material: scene::Material {
            limits,
            fixed: of.material.fixed,
            surroundings: of.material.surroundings,
            young_pa: of.material.young_pa,
            poisson: of.material.poisson,
        },
    }
}
