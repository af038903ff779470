//! Validates the header of a volume that a host sends, and makes labels for a scene.

use stylet_shm_schema::{MAX_STRUCTURES, UploadHeader, UploadStructure, check, role};
use stylet_sim::limits::AxisLimits;
use stylet_sim::scene::{Labels, Material, Role, Structure, Surroundings};

/// Every problem with the header of an upload, one per line.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct InvalidUpload(Vec<String>);

/// Lists every problem with the header. The scene checks labels, materials and their combination.
pub fn labels(header: &UploadHeader, cells: &[u8]) -> Result<Labels, InvalidUpload> {
    let mut problems = Vec::new();
    let expected = header.dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(u64::from(d)));
    if expected != Some(cells.len() as u64) {
        problems.push(format!(
            "the volume has {:?} cells by its header but {} were received",
            header.dims,
            cells.len()
        ));
    }
    let within = |v: &f64| v.abs() <= check::MAX_COORDINATE_M;
    if !header.patient_from_scene.iter().all(within) {
        problems.push("the transform to the patient is not finite or farther than 20 m".to_owned());
    }
    let mut structures = Vec::new();
    match header.structures.get(..header.structure_count as usize) {
        None => problems.push(format!(
            "{} structures, at most {MAX_STRUCTURES}",
            header.structure_count
        )),
        Some(sent) => {
            for structure in sent {
                match read(structure) {
                    Ok(structure) => structures.push(structure),
                    Err(why) => problems.push(why),
                }
            }
        }
    }
    if !problems.is_empty() {
        return Err(InvalidUpload(problems));
    }
    Ok(Labels {
        dims: header.dims.map(|d| d as usize),
        spacing_m: header.spacing_m,
        cells: cells.to_vec(),
        structures,
    })
}

fn read(sent: &UploadStructure) -> Result<Structure, String> {
    let name = sent.name.read();
    let Ok(label) = u8::try_from(sent.label) else {
        return Err(format!("structure \"{name}\" has label {}, at most 255", sent.label));
    };
    let both = role::TARGET | role::SPARE;
    if sent.role & !role::ALL != 0 || sent.role & both == both || sent.own_limits > 1 {
        return Err(format!(
            "structure \"{name}\" has role {} and own_limits {}, which host and core understand differently",
            sent.role, sent.own_limits
        ));
    }
    let Some(surroundings) = Surroundings::of_wire(sent.surroundings) else {
        let bits = sent.surroundings;
        return Err(format!(
            "structure \"{name}\" has surroundings {bits:#x}, which host and core understand differently"
        ));
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
