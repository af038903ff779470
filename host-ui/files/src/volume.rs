//! A segmented volume in the core's form: cubic elements on the lattice of the scene frame.

mod cover;
mod movable;

use super::frame::VoxelFrame;
use super::progress::{Progress, Stage};
use crate::error::{ContentError, invalid};
use cover::{covered, covers};
use movable::movable;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use stylet_anatomy::{Layer, Material, Organ, PatientFrame, Role};

/// Margin around the tissue.
const MARGIN_M: f64 = 0.020;
const MAX_DIM: usize = 1024;
const MAX_TISSUE: usize = 4_000_000;
const MAX_CELLS: usize = 64 << 20;
const COARSER: f64 = 1.1;

/// Structure of a volume and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// Label of its cells.
    pub label: u8,
    /// Name of the structure.
    pub name: String,
    /// Role in the procedure.
    pub role: Role,
    /// Elastic material.
    pub material: Material,
}

/// Volume of labels. Element (i, j, k) has its centre at ((i + 0.5) h, (j + 0.5) h, (k + 0.5) h), x
/// fastest; every cell but 0 is tissue.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelVolume {
    /// Number of elements along x, y, z.
    pub dims: [usize; 3],
    /// Side of an element, in m.
    pub spacing_m: f64,
    /// Label of each element, x fastest.
    pub cells: Vec<u8>,
    /// Tissue of each label; if empty, all tissue is the same.
    pub structures: Vec<Tissue>,
    /// Layers around the body, the innermost first.
    pub layers: Vec<Layer>,
    /// Place of the patient in the scene.
    pub patient: PatientFrame,
    /// Name of the volume.
    pub name: String,
    /// Every label of the file with its number of voxels, by label.
    pub voxels_per_label: Vec<(u8, u64)>,
    /// Remarks for the user on the reading of the file.
    pub warnings: Vec<String>,
}

/// Voxels of a file in stored order, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    /// Number of voxels along each axis.
    pub dims: [usize; 3],
    /// Label of each voxel.
    pub labels: Vec<u8>,
    /// Place of the voxels in the patient.
    pub frame: VoxelFrame,
    /// Names of labels in the file, if there are any.
    pub names: BTreeMap<u8, String>,
    /// Overlaps: further labels of voxels, by index, in addition to the stored one.
    pub also: Vec<(u8, u32)>,
    /// Losses through the limit of one label a voxel, in words.
    pub overlap: Option<String>,
}

impl Voxels {
    /// Returns the indices of all voxels of a label, lowest first, including those where another
    /// label is stored.
    pub fn of_label(&self, label: u8) -> Vec<usize> {
        let here = (0..self.labels.len()).filter(|&n| self.labels[n] == label);
        let also = self
            .also
            .iter()
            .filter(|(of, _)| *of == label)
            .map(|(_, n)| *n as usize);
        let mut all: Vec<usize> = here.chain(also).collect();
        all.sort_unstable();
        all
    }

    /// Returns every label but 0 in any voxel, lowest first.
    pub fn present(&self) -> Vec<u8> {
        let mut is_there = [false; 256];
        self.labels
            .iter()
            .for_each(|&label| is_there[usize::from(label)] = true);
        self.also
            .iter()
            .for_each(|&(label, _)| is_there[usize::from(label)] = true);
        (1..=255).filter(|&label| is_there[usize::from(label)]).collect()
    }
}

/// Values of a file's voxels, x fastest, of any meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelValues<V> {
    /// Number of voxels along each axis.
    pub dims: [usize; 3],
    /// Value of each voxel.
    pub values: Vec<V>,
    /// Place of the voxels in the patient.
    pub frame: VoxelFrame,
}

impl VoxelValues<u8> {
    /// Converts values to labels with the names of the file.
    pub fn named(self, names: BTreeMap<u8, String>) -> Voxels {
        Voxels {
            dims: self.dims,
            labels: self.values,
            frame: self.frame,
            names,
            also: Vec::new(),
            overlap: None,
        }
    }
}

/// First and last tissue voxel along each axis.
type Bounds = ([usize; 3], [usize; 3]);
/// Size, corner and cells.
type Resampled = ([usize; 3], [f64; 3], Vec<u8>);

impl LabelVolume {
    /// Returns the number of tissue elements.
    pub fn tissue_elements(&self) -> usize {
        self.cells.iter().filter(|&&c| c != 0).count()
    }

    /// Returns the centre of the lattice, in the scene.
    pub fn middle_m(&self) -> [f64; 3] {
        self.dims.map(|d| d as f64 * self.spacing_m / 2.0)
    }

