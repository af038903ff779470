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
        match structure.role {
            bits if bits & role::TARGET != 0 => Self::Gland,
            bits if bits & role::FIXED != 0 => Self::Bone,
            _ => Self::of_spared(&structure.name.read()),
        }
    }

    /// Returns the kind of a structure to be spared, by its name.
    pub fn of_spared(name: &str) -> Self {
        let at_risk = [
            (Organ::Urethra, Self::Urethra),
            (Organ::RectalWall, Self::Rectum),
            (Organ::Bladder, Self::Bladder),
        ];
        let named = at_risk.into_iter().find(|(organ, _)| organ.is_mentioned_in(name));
        named.map_or(Self::Spared, |(_, kind)| kind)
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

    /// Returns the colour of its outline in a panel, the same as over an image if the panel is dark too.
    pub fn panel_color(self, tokens: &Tokens) -> Color32 {
        if tokens.dark {
            self.image_color()
        } else {
            self.color(tokens)
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

/// Longest name of a structure in the legend.
const LONGEST_NAME: usize = 24;

/// Returns the kinds that are drawn, in the order of the legend. The only structure of a kind keeps its own name, as in
/// the table of doses.
pub fn named(scene: &SceneHeader) -> Vec<(Kind, String)> {
    let structures = shown_alone(scene).into_iter();
    let structures: Vec<&StructureInfo> = structures.filter_map(|(n, _)| scene.structures().get(n)).collect();
    let drawn: Vec<Kind> = kinds(Some(scene)).collect();
    let name = |kind: Kind| {
        let mut own = structures.iter().filter(|s| Kind::of(s) == kind).map(|s| s.name.read());
        let only = own
            .next()
            .filter(|name| own.next().is_none() && name.chars().count() <= LONGEST_NAME);
        (kind, only.unwrap_or_else(|| kind.name().to_owned()))
    };
    Kind::ALL
        .into_iter()
        .filter(|kind| drawn.contains(kind))
        .map(name)
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::theme::DARK;
    use bytemuck::Zeroable;
    use stylet_shm_schema::Text;

    /// Guards against "rectum" in the legend beside "rectal wall" in the table of doses.
    #[test]
    fn the_legend_has_the_names_of_the_structures() {
        let mut scene = SceneHeader::zeroed();
        let names = [
            ("gland", role::TARGET),
            ("rectal wall", role::SPARE),
            ("bowel", role::SPARE),
            ("penile bulb", role::SPARE),
        ];
        scene.structure_count = names.len() as u32;
        for (structure, (name, role)) in scene.structures.iter_mut().zip(names) {
            (structure.name, structure.role, structure.element_count) = (Text::new(name), role, 1);
        }
        let listed: Vec<String> = named(&scene).into_iter().map(|(_, name)| name).collect();
        assert_eq!(listed, ["gland", "rectal wall", "to be spared", "body"]);
    }

    /// Guards against urethra and rectum in one colour on the template, and in their own in the slices.
    #[test]
    fn a_structure_has_one_colour_in_slices_and_template() {
        for (name, kind) in [
            ("urethra", Kind::Urethra),
            ("rectal wall", Kind::Rectum),
            ("bladder wall", Kind::Bladder),
            ("bowel", Kind::Spared),
        ] {
            assert_eq!(Kind::of_spared(name), kind);
            assert_eq!(kind.panel_color(&DARK), kind.image_color());
        }
    }
}
