//! Validates the header of a volume that a host sends, and makes labels for a scene.

use stylet_shm_schema::{MAX_STRUCTURES, ProblemList, UploadHeader, UploadStructure, check, role};
use stylet_sim::limits::AxisLimits;
use stylet_sim::scene::{Labels, Layer, Material, Role, Structure, Surroundings};

/// Problem with the header of an upload.
#[derive(Debug, thiserror::Error)]
pub enum UploadProblem {
    /// Not one label for each cell.
    #[error("the volume has {dims:?} cells by its header but {received} were received")]
    Cells {
        /// Cells along each axis.
        dims: [u32; 3],
        /// Labels received.
        received: usize,
    },
    /// Not a transform of a patient.
    #[error("the transform to the patient is not finite or farther than 20 m")]
    Transform,
    /// More structures than a scene has.
    #[error("{0} structures, at most {MAX_STRUCTURES}")]
    TooManyStructures(u32),
    /// A label that no cell can have.
    #[error("structure \"{name}\" has label {label}, at most 255")]
    Label {
        /// Name of the structure.
        name: String,
        /// Its label.
        label: u32,
    },
    /// A role of another version.
    #[error(
        "structure \"{name}\" has role {role} and own_limits {own_limits}, which host and core understand differently"
    )]
    Role {
        /// Name of the structure.
        name: String,
        /// Its role.
        role: u32,
        /// Whether it has its own limits.
        own_limits: u32,
    },
    /// A layer that no body has.
    #[error("layer {number} of {thickness_m} m and {young_pa} Pa must have from {} to {} m and {} to {} Pa",
        Layer::THICKNESS_M[0], Layer::THICKNESS_M[1], Layer::YOUNG_PA[0], Layer::YOUNG_PA[1])]
    Layer {
        /// Its place, from 1.
        number: usize,
        /// Its thickness, m.
        thickness_m: f64,
        /// Its Young's modulus, Pa.
        young_pa: f64,
    },
    /// Surroundings of another version.
    #[error("structure \"{name}\" has surroundings {bits:#x}, which host and core understand differently")]
    Surroundings {
        /// Name of the structure.
        name: String,
        /// Its surroundings.
        bits: u32,
    },
}

/// Returns the layers around the body, or every problem with them; fat where the header has none.
pub fn layers(header: &UploadHeader) -> Result<Vec<Layer>, ProblemList<UploadProblem>> {
    let sent = header.layers.iter().take_while(|layer| **layer != [0.0; 2]);
    let layers: Vec<Layer> = sent
        .map(|&[thickness_m, young_pa]| Layer { thickness_m, young_pa })
        .collect();
    let wrong = layers.iter().zip(1..).filter(|(layer, _)| !layer.is_valid());
    let problem = |(layer, number): (&Layer, usize)| UploadProblem::Layer {
        number,
        thickness_m: layer.thickness_m,
        young_pa: layer.young_pa,
    };
    ProblemList::check(wrong.map(problem).collect())?;
    Ok(if layers.is_empty() { vec![Layer::FAT] } else { layers })
}

/// Lists every problem with the header. The scene checks labels, materials and their combination.
pub fn labels(header: &UploadHeader, cells: &[u8]) -> Result<Labels, ProblemList<UploadProblem>> {
    let mut problems = Vec::new();
    let expected = header.dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(u64::from(d)));
    if expected != Some(cells.len() as u64) {
        problems.push(UploadProblem::Cells {
            dims: header.dims,
            received: cells.len(),
        });
    }
    let within = |v: &f64| v.abs() <= check::MAX_COORDINATE_M;
    if !header.patient_from_scene.iter().all(within) {
        problems.push(UploadProblem::Transform);
    }
    let mut structures = Vec::new();
    match header.structures.get(..header.structure_count as usize) {
        None => problems.push(UploadProblem::TooManyStructures(header.structure_count)),
        Some(sent) => {
            for structure in sent {
                match read(structure) {
                    Ok(structure) => structures.push(structure),
                    Err(why) => problems.push(why),
                }
            }
        }
    }
    ProblemList::check(problems)?;
    Ok(Labels {
        dims: header.dims.map(|d| d as usize),
        spacing_m: header.spacing_m,
        cells: cells.to_vec(),
        structures,
    })
}

fn read(sent: &UploadStructure) -> Result<Structure, UploadProblem> {
    let name = sent.name.read();
    let Ok(label) = u8::try_from(sent.label) else {
        let label = sent.label;
        return Err(UploadProblem::Label { name, label });
    };
    let both = role::TARGET | role::SPARE;
    if sent.role & !role::ALL != 0 || sent.role & both == both || sent.own_limits > 1 {
        return Err(UploadProblem::Role {
            name,
            role: sent.role,
            own_limits: sent.own_limits,
        });
    }
    let Some(surroundings) = Surroundings::of_wire(sent.surroundings) else {
        let bits = sent.surroundings;
        return Err(UploadProblem::Surroundings { name, bits });
    };
    let limits = sent.limits.map(|[min_stretch, max_stretch, shear_rad]| AxisLimits {
        min_stretch,
        max_stretch,
        shear_deg: shear_rad.to_degrees(),
    });
    Ok(Structure {
        name,
        label,
        role: match sent.role & both {
            role::TARGET => Role::Target,
            role::SPARE => Role::Spare,
            _ => Role::Tissue,
        },
        material: Material {
            limits: (sent.own_limits == 1).then_some(limits),
            fixed: sent.role & role::FIXED != 0,
            young_pa: sent.young_pa,
            poisson: sent.poisson,
            surroundings,
        },
    })
}
