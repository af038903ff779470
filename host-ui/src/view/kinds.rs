//! Kinds of surfaces in a scene, and the look of each.

use crate::theme::{IMAGE, Tokens};
use egui::Color32;
use std::ops::Range;
use stylet_anatomy::Organ;
use stylet_shm_schema::{SceneHeader, StructureInfo, role};
use stylet_surfaces::bodies::{Bodies, shown_alone};
use stylet_surfaces::mesh;

/// Kind of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Body around the others.
    Body,
    Gland,
    Urethra,
    Rectum,
    Bladder,
    /// Any other structure at risk.
    Spared,
    Bone,
}

impl Kind {
    /// Every kind, in the order of the legend.
    pub const ALL: [Self; 7] = [
        Self::Gland,
        Self::Urethra,
        Self::Rectum,
        Self::Bladder,
        Self::Spared,
        Self::Bone,
        Self::Body,
    ];

    fn of(structure: &StructureInfo) -> Self {
        let name = structure.name.read();
        let at_risk = [
            (Organ::Urethra, Self::Urethra),
            (Organ::RectalWall, Self::Rectum),
            (Organ::Bladder, Self::Bladder),
        ];
        match structure.role {
            bits if bits & role::TARGET != 0 => Self::Gland,
            bits if bits & role::FIXED != 0 => Self::Bone,
            _ => {
                let named = at_risk.into_iter().find(|(organ, _)| organ.is_mentioned_in(&name));
                named.map_or(Self::Spared, |(_, kind)| kind)
            }
        }
    }

    /// Returns its name in the legend.
    pub fn name(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Gland => "gland",
            Self::Urethra => "urethra",
            Self::Rectum => "rectum",
            Self::Bladder => "bladder",
            Self::Spared => "to be spared",
            Self::Bone => "bone",
        }
    }

    /// Returns the colour of its outline over an image.
    pub fn image_color(self) -> Color32 {
        match self {
            Self::Gland => IMAGE.gland,
            Self::Urethra => IMAGE.urethra,
            Self::Rectum => IMAGE.rectum,
            Self::Bladder => IMAGE.bladder,
            Self::Spared | Self::Body => IMAGE.spared,
            Self::Bone => IMAGE.bone,
        }
    }

    pub fn color(self, tokens: &Tokens) -> Color32 {
        match self {
            Self::Body => tokens.body,
            Self::Gland => tokens.gland,
            Self::Urethra => tokens.urethra,
            Self::Rectum => tokens.rectum,
            Self::Bladder => tokens.bladder,
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
            Self::Urethra | Self::Rectum | Self::Bladder | Self::Spared => 0.5,
            Self::Bone => 0.6,
        }
    }
}

/// Returns the kind of each surface, the body's first. A body without others in it is the gland.
pub fn kinds(scene: Option<&SceneHeader>) -> impl Iterator<Item = Kind> {
    let alone = scene.map_or_else(Vec::new, shown_alone);
    let body = if alone.is_empty() { Kind::Gland } else { Kind::Body };
    let inner = alone
        .into_iter()
        .filter_map(move |(n, _)| Some(Kind::of(scene?.structures().get(n)?)));
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
