//! What the surfaces of a scene are of, and how each is drawn.

use crate::mesh;
use crate::theme::Tokens;
use egui::Color32;
use stylet_host::link::SceneModel;
use stylet_shm_schema::{SceneHeader, StructureInfo, role};

/// What a surface is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The body around the others.
    Body,
    Gland,
    Spared,
    Bone,
}

impl Kind {
    pub fn color(self, tokens: &Tokens) -> Color32 {
        match self {
            Self::Body => tokens.body,
            Self::Gland => tokens.gland,
            Self::Spared => tokens.spared,
            Self::Bone => tokens.bone,
        }
    }

    /// Of the opacity that a person set: what lies around the gland must not hide it.
    pub fn share(self) -> f32 {
        match self {
            Self::Body => 0.16,
            Self::Gland => 1.0,
            Self::Spared => 0.5,
            Self::Bone => 0.6,
        }
    }
}

/// Structures that are drawn by themselves.
fn drawn(scene: &SceneHeader) -> impl Iterator<Item = &StructureInfo> {
    scene.structures().iter().filter(|s| s.triangle_count > 0)
}

/// What each surface is of, the body's first. A body without others in it is the gland.
pub fn kinds(scene: Option<&SceneHeader>) -> impl Iterator<Item = Kind> {
    let inner = scene.into_iter().flat_map(drawn).map(|s| match s.role {
        bits if bits & role::TARGET != 0 => Kind::Gland,
        bits if bits & role::FIXED != 0 => Kind::Bone,
        _ => Kind::Spared,
    });
    let body = if scene.is_some_and(|s| drawn(s).next().is_some()) {
        Kind::Body
    } else {
        Kind::Gland
    };
    std::iter::once(body).chain(inner)
}

/// The indices of each surface, in the order of [`kinds`].
pub fn surfaces(model: &SceneModel) -> Vec<Vec<u32>> {
    let header = &model.header;
    let inner = drawn(header).map(|s| (s.first_triangle as usize, s.triangle_count as usize));
    std::iter::once((0, header.body_triangle_count as usize))
        .chain(inner)
        .map(|(first, count)| {
            let triangles = model.triangles.get(first..first + count).unwrap_or(&[]);
            mesh::indices(triangles, model.rest_m.len())
        })
        .collect()
}
