//! Outlines of the scene's anatomy behind the holes of a template, computed once per scene.

use super::Failure;
use nalgebra::Vector3;
use std::fmt;
use std::hash::{DefaultHasher, Hasher};
use stylet_anatomy::PatientFrame;
use stylet_host::link::SceneModel;
use stylet_implant::plan::anatomy::Body;
use stylet_implant::plan::{Anatomy, HOLES, Hole, Template};
use stylet_shm_schema::SceneId;
use stylet_surfaces::mesh::cut;

/// Distance between layers of outlines.
const LAYER_M: f64 = 1e-3;
/// Distance of seeds from the ends of the target.
const INSET_M: f64 = 2e-3;

/// Line in the template's plane, counted in holes from A1.
pub type Outline = Vec<[f32; 2]>;

/// Cut of the anatomy in a plane parallel to the template.
#[derive(Default)]
pub struct Layer {
    /// Outlines of the target.
    pub target: Vec<Outline>,
    /// Outlines of the spared structures, each with the structure's number in the anatomy.
    pub spared: Vec<(usize, Outline)>,
}

/// Anatomy of a scene, cut in layers parallel to a template.
pub struct AnatomyOutlines {
    /// The scene.
    pub scene: SceneId,
    /// The template.
    pub template: Template,
    /// Digest of labels and structures, the same in every run of the core.
    pub body: u64,
    /// Surfaces of target and spared structures.
    pub anatomy: Anatomy,
    /// Transform between scene and patient.
    pub frames: PatientFrame,
    /// Distances from the template's face to the near and the far end of the target, m.
    pub depths_m: [f64; 2],
    layers: Vec<Layer>,
    pieces_m: Vec<Result<[f64; 2], NoPiece>>,
}

/// Reason why a hole leads to no place for seeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoPiece {
    /// The needle goes past the target.
    Aside,
    /// The needle goes through this structure to be spared instead.
    Through(String),
}

impl fmt::Display for NoPiece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Aside => f.write_str("would miss the target"),
            Self::Through(name) => write!(f, "would go through {name}, which is to be spared"),
        }
    }
}

impl AnatomyOutlines {
    pub(super) fn of(scene: &SceneModel, template: Template) -> Result<Self, Failure> {
        let mut header = scene.header;
        (header.session_id, header.generation) = (0, 0);
        let mut body = DefaultHasher::new();
        body.write(bytemuck::bytes_of(&header));
        body.write(&scene.labels);
        let body = body.finish();
        Ok(Self {
            body,
            ..Self::on(Anatomy::of(scene)?, scene.header.id(), template)
        })
    }

    fn on(anatomy: Anatomy, scene: SceneId, template: Template) -> Self {
        let depths_m = ends_m(&template, &anatomy.target);
        let count = ((depths_m[1] - depths_m[0]) / LAYER_M).clamp(0.0, 500.0) as usize;
        let layer = |number: usize| {
            let depth_m = depths_m[0] + number as f64 * LAYER_M;
            Layer {
                target: outlines(&template, &anatomy.target, depth_m),
                spared: (anatomy.spared.iter().enumerate())
                    .flat_map(|(n, body)| {
                        let lines = outlines(&template, body, depth_m);
                        lines.into_iter().map(move |line| (n, line))
                    })
                    .collect(),
            }
        };
        let piece = |hole: Hole| {
            let pieces = anatomy
                .target
                .pieces_m(template.hole_m(hole), template.inwards, depths_m[1]);
            let longest = pieces
                .into_iter()
                .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
            let inside = longest.map(|[from, to]| [from + INSET_M, to - INSET_M]);
            inside.filter(|[from, to]| to > from).ok_or_else(|| {
                let in_the_way = anatomy.spared_in_the_way(template.hole_m(hole), template.inwards, depths_m[1], 0.0);
                in_the_way.map_or(NoPiece::Aside, |body| NoPiece::Through(body.name.clone()))
            })
        };
        Self {
            scene,
            template,
            body: 0,
            frames: anatomy.patient,
            layers: (0..=count).map(layer).collect(),
            pieces_m: Hole::all().map(piece).collect(),
            depths_m,
            anatomy,
        }
    }

    /// Returns the outlines nearest to a depth from the template's face.
    pub fn layer(&self, depth_m: f64) -> &Layer {
        let number = ((depth_m - self.depths_m[0]) / LAYER_M).round().max(0.0) as usize;
        &self.layers[number.min(self.layers.len() - 1)]
    }

    /// Returns the near and far depth of seeds in a needle through the hole, from the template's
    /// face, m, or why there is no place for them.
    pub fn piece_m(&self, hole: Hole) -> Result<[f64; 2], NoPiece> {
        let number = usize::from(hole.row()) * usize::from(HOLES) + usize::from(hole.column());
        self.pieces_m.get(number).cloned().unwrap_or(Err(NoPiece::Aside))
    }
}