    /// Creates the structures that the volume names, or all labels as one tissue, or only the
    /// requested one.
    pub fn from_voxels(
        voxels: &Voxels,
        label: Option<u8>,
        name: String,
        progress: &Progress,
    ) -> Result<Self, ContentError> {
        if label.is_none() && !voxels.names.is_empty() {
            return Self::from_tissues(voxels, by_name(voxels), name, progress);
        }
        let present = voxels_per_label(voxels);
        let mut keep = [0_u8; 256];
        (1..=255)
            .filter(|&l| label.is_none_or(|only| only == l))
            .for_each(|l| keep[usize::from(l)] = 1);
        let mut volume = Self::resized(voxels, &keep, name, progress, || no_tissue(label, &present))?;
        if label.is_none() && present.len() > 1 {
            volume
                .warnings
                .push(format!("all labels are taken as one tissue: {}", list(&present)));
        }
        Ok(volume)
    }

    /// Creates a volume of these structures; other labels are left out.
    pub fn from_tissues(
        voxels: &Voxels,
        structures: Vec<Tissue>,
        name: String,
        progress: &Progress,
    ) -> Result<Self, ContentError> {
        let mut keep = [0_u8; 256];
        structures.iter().for_each(|t| keep[usize::from(t.label)] = t.label);
        let present = voxels_per_label(voxels);
        let nothing = || "none of its structures has a voxel; export the segmentation again".to_owned();
        let mut volume = Self::resized(voxels, &keep, name, progress, nothing)?;
        let in_cells = |t: &Tissue| volume.cells.contains(&t.label);
        let (structures, lost): (Vec<Tissue>, Vec<Tissue>) = structures.into_iter().partition(in_cells);
        let notes = &mut volume.warnings;
        notes.extend(
            lost.iter()
                .map(|t| format!("\"{}\" is thinner than an element and is left out", t.name)),
        );
        let left_out: Vec<(u8, u64)> = present
            .into_iter()
            .filter(|(l, _)| keep[usize::from(*l)] == 0)
            .collect();
        if !left_out.is_empty() {
            notes.push(format!("labels without a structure are left out: {}", list(&left_out)));
        }
        for t in structures.iter().filter(|t| Organ::of_name(&t.name).is_none()) {
            notes.push(format!(
                "\"{}\" is not a known TG-263 name (such as Prostate, Urethra, Rectum, Bladder); it is taken as {}",
                t.name,
                match t.role {
                    Role::Target => "a target",
                    Role::Spare => "to be spared",
                    Role::Tissue => "tissue around",
                }
            ));
        }
        movable(&structures)?;
        if !structures.iter().any(|t| t.role == Role::Target) {
            notes.push(
                "no structure is a target, so the whole body is aimed at; name one Prostate, CTV or PTV".to_owned(),
            );
        }
        volume.structures = structures;
        Ok(volume)
    }

    /// Resamples to elements as large as the longest side of a voxel, or larger if that would be
    /// too many.
    fn resized(
        voxels: &Voxels,
        keep: &[u8; 256],
        name: String,
        progress: &Progress,
        nothing: impl Fn() -> String,
    ) -> Result<Self, ContentError> {
        let bounds = tissue_bounds(voxels, keep).ok_or_else(nothing)?;
        let finest = voxels.frame.spacing_m.iter().fold(0.0_f64, |a, &b| a.max(b));
        let mut h = finest;
        loop {
            let volume = Self::resampled(voxels, keep, bounds, h, progress)?;
            if let Some((dims, origin, cells)) = volume.filter(|v| tissue(&v.2) <= MAX_TISSUE) {
                if tissue(&cells) == 0 {
                    return Err(invalid!("the tissue is thinner than its elements of {:.2} mm", h * 1e3));
                }
                let mut warnings: Vec<String> = voxels.frame.warning.iter().chain(&voxels.overlap).cloned().collect();
                if h > finest {
                    warnings.push(format!(
                        "the elements were made {:.2} mm instead of {:.2} mm so that the volume can be sent",
                        h * 1e3,
                        finest * 1e3
                    ));
                }
                return Ok(Self {
                    dims,
                    spacing_m: h,
                    cells,
                    structures: Vec::new(),
                    layers: vec![Layer::FAT],
                    patient: patient_frame(&voxels.frame, voxels.dims, origin),
                    name,
                    voxels_per_label: voxels_per_label(voxels),
                    warnings,
                });
            }
            h *= COARSER;
        }
    }

