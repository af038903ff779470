//! Kinds of surfaces in a scene, and the look of each.

use crate::theme::Tokens;
use egui::Color32;
use std::ops::Range;
use stylet_shm_schema::{SceneHeader, role};
use stylet_surfaces::bodies::{Bodies, shown_alone};
use stylet_surfaces::mesh;

/// Kind of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Body around the others.
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

    /// Returns its share of the opacity that a person set: structures around the gland must not
    /// hide it.
    pub fn share(self) -> f32 {
        match self {
            Self::Body => 0.16,
            Self::Gland => 1.0,
            Self::Spared => 0.5,
            Self::Bone => 0.6,
        }
    }
}

/// Returns the kind of each surface, the body's first. A body without others in it is the gland.
pub fn kinds(scene: Option<&SceneHeader>) -> impl Iterator<Item = Kind> {
    let alone = scene.map_or_else(Vec::new, shown_alone);
    let body = if alone.is_empty() { Kind::Gland } else { Kind::Body };
    let inner = alone.into_iter().filter_map(move |(n, _)| {
        Some(match scene?.structures().get(n)?.role {
            bits if bits & role::TARGET != 0 => Kind::Gland,
            bits if bits & role::FIXED != 0 => Kind::Bone,
            _ => Kind::Spared,
        })
    });
    std::iter::once(body).chain(inner)
}

/// Returns the indices of each surface, in the order of [`kinds`].
pub fn surfaces(bodies: &Bodies) -> Vec<Vec<u32>> {
    let triangles = |part: &Range<usize>| bodies.triangles.get(part.clone()).unwrap_or(&[]);
    let count = bodies.rest_m.len();
    bodies
        .parts
        .iter()
        .map(|part| mesh::indices(triangles(part), count))
        .collect()
}
