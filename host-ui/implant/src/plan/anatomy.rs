//! The anatomy for a plan: the target and the structures to be spared, as closed surfaces of the
//! scene at rest.

use super::PlanError;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stylet_anatomy::{Organ, PatientFrame};
use stylet_dose::Structure;
use stylet_dose::mesh::Mesh;
use stylet_dose::structure::Region;
use stylet_host::link::SceneModel;
use stylet_shm_schema::{StructureInfo, role};
use stylet_surfaces::bodies::{Bodies, Follows, shown_alone};

/// Step of the search along a needle's path.
const STEP_M: f64 = 0.5e-3;

/// Pitch of the points in which the dose of every plan and every implant is counted.
pub const DOSE_PITCH_M: f64 = 1e-3;

/// Small offset at which a place is tested. Lines of a template run along the planes on which
/// corners of a mesh lie, where inside and outside are ambiguous.
const EDGE_REACH_M: [f64; 3] = [0.0, 1.37e-8, 2.71e-8];

/// Closed structure.
pub struct Body {
    /// Name as the scene gives it.
    pub name: String,
    mesh: Mesh,
    /// Corners of the closed surface that decides what is inside.
    corners_m: Vec<[f64; 3]>,
    faces: Vec<[usize; 3]>,
    /// Points of the drawn surface.
    points_m: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Body {
    /// Creates a structure. The mesh must be closed.
    pub fn new(name: &str, points_m: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<Self, PlanError> {
        Ok(Self {
            name: name.to_owned(),
            mesh: Mesh::new(points_m, triangles).map_err(|why| PlanError::Surface {
                name: name.to_owned(),
                why,
            })?,
            corners_m: points_m.to_vec(),
            faces: triangles.to_vec(),
            points_m: points_m.iter().map(|p| p.map(|c| c as f32)).collect(),
            triangles: triangles.iter().map(|t| t.map(|i| i as u32)).collect(),
        })
    }

    /// Returns the same structure, drawn by this part of the scene's surfaces if they follow the
    /// segmentation.
    fn drawn_as(mut self, bodies: &Bodies, part: Option<usize>) -> Self {
        let triangles = part.and_then(|n| bodies.triangles.get(bodies.parts.get(n)?.clone()));
        let triangles = triangles
            .filter(|_| bodies.follows == Follows::Segmentation)
            .unwrap_or(&[]);
        let vertices = || triangles.iter().flatten().copied();
        // The vertices of a part are contiguous.
        if let (Some(first), Some(last)) = (vertices().min(), vertices().max()) {
            self.points_m = bodies.rest_m[first as usize..=last as usize].to_vec();
            self.triangles = triangles.iter().map(|t| t.map(|v| v - first)).collect();
        }
        self
    }

    /// Returns the same structure with each of its corners moved, for example by its tissue; drawn
    /// by its closed surface.
    pub fn moved(&self, to_m: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Self, PlanError> {
        let moved: Vec<[f64; 3]> = self.corners_m.iter().map(|corner| to_m(*corner)).collect();
        Self::new(&self.name, &moved, &self.faces)
    }

    /// Returns corners and triangles of the closed surface that decides what is inside, m.
    pub fn closed_surface(&self) -> (&[[f64; 3]], &[[usize; 3]]) {
        (&self.corners_m, &self.faces)
    }

    /// Returns the drawn surface.
    pub fn surface(&self) -> (&[[f32; 3]], &[[u32; 3]]) {
        (&self.points_m, &self.triangles)
    }

    /// Returns whether a point, scene frame, m, lies inside.
    pub fn contains(&self, point_m: [f64; 3]) -> bool {
        self.mesh.contains([0, 1, 2].map(|a| point_m[a] + EDGE_REACH_M[a]))
    }

    /// Returns the bounding box: smallest and largest corner, m.
    pub fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        self.mesh.bounds_m()
    }

    /// Returns points for dose, one a cell.
    pub fn structure(&self, pitch_m: f64) -> Structure {
        Structure::of_region(&self.name, &self.mesh, pitch_m)
    }

    /// Returns the pieces of a line inside, as distances from its start; to half a step.
    pub fn pieces_m(&self, from_m: [f64; 3], direction: [f64; 3], length_m: f64) -> Vec<[f64; 2]> {
        let mut pieces: Vec<[f64; 2]> = Vec::new();
        let mut was_inside = false;
        for step in 0..=(length_m / STEP_M).max(0.0) as usize {
            let along_m = step as f64 * STEP_M;
            let inside = self.contains([0, 1, 2].map(|a| from_m[a] + direction[a] * along_m));
            match pieces.last_mut() {
                Some(piece) if inside && was_inside => piece[1] = along_m,
                _ if inside => pieces.push([along_m, along_m]),
                _ => {}
            }
            was_inside = inside;
        }
        pieces
    }

    /// Returns the pieces of the whole line from a place outside.
    pub fn all_pieces_m(&self, from_m: [f64; 3], direction: [f64; 3]) -> Vec<[f64; 2]> {
        let ((low, high), from) = (self.bounds_m(), Vector3::from(from_m));
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        self.pieces_m(from_m, direction, (high - low).norm() + (low - from).norm())
    }

    /// Returns whether a point or one of eight around it, across `direction`, lies inside.
    pub fn is_near(&self, point_m: [f64; 3], direction: [f64; 3], within_m: f64) -> bool {
        let direction = Vector3::from(direction);
        let helper = if direction.x.abs() < 0.7 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let across = direction.cross(&helper).normalize();
        let other = direction.cross(&across);
        let around = (0..8).map(|i| {
            let (sine, cosine) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
            (Vector3::from(point_m) + (across * cosine + other * sine) * within_m).into()
        });
        self.contains(point_m) || (within_m > 0.0 && around.into_iter().any(|p| self.contains(p)))
    }
}

/// Target, spared structures, and the box of all tissue.
pub struct Anatomy {
    /// Structure in which seeds are planned.
    pub target: Body,
    /// Structures to be spared by needles and dose.
    pub spared: Vec<Body>,
    /// Structures that no needle crosses: the pubic arch.
    pub bone: Vec<Body>,
    /// Smallest corner of the box of all tissue, m.
    pub lower_m: [f64; 3],
    /// Largest corner of that box, m.
    pub upper_m: [f64; 3],
    /// Place of the patient in the scene.
    pub patient: PatientFrame,
}

impl Anatomy {
    /// Creates the anatomy from the core's data; returns an error if the scene has no closed
    /// target.
    pub fn of(scene: &SceneModel) -> Result<Self, PlanError> {
        let header = &scene.header;
        let alone = shown_alone(header);
        let part = |s: &StructureInfo| {
            let first = s.first_triangle as usize;
            let triangles = &scene.triangles[first..first + s.triangle_count as usize];
            let is_it = |(n, _): &(usize, Vec<bool>)| std::ptr::eq(&header.structures()[*n], s);
            // The first surface is that of the whole body.
            let number = alone.iter().position(is_it).map(|n| n + 1);
            Ok(body(scene, &s.name.read(), triangles)?.drawn_as(scene.bodies(), number))
        };
        let drawn = |s: &&StructureInfo| s.triangle_count > 0;
        let structures = || header.structures().iter().filter(drawn);
        let target = match structures().find(|s| s.role & role::TARGET != 0) {
            Some(target) => part(target),
            // A body of one structure is the target as a whole.
            None => {
                let name = header.structures().first().map_or_else(String::new, |s| s.name.read());
                body(scene, &name, &scene.triangles[..header.body_triangle_count as usize])
                    .map(|body| body.drawn_as(scene.bodies(), Some(0)))
            }
        };
        let spared = structures().filter(|s| s.role & role::SPARE != 0).map(part);
        let is_bone = |s: &&StructureInfo| Organ::of_name(&s.name.read()) == Some(Organ::Bone);
        let bone = structures().filter(is_bone).map(part);
        Ok(Self {
            target: target?,
            spared: spared.collect::<Result<_, _>>()?,
            bone: bone.collect::<Result<_, _>>()?,
            lower_m: header.lower_m,
            upper_m: header.upper_m,
            patient: header.patient(),
        })
    }

    /// Returns the anatomy of a moment: this target, and everything else moved with the tissue.
    pub fn seen_as(&self, target: Body, to_m: &dyn Fn([f64; 3]) -> [f64; 3]) -> Result<Self, PlanError> {
        let moved = |bodies: &[Body]| bodies.iter().map(|body| body.moved(to_m)).collect::<Result<_, _>>();
        Ok(Self {
            target,
            spared: moved(&self.spared)?,
            bone: moved(&self.bone)?,
            ..*self
        })
    }

    /// Returns the structures in which dose is counted, at [`DOSE_PITCH_M`], the target first.
    pub fn structures(&self) -> Vec<Structure> {
        let bodies = std::iter::once(&self.target).chain(&self.spared);
        bodies.map(|b| b.structure(DOSE_PITCH_M)).collect()
    }

    /// Returns the first spared structure that the needle enters within `margin_m` on its way to
    /// `depth_m`.
    pub fn spared_in_the_way(
        &self,
        entry_m: [f64; 3],
        direction: [f64; 3],
        depth_m: f64,
        margin_m: f64,
    ) -> Option<&Body> {
        let steps = (depth_m / STEP_M).max(0.0) as usize;
        self.spared.iter().find(|body| {
            (0..=steps).any(|step| {
                let along_m = step as f64 * STEP_M;
                body.is_near(
                    [0, 1, 2].map(|a| entry_m[a] + direction[a] * along_m),
                    direction,
                    margin_m,
                )
            })
        })
    }
}

/// Returns the body inside a surface of the core, which goes through the centres of the outermost
/// elements: the body ends half an element further out.
fn body(scene: &SceneModel, name: &str, triangles: &[[u32; 3]]) -> Result<Body, PlanError> {
    let mut numbers = BTreeMap::new();
    let mut points_m: Vec<Vector3<f64>> = Vec::new();
    let mut normals: Vec<Vector3<f64>> = Vec::new();
    let mut corners = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let t = triangle.map(|vertex| {
            *numbers.entry(vertex).or_insert_with(|| {
                points_m.push(Vector3::from(scene.rest_m[vertex as usize].map(f64::from)));
                normals.push(Vector3::zeros());
                points_m.len() - 1
            })
        });
        let [a, b, c] = t.map(|i| points_m[i]);
        let area = (b - a).cross(&(c - a));
        t.iter().for_each(|&i| normals[i] += area);
        corners.push(t);
    }
    let half_m = scene.header.spacing_m / 2.0;
    let out = |(p, n): (&Vector3<f64>, &Vector3<f64>)| (p + n.try_normalize(1e-30).unwrap_or_default() * half_m).into();
    let moved: Vec<[f64; 3]> = points_m.iter().zip(&normals).map(out).collect();
    Body::new(name, &moved, &corners)
}

/// Creates a ball of triangles, for tests and for scenes without files.
pub fn ball(name: &str, middle_m: [f64; 3], half_m: [f64; 3]) -> Body {
    const ROWS: usize = 24;
    const COLUMNS: usize = 48;
    let mut points_m = vec![[0, 1, 2].map(|a| middle_m[a] - if a == 2 { half_m[a] } else { 0.0 })];
    for row in 1..ROWS {
        let (across, along) = (row as f64 / ROWS as f64 * std::f64::consts::PI).sin_cos();
        for column in 0..COLUMNS {
            let (sine, cosine) = (column as f64 / COLUMNS as f64 * std::f64::consts::TAU).sin_cos();
            let unit = [across * cosine, across * sine, -along];
            points_m.push([0, 1, 2].map(|a| middle_m[a] + half_m[a] * unit[a]));
        }
    }
    points_m.push([0, 1, 2].map(|a| middle_m[a] + if a == 2 { half_m[a] } else { 0.0 }));
    let last = points_m.len() - 1;
    let at = |row: usize, column: usize| match row {
        0 => 0,
        ROWS => last,
        _ => 1 + (row - 1) * COLUMNS + column % COLUMNS,
    };
    let mut triangles = Vec::new();
    for (row, column) in (0..ROWS).flat_map(|r| (0..COLUMNS).map(move |c| (r, c))) {
        let [a, b, c, d] = [
            at(row, column),
            at(row, column + 1),
            at(row + 1, column + 1),
            at(row + 1, column),
        ];
        if row > 0 {
            triangles.push([a, b, c]);
        }
        if row + 1 < ROWS {
            triangles.push([a, c, d]);
        }
    }
    let body = Body::new(name, &points_m, &triangles);
    body.unwrap_or_else(|why| unreachable!("the grid of a ball is closed: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_has_its_volume_and_chord() {
        let ball = ball("gland", [0.05, 0.04, 0.03], [0.02, 0.015, 0.01]);
        let volume: f64 = ball.structure(1e-3).volumes_m3.iter().sum();
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.02 * 0.015 * 0.01;
        assert!((volume / exact - 1.0).abs() < 0.01, "{volume} {exact}");
        let pieces = ball.pieces_m([0.05, 0.04, 0.0], [0.0, 0.0, 1.0], 0.1);
        assert_eq!(pieces.len(), 1);
        assert!((pieces[0][0] - 0.02).abs() < 1e-3 && (pieces[0][1] - 0.04).abs() < 1e-3);
        assert!(ball.is_near([0.0305, 0.04, 0.03], [0.0, 0.0, 1.0], 0.0));
        assert!(!ball.is_near([0.0285, 0.04, 0.03], [0.0, 0.0, 1.0], 1e-3));
        assert!(ball.is_near([0.0285, 0.04, 0.03], [0.0, 0.0, 1.0], 2e-3));
    }
}