/// Returns the nearest and the farthest corner of the body's box, as depths.
fn ends_m(template: &Template, body: &Body) -> [f64; 2] {
    let (low, high) = body.bounds_m();
    let depths = (0..8).map(|corner| {
        let at = [0, 1, 2].map(|a| if corner >> a & 1 == 0 { low[a] } else { high[a] });
        (Vector3::from(at) - Vector3::from(template.middle_m)).dot(&Vector3::from(template.inwards))
    });
    depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[near, far], d| {
        [near.min(d), far.max(d)]
    })
}

fn outlines(template: &Template, body: &Body, depth_m: f64) -> Vec<Outline> {
    let middle = Vector3::from(template.middle_m);
    let normal = Vector3::from(template.inwards);
    let (points_m, triangles) = body.surface();
    let offset_m = normal.dot(&middle) + depth_m;
    let sides = cut::Sides::of(points_m, template.inwards.map(|c| c as f32), offset_m as f32);
    let lines = cut::cut(points_m, triangles, &sides);
    let in_holes = |p: &[f32; 3]| {
        let off = Vector3::from(*p).map(f64::from) - middle;
        let count = |axis: [f64; 3]| off.dot(&Vector3::from(axis)) / template.pitch_m + f64::from(HOLES / 2);
        [count(template.columns) as f32, count(template.rows) as f32]
    };
    lines
        .into_iter()
        .map(|line| line.iter().map(in_holes).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_implant::plan::anatomy::ball;

    /// Half axes of the gland; its centre is behind G7, 70 mm from the template.
    const HALF_M: [f64; 3] = [0.024, 0.018, 0.02];

    fn outlines() -> AnatomyOutlines {
        let anatomy = Anatomy {
            target: ball("gland", [0.05, 0.05, 0.06], HALF_M),
            spared: vec![ball("urethra", [0.05, 0.05, 0.06], [0.003, 0.003, 0.03])],
            bone: Vec::new(),
            lower_m: [0.0; 3],
            upper_m: [0.1; 3],
            patient: PatientFrame::default(),
        };
        let template = Template {
            middle_m: [0.05, 0.05, -0.01],
            columns: [-1.0, 0.0, 0.0],
            rows: [0.0, 1.0, 0.0],
            inwards: [0.0, 0.0, 1.0],
            pitch_m: 5e-3,
        };
        AnatomyOutlines::on(anatomy, SceneId::default(), template)
    }

    #[test]
    fn outlines_are_the_ellipse_that_the_plane_cuts_in_holes() {
        let outlines = outlines();
        for depth_m in [0.055, 0.07, 0.08] {
            let layer = outlines.layer(depth_m);
            assert_eq!((layer.target.len(), layer.spared.len()), (1, 1));
            let off = (depth_m - 0.07) / HALF_M[2];
            let share = (1.0 - off * off).sqrt();
            for [column, row] in &layer.target[0] {
                let across = [*column, *row].map(|n| (f64::from(n) - 6.0) * 5e-3);
                let radius = (across[0] / HALF_M[0]).hypot(across[1] / HALF_M[1]);
                // 24 by 48 facets, and layers of a millimetre.
                assert!((radius - share).abs() < 0.04, "{radius} against {share} at {depth_m} m");
            }
        }
    }

    #[test]
    fn each_hole_maps_to_the_target_behind_it() {
        let outlines = outlines();
        let piece = |name: &str| outlines.piece_m(name.parse().expect("a hole"));
        for (name, across_m) in [("G7", 0.0), ("J7", 0.015), ("E7", 0.010)] {
            let half_m = HALF_M[2] * (1.0 - (across_m / HALF_M[0]).powi(2)).sqrt() - INSET_M;
            let [from, to] = piece(name).expect("it leads through");
            assert!((from - (0.07 - half_m)).abs() < 1e-3, "{name}: from {from}");
            assert!((to - (0.07 + half_m)).abs() < 1e-3, "{name}: to {to}");
        }
        assert_eq!(piece("A1"), Err(NoPiece::Aside));
    }

    /// Guards against "misses the target" for a needle through the urethra.
    #[test]
    fn a_hole_before_the_urethra_says_so() {
        let AnatomyOutlines { anatomy, template, .. } = outlines();
        let aside = Anatomy {
            target: ball("gland", [0.09, 0.05, 0.06], HALF_M),
            ..anatomy
        };
        let outlines = AnatomyOutlines::on(aside, SceneId::default(), template);
        let why = outlines.piece_m(Hole::middle()).expect_err("the urethra");
        assert_eq!(why.to_string(), "would go through urethra, which is to be spared");
    }
}