    /// Returns size, corner of the lattice in the upright voxel frame (m), and cells; `None` if it
    /// would be too large.
    fn resampled(
        v: &Voxels,
        keep: &[u8; 256],
        bounds: Bounds,
        h: f64,
        progress: &Progress,
    ) -> Result<Option<Resampled>, ContentError> {
        let (low, high) = upright(bounds, mirrored(&v.frame), v.dims);
        let mut dims = [0; 3];
        let mut corner = [0.0; 3];
        for a in 0..3 {
            let s = v.frame.spacing_m[a];
            let margin = (MARGIN_M / h).ceil();
            let inside = ((high[a] + 1 - low[a]) as f64 * s / h - 1e-9).ceil();
            corner[a] = low[a] as f64 * s - margin * h;
            dims[a] = (inside + 2.0 * margin) as usize;
        }
        let count = dims.iter().product::<usize>();
        if dims.iter().any(|&d| d > MAX_DIM) || count > MAX_CELLS {
            return Ok(None);
        }
        // Shares of each element that each voxel covers, per axis.
        let covers = [0, 1, 2].map(|a| covers(dims[a], corner[a], h, v.frame.spacing_m[a], v.dims[a]));
        let flip = mirrored(&v.frame);
        let mut cells = vec![0_u8; count];
        for k in 0..dims[2] {
            progress.report(Stage::Elements, k, dims[2])?;
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    let label = covered(v, keep, flip, [&covers[0][i], &covers[1][j], &covers[2][k]]);
                    cells[(k * dims[1] + j) * dims[0] + i] = label;
                }
            }
        }
        Ok(Some((dims, corner, cells)))
    }
}

fn tissue(cells: &[u8]) -> usize {
    cells.iter().filter(|&&c| c != 0).count()
}

/// Returns whether the first axis is reversed, because the voxel axes are left-handed.
fn mirrored(frame: &VoxelFrame) -> bool {
    frame.directions.determinant() < 0.0
}

fn upright((mut low, mut high): Bounds, flip: bool, dims: [usize; 3]) -> Bounds {
    if flip {
        (low[0], high[0]) = (dims[0] - 1 - high[0], dims[0] - 1 - low[0]);
    }
    (low, high)
}

/// Returns each label but 0 with its number of voxels.
pub fn voxels_per_label(v: &Voxels) -> Vec<(u8, u64)> {
    let mut counts = [0_u64; 256];
    v.labels.iter().for_each(|&l| counts[usize::from(l)] += 1);
    (1..=255)
        .map(|l| (l, counts[usize::from(l)]))
        .filter(|p| p.1 > 0)
        .collect()
}

/// Returns role and material of a structure by its name; generic tissue for an unknown name.
pub fn role_and_material(name: &str) -> (Role, Material) {
    Organ::of_name(name).map_or((Role::Tissue, Material::OTHER), |o| (o.role(), o.material()))
}

/// Returns the labels of a volume, each with the tissue of its name.
pub fn by_name(v: &Voxels) -> Vec<Tissue> {
    let tissue = |(label, _)| {
        let name = v.names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
        let (role, material) = role_and_material(&name);
        Tissue {
            label,
            name,
            role,
            material,
        }
    };
    voxels_per_label(v).into_iter().map(tissue).collect()
}

fn tissue_bounds(v: &Voxels, keep: &[u8; 256]) -> Option<Bounds> {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for (index, _) in v.labels.iter().enumerate().filter(|(_, l)| keep[usize::from(**l)] != 0) {
        let at = [
            index % v.dims[0],
            index / v.dims[0] % v.dims[1],
            index / v.dims[0] / v.dims[1],
        ];
        for a in 0..3 {
            low[a] = low[a].min(at[a]);
            high[a] = high[a].max(at[a]);
        }
    }
    (low[0] != usize::MAX).then_some((low, high))
}

fn list(present: &[(u8, u64)]) -> String {
    let each: Vec<String> = present.iter().map(|(l, n)| format!("{l} ({n} voxels)")).collect();
    each.join(", ")
}

fn no_tissue(label: Option<u8>, present: &[(u8, u64)]) -> String {
    match label {
        _ if present.is_empty() => {
            "every voxel is 0, so there is no tissue; export the segmentation that has the gland".to_owned()
        }
        Some(0) => format!("label 0 is the background; choose one of {}", list(present)),
        Some(l) => format!("no voxel has label {l}; choose one of {}", list(present)),
        None => "there is no tissue".to_owned(),
    }
}

/// Returns the patient frame. The corner of voxel 0 lies half a voxel before its centre, where the
/// file puts the origin.
fn patient_frame(frame: &VoxelFrame, dims: [usize; 3], corner_m: [f64; 3]) -> PatientFrame {
    let side = Vector3::from(frame.spacing_m);
    let mut rotation: Matrix3<f64> = frame.directions;
    let mut corner = frame.origin_m - rotation * (side / 2.0);
    if mirrored(frame) {
        corner += rotation.column(0) * (dims[0] as f64 * side.x);
        let turned = -rotation.column(0);
        rotation.set_column(0, &turned);
    }
    PatientFrame::new(rotation, corner + rotation * Vector3::from(corner_m))
}
