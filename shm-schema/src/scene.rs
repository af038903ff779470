//! The scene both ways: what runs (core to host) and a volume of the user's own (host to core).

use crate::{GridInfo, MAX_STRUCTURES, Text};
use bytemuck::{Pod, Zeroable};
use stylet_anatomy::PatientFrame;

/// What a structure is, as bits of [`StructureInfo::role`] and [`UploadStructure::role`].
pub mod role {
    /// What seeds are planned in.
    pub const TARGET: u32 = 1;
    /// To be kept from needles and dose.
    pub const SPARE: u32 = 2;
    /// Never moves.
    pub const FIXED: u32 = 4;
    /// All that are known.
    pub const ALL: u32 = TARGET | SPARE | FIXED;
}

/// One structure of the scene that runs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct StructureInfo {
    /// Label of its cells in the volume, 1 to 255.
    pub label: u32,
    /// Bits of [`role`].
    pub role: u32,
    /// Elements that belong to it.
    pub element_count: u32,
    /// The triangles of its own surface; none where it is not drawn by itself. The targets together are drawn under the
    /// first of them.
    pub first_triangle: u32,
    /// Number of triangles of its own surface.
    pub triangle_count: u32,
    /// Zero.
    pub reserved: u32,
    /// Bounding box at rest.
    pub lower_m: [f64; 3],
    /// Largest corner of the bounding box, m.
    pub upper_m: [f64; 3],
    /// Name as the file or the built-in scene gives it.
    pub name: Text<32>,
}

/// Goes with `3 * vertex_count` words of rest positions (`f32` bits, m), `3 * triangle_count` words of indices, and the cells
/// of `labels`, four to a word, lowest byte first: 0 where there is no tissue, else one more than the place in `structures`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SceneHeader {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each scene of a run, from 1.
    pub generation: u64,
    /// Elements along x, y, z.
    pub dims: [u32; 3],
    /// Elements of the body.
    pub element_count: u32,
    /// Elements at the surface of the body.
    pub surface_element_count: u32,
    /// Vertices of the surface.
    pub vertex_count: u32,
    /// Triangles of all surfaces.
    pub triangle_count: u32,
    /// The first triangles are the body's; after them come those of the structures in it.
    pub body_triangle_count: u32,
    /// How many of `structures` count; at least one.
    pub structure_count: u32,
    /// Edge of the elements that the tissue model solves for, in edges of the elements here: 1, or more where those are too
    /// many for it.
    pub body_edge: u32,
    /// Edge of an element, m.
    pub spacing_m: f64,
    /// Volume of the tissue, m³.
    pub volume_m3: f64,
    /// Bounding box of the tissue.
    pub lower_m: [f64; 3],
    /// Largest corner of that box, m.
    pub upper_m: [f64; 3],
    /// Bounding box of the targets: what a plan aims at.
    pub target_lower_m: [f64; 3],
    /// Largest corner of that box, m.
    pub target_upper_m: [f64; 3],
    /// Patient (RAS, m) from scene: row-major rotation, then translation. Identity for built-in scenes.
    pub patient_from_scene: [f64; 12],
    /// What is where in the body at rest.
    pub labels: GridInfo,
    /// Where each snapshot gives displacements.
    pub nodes: GridInfo,
    /// Name of the scene.
    pub name: Text<64>,
    /// The first `structure_count` of them count.
    pub structures: [StructureInfo; MAX_STRUCTURES],
}

/// Identity of a scene: which run of the core, and which scene in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SceneId {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each scene of a run, from 1.
    pub generation: u64,
}

impl SceneHeader {
    /// Where the patient lies in the scene: the only reader of `patient_from_scene`.
    pub fn patient(&self) -> PatientFrame {
        PatientFrame::of_wire(&self.patient_from_scene)
    }

    /// Identity of this scene.
    pub fn id(&self) -> SceneId {
        SceneId {
            session_id: self.session_id,
            generation: self.generation,
        }
    }

    /// Edge of the elements that the tissue model solves for, m.
    pub fn body_spacing_m(&self) -> f64 {
        f64::from(self.body_edge) * self.spacing_m
    }

    /// Those that count.
    pub fn structures(&self) -> &[StructureInfo] {
        &self.structures[..(self.structure_count as usize).min(MAX_STRUCTURES)]
    }

    /// Words that must follow the header; `None` when the counts are absurd.
    pub fn word_count(&self) -> Option<usize> {
        let labels = self.labels.node_count()?.div_ceil(4) as u64;
        let words = 3 * (u64::from(self.vertex_count) + u64::from(self.triangle_count)) + labels;
        (words <= 3 * 64_000_000).then_some(words as usize)
    }
}

/// One structure of a volume that a host sends, with its material.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct UploadStructure {
    /// The label of its cells, 1 to 255.
    pub label: u32,
    /// Bits of [`role`].
    pub role: u32,
    /// 1: `limits` count; 0: the structure takes the limits that the operator sets.
    pub own_limits: u32,
    /// What it rests on: `stylet_anatomy::Surroundings` on the wire.
    pub surroundings: u32,
    /// Young's modulus, Pa.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// For links along x, y, z: shortest and longest as a share of their length at rest, and shear (rad).
    pub limits: [[f64; 3]; 3],
    /// Name for people.
    pub name: Text<32>,
}

/// Goes with `dims[0] * dims[1] * dims[2]` cells, x fastest; every cell but 0 is tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct UploadHeader {
    /// The host that sends it.
    pub host_id: u64,
    /// The reply carries it back.
    pub command_id: u64,
    /// Cells along x, y, z.
    pub dims: [u32; 3],
    /// How many of `structures` count; 0: all tissue is one structure.
    pub structure_count: u32,
    /// Edge of a cell, m.
    pub spacing_m: f64,
    /// Patient (RAS, m) from scene: row-major rotation, then translation.
    pub patient_from_scene: [f64; 12],
    /// Name of the volume.
    pub name: Text<64>,
    /// The first `structure_count` of them count.
    pub structures: [UploadStructure; MAX_STRUCTURES],
}

impl Default for SceneHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Default for UploadHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}
