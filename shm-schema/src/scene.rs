//! Scenes in both directions: the running one (core to host) and a user's volume (host to core).

use crate::{GridInfo, MAX_STRUCTURES, Text};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use stylet_anatomy::{Layer, PatientFrame};

/// Role of a structure, as bits of [`StructureInfo::role`] and [`UploadStructure::role`].
pub mod role {
    /// Seeds are planned in the structure.
    pub const TARGET: u32 = 1;
    /// To be kept from needles and dose.
    pub const SPARE: u32 = 2;
    /// Never moves.
    pub const FIXED: u32 = 4;
    /// All known bits.
    pub const ALL: u32 = TARGET | SPARE | FIXED;
}

/// One structure of the running scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
pub struct StructureInfo {
    /// Label of its cells in the volume, 1 to 255.
    pub label: u32,
    /// Bits of [`role`].
    pub role: u32,
    /// Elements that belong to it.
    #[serde(rename = "elements")]
    pub element_count: u32,
    /// First triangle of its surface; none if it is not drawn separately. All targets are drawn together as the first
    /// of them.
    pub first_triangle: u32,
    /// Number of triangles of its surface.
    #[serde(rename = "triangles")]
    pub triangle_count: u32,
    /// Zero.
    #[serde(skip)]
    pub reserved: u32,
    /// Bounding box at rest.
    pub lower_m: [f64; 3],
    /// Largest corner of the bounding box, m.
    pub upper_m: [f64; 3],
    /// Name as the file or the built-in scene gives it.
    pub name: Text<32>,
}

/// Precedes `3 * vertex_count` words of rest positions (`f32` bits, m), `3 * triangle_count` words of indices, and the
/// cells of `labels`, four to a word, lowest byte first: 0 where there is no tissue, else one more than the index in
/// `structures`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneHeader {
    /// The run of the core.
    #[serde(skip)]
    pub session_id: u64,
    /// Rises with each scene of a run, from 1.
    pub generation: u64,
    /// Elements along x, y, z.
    pub dims: [u32; 3],
    /// Elements of the body.
    #[serde(rename = "elements")]
    pub element_count: u32,
    /// Elements at the surface of the body.
    #[serde(rename = "surface_elements")]
    pub surface_element_count: u32,
    /// Vertices of the surface.
    #[serde(rename = "vertices")]
    pub vertex_count: u32,
    /// Triangles of all surfaces.
    #[serde(rename = "triangles")]
    pub triangle_count: u32,
    /// The body's triangles come first; those of its structures follow.
    #[serde(rename = "body_triangles")]
    pub body_triangle_count: u32,
    /// Number of `structures` in use; at least one.
    #[serde(skip)]
    pub structure_count: u32,
    /// Edge of the tissue model's elements, in edges of the elements here: 1, or more if those are too many for it.
    pub body_edge: u32,
    /// Edge of an element, m.
    pub spacing_m: f64,
    /// Volume of the tissue, m³.
    pub volume_m3: f64,
    /// Bounding box of the tissue.
    pub lower_m: [f64; 3],
    /// Largest corner of that box, m.
    pub upper_m: [f64; 3],
    /// Bounding box of the targets, at which a plan aims.
    pub target_lower_m: [f64; 3],
    /// Largest corner of that box, m.
    pub target_upper_m: [f64; 3],
    /// Patient (RAS, m) from scene: row-major rotation, then translation. Identity for built-in scenes.
    pub patient_from_scene: [f64; 12],
    /// Grid of the labels of the body at rest.
    pub labels: GridInfo,
    /// Grid of the displacements in each snapshot.
    pub nodes: GridInfo,
    /// Name of the scene.
    pub name: Text<64>,
    /// The first `structure_count` are in use.
    #[serde(skip)]
    pub structures: [StructureInfo; MAX_STRUCTURES],
}

/// Identity of a scene: the run of the core, and the scene in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SceneId {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each scene of a run, from 1.
    pub generation: u64,
}

impl SceneHeader {
    /// Returns the patient's placement in the scene: the only reader of `patient_from_scene`.
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

    /// Edge of the tissue model's elements, m.
    pub fn body_spacing_m(&self) -> f64 {
        f64::from(self.body_edge) * self.spacing_m
    }

    /// Returns the structures in use.
    pub fn structures(&self) -> &[StructureInfo] {
        &self.structures[..(self.structure_count as usize).min(MAX_STRUCTURES)]
    }

    /// Number of words that must follow the header; `None` if the counts are absurd.
    pub fn word_count(&self) -> Option<usize> {
        let labels = self.labels.node_count()?.div_ceil(4) as u64;
        let words = 3 * (u64::from(self.vertex_count) + u64::from(self.triangle_count)) + labels;
        (words <= 3 * 64_000_000).then_some(words as usize)
    }
}

/// One structure of a host's volume, with its material.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct UploadStructure {
    /// The label of its cells, 1 to 255.
    pub label: u32,
    /// Bits of [`role`].
    pub role: u32,
    /// 1: `limits` apply; 0: the structure uses the operator's limits.
    pub own_limits: u32,
    /// Support: `stylet_anatomy::Surroundings` on the wire.
    pub surroundings: u32,
    /// Young's modulus, Pa.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// For links along x, y, z: shortest and longest as a fraction of their rest length, and shear (rad).
    pub limits: [[f64; 3]; 3],
    /// Name for people.
    pub name: Text<32>,
}

/// Precedes `dims[0] * dims[1] * dims[2]` cells, x fastest; every nonzero cell is tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct UploadHeader {
    /// The sending host.
    pub host_id: u64,
    /// Number repeated in the reply.
    pub command_id: u64,
    /// Cells along x, y, z.
    pub dims: [u32; 3],
    /// Number of `structures` in use; 0: all tissue is one structure.
    pub structure_count: u32,
    /// Edge of a cell, m.
    pub spacing_m: f64,
    /// Patient (RAS, m) from scene: row-major rotation, then translation.
    pub patient_from_scene: [f64; 12],
    /// Thickness, m, and Young's modulus, Pa, of each layer around the body, the innermost first; zeros end them.
    pub layers: [[f64; 2]; Layer::MOST],
    /// Name of the volume.
    pub name: Text<64>,
    /// The first `structure_count` are in use.
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
