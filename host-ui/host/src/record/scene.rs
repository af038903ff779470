//! The scene in a recording, and the displacements of its tissue.

use super::messages::Channel;
use super::setting::schema;
use crate::link::{SceneModel, Snapshot};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use stylet_shm_schema::{GridInfo, MAX_STRUCTURES, SceneHeader, StructureInfo, Text};

pub const SCENE: Channel = Channel {
    topic: "/stylet/scene",
    schema: "stylet.Scene",
    text: || {
        schema(
            "stylet.Scene",
            "the scene at rest: boxes, structures, surface, labels of the cells",
        )
    },
};
pub const FIELD: Channel = Channel {
    topic: "/stylet/field",
    schema: "stylet.Field",
    text: || {
        schema(
            "stylet.Field",
            "displacements from rest at the nodes of the scene's grid",
        )
    },
};

#[derive(Serialize, Deserialize)]
struct Grid {
    dims: [u32; 3],
    origin_m: [f64; 3],
    spacing_m: f64,
}

#[derive(Serialize, Deserialize)]
struct Structure {
    label: u32,
    role: u32,
    elements: u32,
    first_triangle: u32,
    triangles: u32,
    lower_m: [f64; 3],
    upper_m: [f64; 3],
    name: String,
}

#[derive(Serialize, Deserialize)]
struct Scene {
    generation: u64,
    dims: [u32; 3],
    elements: u32,
    surface_elements: u32,
    vertices: u32,
    triangles: u32,
    body_triangles: u32,
    body_edge: u32,
    spacing_m: f64,
    volume_m3: f64,
    lower_m: [f64; 3],
    upper_m: [f64; 3],
    target_lower_m: [f64; 3],
    target_upper_m: [f64; 3],
    patient_from_scene: [f64; 12],
    labels: Grid,
    nodes: Grid,
    name: String,
    structures: Vec<Structure>,
    /// Words that follow a `SceneHeader`, little-endian, base64.
    words: String,
}

impl From<&GridInfo> for Grid {
    fn from(grid: &GridInfo) -> Self {
        Self {
            dims: grid.dims,
            origin_m: grid.origin_m,
            spacing_m: grid.spacing_m,
        }
    }
}

impl Grid {
    fn info(&self) -> GridInfo {
        GridInfo {
            dims: self.dims,
            reserved: 0,
            origin_m: self.origin_m,
            spacing_m: self.spacing_m,
        }
    }
}

pub fn scene(model: &SceneModel) -> Value {
    let h = &model.header;
    let structures = h.structures().iter().map(|s| Structure {
        label: s.label,
        role: s.role,
        elements: s.element_count,
        first_triangle: s.first_triangle,
        triangles: s.triangle_count,
        lower_m: s.lower_m,
        upper_m: s.upper_m,
        name: s.name.read(),
    });
    let words: Vec<u8> = model.words().iter().flat_map(|word| word.to_le_bytes()).collect();
    let scene = Scene {
        generation: h.generation,
        dims: h.dims,
        elements: h.element_count,
        surface_elements: h.surface_element_count,
        vertices: h.vertex_count,
        triangles: h.triangle_count,
        body_triangles: h.body_triangle_count,
        body_edge: h.body_edge,
        spacing_m: h.spacing_m,
        volume_m3: h.volume_m3,
        lower_m: h.lower_m,
        upper_m: h.upper_m,
        target_lower_m: h.target_lower_m,
        target_upper_m: h.target_upper_m,
        patient_from_scene: h.patient_from_scene,
        labels: Grid::from(&h.labels),
        nodes: Grid::from(&h.nodes),
        name: h.name.read(),
        structures: structures.collect(),
        words: STANDARD.encode(words),
    };
    serde_json::to_value(scene).unwrap_or_default()
}

/// Decodes a scene; `None` if it is inconsistent.
pub fn scene_of(data: &[u8], session_id: u64) -> Option<SceneModel> {
    let s: Scene = serde_json::from_slice(data).ok()?;
    let mut header = SceneHeader {
        session_id,
        generation: s.generation,
        dims: s.dims,
        element_count: s.elements,
        surface_element_count: s.surface_elements,
        vertex_count: s.vertices,
        triangle_count: s.triangles,
        body_triangle_count: s.body_triangles,
        structure_count: u32::try_from(s.structures.len()).ok()?,
        body_edge: s.body_edge,
        spacing_m: s.spacing_m,
        volume_m3: s.volume_m3,
        lower_m: s.lower_m,
        upper_m: s.upper_m,
        target_lower_m: s.target_lower_m,
        target_upper_m: s.target_upper_m,
        patient_from_scene: s.patient_from_scene,
        labels: s.labels.info(),
        nodes: s.nodes.info(),
        name: Text::new(&s.name),
        ..SceneHeader::default()
    };
    if s.structures.len() > MAX_STRUCTURES {
        return None;
    }
    for (to, from) in header.structures.iter_mut().zip(&s.structures) {
        *to = StructureInfo {
            label: from.label,
            role: from.role,
            element_count: from.elements,
            first_triangle: from.first_triangle,
            triangle_count: from.triangles,
            reserved: 0,
            lower_m: from.lower_m,
            upper_m: from.upper_m,
            name: Text::new(&from.name),
        };
    }
    let bytes = STANDARD.decode(s.words).ok()?;
    let words = bytes
        .chunks_exact(4)
        .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
    SceneModel::of_words(&header, &words.collect::<Vec<_>>())
}

/// Encodes positions as three `f32` each, little-endian, base64.
fn places(places_m: &[[f32; 3]]) -> String {
    let bytes: Vec<u8> = places_m.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

pub fn places_of(text: &str) -> Option<Vec<[f32; 3]>> {
    let bytes = STANDARD.decode(text).ok()?;
    let coordinate = |w: &[u8]| f32::from_le_bytes([w[0], w[1], w[2], w[3]]);
    let place = |p: &[u8]| [coordinate(&p[..4]), coordinate(&p[4..8]), coordinate(&p[8..])];
    Some(bytes.chunks_exact(12).map(place).collect())
}

#[derive(Serialize, Deserialize)]
struct Field {
    scene_generation: u64,
    /// Displacements in m, base64.
    displacements: String,
}

pub fn field(snapshot: &Snapshot) -> Value {
    let field = Field {
        scene_generation: snapshot.header.scene_generation,
        displacements: places(&snapshot.displacements_m),
    };
    serde_json::to_value(field).unwrap_or_default()
}

/// Returns the generation of the scene, and the displacements.
pub fn field_of(data: &[u8]) -> Option<(u64, Vec<[f32; 3]>)> {
    let field: Field = serde_json::from_slice(data).ok()?;
    Some((field.scene_generation, places_of(&field.displacements)?))
}
