//! The scene both ways: what runs (core to host) and a volume of the user's own (host to core).

use crate::Text;
use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Goes with `3 * vertex_count` words of rest positions (`f32` bits, m) and `3 * triangle_count` words of indices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.SceneHeader")]
pub struct SceneHeader {
    pub session_id: u64,
    pub generation: u64,
    /// Elements along x, y, z.
    pub dims: [u32; 3],
    pub element_count: u32,
    pub surface_element_count: u32,
    pub vertex_count: u32,
    pub triangle_count: u32,
    pub reserved: u32,
    pub spacing_m: f64,
    pub volume_m3: f64,
    /// Bounding box of the tissue.
    pub lower_m: [f64; 3],
    pub upper_m: [f64; 3],
    /// Patient (RAS, m) from scene: row-major rotation, then translation. Identity for built-in scenes.
    pub patient_from_scene: [f64; 12],
    pub name: Text<64>,
}

impl SceneHeader {
    /// Words that must follow the header; `None` when the counts are absurd.
    pub fn word_count(&self) -> Option<usize> {
        let words = 3 * (u64::from(self.vertex_count) + u64::from(self.triangle_count));
        (words <= 3 * 64_000_000).then_some(words as usize)
    }
}

/// Goes with `dims[0] * dims[1] * dims[2]` cells, x fastest; every cell but 0 is tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.UploadHeader")]
pub struct UploadHeader {
    pub host_id: u64,
    /// The reply carries it back.
    pub command_id: u64,
    pub dims: [u32; 3],
    pub reserved: u32,
    pub spacing_m: f64,
    pub patient_from_scene: [f64; 12],
    pub name: Text<64>,
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
