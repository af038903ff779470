//! Volumes that a host sends for the core to run.

use super::outgoing::Outgoing;
use super::{Link, LinkError};
use stylet_anatomy::Role;
use stylet_files::{LabelVolume, Tissue};
use stylet_shm_schema::*;

/// Largest volume that the core accepts, in cells.
pub const MAX_UPLOAD_CELLS: usize = 64 << 20;

impl Link {
    /// Uploads a segmented volume for the core to run instead of the present scene.
    pub fn upload(&mut self, volume: &LabelVolume) -> Result<u64, LinkError> {
        let expected: usize = volume.dims.iter().product();
        if volume.cells.len() != expected || !(1..=MAX_UPLOAD_CELLS).contains(&expected) {
            return Err(LinkError::Volume {
                cells: volume.cells.len(),
                expected,
                most: MAX_UPLOAD_CELLS,
            });
        }
        let id = self.next_id()?;
        let mut header = UploadHeader {
            host_id: self.host_id,
            command_id: id,
            dims: volume.dims.map(|d| d as u32),
            spacing_m: volume.spacing_m,
            patient_from_scene: volume.patient.to_wire(),
            name: Text::new(&volume.name),
            structure_count: volume.structures.len().min(MAX_STRUCTURES) as u32,
            ..UploadHeader::default()
        };
        for (sent, tissue) in header.structures.iter_mut().zip(&volume.structures) {
            *sent = upload_structure(tissue);
        }
        for (sent, layer) in header.layers.iter_mut().zip(&volume.layers) {
            *sent = [layer.thickness_m, layer.young_pa];
        }
        self.ask(id, Outgoing::Upload(Box::new(header), volume.cells.clone()))
    }
}

fn upload_structure(tissue: &Tissue) -> UploadStructure {
    let role = match tissue.role {
        Role::Target => role::TARGET,
        Role::Spare => role::SPARE,
        Role::Tissue => 0,
    };
    UploadStructure {
        label: u32::from(tissue.label),
        role: role | if tissue.material.fixed { role::FIXED } else { 0 },
        own_limits: u32::from(tissue.material.limits.is_some()),
        surroundings: tissue.material.surroundings.to_wire(),
        young_pa: tissue.material.young_pa,
        poisson: tissue.material.poisson,
        limits: tissue.material.limits.unwrap_or_default(),
        name: Text::new(&tissue.name),
    }
}
