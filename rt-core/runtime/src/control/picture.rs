//! Geometry that hosts need to draw a scene and to plan in it.

use super::wall::Wall;
use stylet_anatomy::PatientFrame;
use stylet_shm_schema::*;
use stylet_sim::scene::{Role, Scene, Structure, label_grid};

/// Number of vertices and nodes in each snapshot of `scene`.
pub fn snapshot_len(scene: &Scene) -> usize {
    scene.surface.vertex_elements.len() + scene.nodes.elements.len()
}

/// Header and words of the scene service.
pub struct ScenePicture {
    pub(super) header: SceneHeader,
    pub(super) words: Vec<u32>,
}

impl ScenePicture {
    /// Returns the picture of a run's first, built-in scene.
    pub fn first(scene: &Scene, session_id: u64) -> Self {
        Self::of(scene, session_id, 1, PatientFrame::default())
    }

    /// Returns the header, and the rest positions and triangles behind it.
    pub fn parts(&self) -> (&SceneHeader, &[u32]) {
        (&self.header, &self.words)
    }

    /// Number of words behind the header.
    pub fn word_count(&self) -> usize {
        self.words.len()
    }

    /// Shows the picture to hosts, with the board of its snapshots.
    pub(super) fn show(&self, wall: &mut dyn Wall) {
        wall.show_scene(&self.header, &self.words);
    }

    pub(super) fn of(scene: &Scene, session_id: u64, generation: u64, patient: PatientFrame) -> Self {
        let (lattice, surface) = (&scene.lattice, &scene.surface);
        let (lower_m, upper_m) = lattice.bounds_m();
        let (target_lower_m, target_upper_m) = scene.target_bounds_m();
        let vertices = &surface.vertex_elements;
        let positions = vertices
            .iter()
            .flat_map(|&e| lattice.rest_m(e))
            .map(|c| (c as f32).to_bits());
        let indices = surface.triangles.iter().flatten().copied();
        let (label_info, labels) = label_grid(lattice);
        let labels = labels.chunks(4).map(packed);
        Self {
            words: positions.chain(indices).chain(labels).collect(),
            header: SceneHeader {
                session_id,
                generation,
                dims: lattice.dims.map(|d| d as u32),
                element_count: lattice.element_count() as u32,
                surface_element_count: surface.body_elements as u32,
                vertex_count: vertices.len() as u32,
                triangle_count: surface.triangles.len() as u32,
                body_triangle_count: surface.body_triangles as u32,
                structure_count: scene.structures.len() as u32,
                body_edge: scene.coarseness(),
                spacing_m: lattice.spacing_m,
                volume_m3: lattice.volume_m3(),
                lower_m,
                upper_m,
                target_lower_m,
                target_upper_m,
                patient_from_scene: patient.to_wire(),
                labels: label_info,
                nodes: scene.nodes.info,
                name: Text::new(&scene.name),
                structures: structures(scene),
            },
        }
    }
}

/// Packs four cells into a word, lowest byte first; missing cells count as no tissue.
fn packed(cells: &[u8]) -> u32 {
    let mut bytes = [0; 4];
    bytes[..cells.len()].copy_from_slice(cells);
    u32::from_le_bytes(bytes)
}

fn structures(scene: &Scene) -> [StructureInfo; MAX_STRUCTURES] {
    let mut infos = [bytemuck::Zeroable::zeroed(); MAX_STRUCTURES];
    let extents = scene.lattice.extents(scene.structures.len());
    for ((info, structure), extent) in infos.iter_mut().zip(&scene.structures).zip(extents) {
        *info = StructureInfo {
            label: u32::from(structure.label),
            role: role_of(structure),
            element_count: extent.elements,
            first_triangle: 0,
            triangle_count: 0,
            reserved: 0,
            lower_m: extent.lower_m,
            upper_m: extent.upper_m,
            name: Text::new(&structure.name),
        };
    }
    for part in &scene.surface.parts {
        if let Some(info) = infos.get_mut(part.structure as usize) {
            info.first_triangle = part.triangles.start as u32;
            info.triangle_count = part.triangles.len() as u32;
        }
    }
    infos
}

fn role_of(structure: &Structure) -> u32 {
    let fixed = if structure.material.fixed { role::FIXED } else { 0 };
    fixed
        | match structure.role {
            Role::Target => role::TARGET,
            Role::Spare => role::SPARE,
            Role::Tissue => 0,
        }
}
