//! The wall that the probe can press: the inside of the rectum, in pads that load the body and points at which it
//! touches the probe.

use super::shape::{ProbePose, ProbeShape};
use crate::scene::{Lattice, Scene};
use crate::tissue::fem::batch::BatchModel;
use stylet_anatomy::{Beyond, Organ};

/// Radius for smoothing, m: faces of cells are staircases, so each is moved to the mean of those near it that face the
/// same way.
const SMOOTHED_M: f64 = 2.5e-3;
/// Length of the canal through which the probe comes in: closed in a scene, but wide enough in the patient, so that the
/// wall this close to that end resists nothing.
const CANAL_M: f64 = 12e-3;
/// Reach of the probe beyond the target at either end, m.
const BEYOND_TARGET_M: f64 = 20e-3;

/// Distance between pads in a run.
pub const PADS_APART_M: f64 = 5e-3;
/// Points, at most: between two of them a flat wall is in a shaft of 10 mm by 0.07 mm.
const POINTS_APART_M: f64 = 2.3e-3;
/// Radius around a point, of whose faces it is the mean; those close to it count more than the others.
const AROUND_M: f64 = 5.5e-3;

/// Why a scene has no wall for the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoWall {
    /// No structure is the rectum's wall, or nothing in it is free.
    #[error("no rectum for a probe: the scene needs a structure \"rectal wall\" around a hollow that is \"free\"")]
    NoRectum,
    /// Wall of which nothing is next to the target.
    #[error("the rectum of the scene is not beside the target: a probe in it would reach nothing")]
    OutOfReach,
    /// The tissue model knows no forces.
    #[error("this tissue answers no force: choose chainmail or fem (--tissue)")]
    NoForces,
    /// A pad that no part of the body is at.
    #[error("a part of the rectum's wall is in no element of the body")]
    NotInBody,
    /// Work that is no longer wanted.
    #[error("the probe was given up before it was ready")]
    Stopped,
}

/// A piece of the wall that is pressed as one.
#[derive(Clone, Debug)]
pub struct Pad {
    /// Its middle at rest, scene frame, m.
    pub place_m: [f64; 3],
    /// Unit vector out of the tissue.
    pub outward: [f64; 3],
    /// Area, m².
    pub area_m2: f64,
    /// Faces of cells in it.
    pub faces: Vec<Face>,
}

/// One face of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Its middle at rest on the smooth wall, scene frame, m.
    pub place_m: [f64; 3],
    /// A point in the tissue behind it, scene frame, m.
    pub inside_m: [f64; 3],
    outward: [f64; 3],
    /// Edge of its cell, m, and along which axis the cell ends in it.
    edge_m: f64,
    axis: usize,
}

/// A place of the smooth wall: the mean of faces around it at rest, and however they move.
#[derive(Clone, Debug)]
pub struct Point {
    /// Place at rest, scene frame, m.
    pub place_m: [f64; 3],
    /// Unit vector out of the tissue.
    pub outward: [f64; 3],
    /// Faces around it with their shares, which add up to 1.
    faces: Vec<(Face, f64)>,
}

/// All pads and points, in order.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Pads that load the body, as far apart as was asked for.
    pub pads: Vec<Pad>,
    /// Points where it touches the probe.
    pub points: Vec<Point>,
    /// The points load the body themselves: four times as many columns, and nothing between force and body.
    pub is_loaded_at_points: bool,
}

impl Wall {
    /// Pads about `spacing_m` apart on the inside of the scene's rectum.
    pub fn of(scene: &Scene, spacing_m: f64) -> Result<Self, NoWall> {
        let all = faces(scene);
        if all.is_empty() {
            return Err(NoWall::NoRectum);
        }
        let (low, high) = scene.target_bounds_m();
        // A hollow that continues to the end of the volume has no end there.
        let faces_inwards = |f: &&Face| f.outward[2] > 0.5;
        let end_m = all.iter().filter(faces_inwards).map(|f| f.place_m[2]);
        let open_m = end_m.fold(f64::INFINITY, f64::min) + CANAL_M;
        let is_beside = |f: &Face| {
            let z = f.place_m[2];
            z >= low[2] - BEYOND_TARGET_M && z <= high[2] + BEYOND_TARGET_M && !(z < open_m && open_m.is_finite())
        };
        let within: Vec<Face> = smoothed(&all).into_iter().filter(is_beside).collect();
        // Straight faces of a staircase say little of how the wall runs; their mean does.
        let middles = spread(&within, spacing_m);
        let mut pads: Vec<Vec<Face>> = vec![Vec::new(); middles.len()];
        for face in &within {
            let nearest = |a: &usize, b: &usize| {
                let of = |n: usize| separation(face, &within[middles[n]]);
                of(*a).total_cmp(&of(*b))
            };
            if let Some(at) = (0..middles.len()).min_by(nearest) {
                pads[at].push(*face);
            }
        }
        let face_m2 = scene.lattice.spacing_m.powi(2);
        let pads: Vec<Pad> = pads.into_iter().filter_map(|faces| pad(faces, face_m2)).collect();
        if pads.is_empty() {
            return Err(NoWall::OutOfReach);
        }
        let points = spread(&within, POINTS_APART_M);
        let points = points.into_iter().filter_map(|n| point(&within[n], &all));
        Ok(Wall {
            pads,
            points: points.collect(),
            is_loaded_at_points: false,
        })
    }

    /// Returns the same wall, loaded at its points.
    pub fn loaded_at_points(self) -> Self {
        Wall {
            is_loaded_at_points: true,
            ..self
        }
    }

    /// Returns the number of pads.
    pub fn loads(&self) -> usize {
        if self.is_loaded_at_points {
            self.points.len()
        } else {
            self.pads.len()
        }
    }

    /// Returns the nodes and weights of each; `None` where the body has no element there.
    pub(super) fn load_weights(&self, body: &BatchModel<f32>) -> Option<Vec<Vec<(u32, f64)>>> {
        if self.is_loaded_at_points {
            return self.points.iter().map(|point| point.weights(body)).collect();
        }
        self.pads.iter().map(|pad| pad.weights(body)).collect()
    }

    /// Returns the element behind the middle of each.
    pub(super) fn elements_behind(&self, lattice: &Lattice) -> Vec<u32> {
        let behind = |place_m: [f64; 3], faces: &mut dyn Iterator<Item = &Face>| {
            let nearest = |f: &&Face| square_m2(f.place_m, place_m);
            let face = faces.min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
            face.and_then(|f| lattice.element_at_rest(f.inside_m)).unwrap_or(0)
        };
        if self.is_loaded_at_points {
            let of = |point: &Point| behind(point.place_m, &mut point.faces.iter().map(|(face, _)| face));
            return self.points.iter().map(of).collect();
        }
        let of = |pad: &Pad| behind(pad.place_m, &mut pad.faces.iter());
        self.pads.iter().map(of).collect()
    }

    /// Returns the smooth wall at each of its faces, for a measurement.
    #[cfg(test)]
    pub fn finely(&self, scene: &Scene) -> Vec<Point> {
        let (all, own) = (faces(scene), self.pads.iter().flat_map(|pad| &pad.faces));
        own.filter_map(|face| point(face, &all)).collect()
    }

    /// Returns the pose of a probe along z below the middle of the target, whose shaft is so far above where it first
    /// meets the wall towards the target, and whose tip is so far beyond the target's middle, m.
    pub fn pose_below_target(&self, scene: &Scene, shape: &ProbeShape, pressed_m: f64, beyond_m: f64) -> ProbePose {
        let towards_target = self.pads.iter().filter(|pad| pad.outward[1] < -0.5);
        let lowest_m = towards_target.map(|pad| pad.place_m[1]).fold(f64::INFINITY, f64::min);
        let (low, high) = scene.target_bounds_m();
        let middle = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
        ProbePose {
            tip_m: [middle[0], lowest_m - shape.radius_m + pressed_m, middle[2] + beyond_m],
            axis: [0.0, 0.0, 1.0],
        }
    }
}

impl Pad {
    /// Returns the nodes and weights, which add up to 1, of the mean over its faces; `None` where the body has no
    /// element there.
    pub fn weights(&self, body: &BatchModel<f32>) -> Option<Vec<(u32, f64)>> {
        let share = 1.0 / self.faces.len() as f64;
        mean_weights(body, self.faces.iter().map(|face| (face, share)))
    }
}

impl Point {
    /// Returns the nodes and weights as of a [`Pad`].
    pub fn weights(&self, body: &BatchModel<f32>) -> Option<Vec<(u32, f64)>> {
        mean_weights(body, self.faces.iter().map(|(face, share)| (face, *share)))
    }
}

fn mean_weights<'a>(body: &BatchModel<f32>, faces: impl Iterator<Item = (&'a Face, f64)>) -> Option<Vec<(u32, f64)>> {
    let mut all = Vec::new();
    for (face, share) in faces {
        let count = face.inside_of(body.spacing_m()).count() as f64;
        for at in face.inside_of(body.spacing_m()) {
            let nodes = body.trilinear(at)?;
            all.extend(nodes.map(|(node, weight)| (node, share / count * weight)));
        }
    }
    all.sort_by_key(|(node, _)| *node);
    let mut merged: Vec<(u32, f64)> = Vec::new();
    for (node, part) in all {
        match merged.last_mut() {
            Some((last, sum)) if *last == node => *sum += part,
            _ => merged.push((node, part)),
        }
    }
    Some(merged)
}

/// Faces of the rectum's wall with nothing beyond them.
fn faces(scene: &Scene) -> Vec<Face> {
    let lattice = &scene.lattice;
    let is_wall: Vec<bool> = scene
        .structures
        .iter()
        .map(|s| matches!(Organ::of_name(&s.name), Some(Organ::RectalWall | Organ::Rectum)))
        .collect();
    let mut found = Vec::new();
    for element in 0..lattice.element_count() as u32 {
        let structure = usize::from(lattice.structure(element));
        if !is_wall.get(structure).copied().unwrap_or(false) {
            continue;
        }
        let beyond = scene.structures[structure].material.surroundings.0;
        for (side, neighbour) in lattice.neighbours(element).into_iter().enumerate() {
            if neighbour.is_none() && beyond[side] == Beyond::Free && !at_edge(lattice, element, side) {
                found.push(face(lattice, element, side));
            }
        }
    }
    found
}

/// Faces at the edge of the volume are where the scene ends.
fn at_edge(lattice: &Lattice, element: u32, side: usize) -> bool {
    let at = lattice.cell(element)[side / 2];
    if side.is_multiple_of(2) {
        at == 0
    } else {
        at + 1 == lattice.dims[side / 2]
    }
}

fn face(lattice: &Lattice, element: u32, side: usize) -> Face {
    let sign = if side.is_multiple_of(2) { -1.0 } else { 1.0 };
    let centre_m = lattice.rest_m(element);
    let along = |part: f64| {
        let mut place_m = centre_m;
        place_m[side / 2] += sign * part * lattice.spacing_m;
        place_m
    };
    let mut outward = [0.0; 3];
    outward[side / 2] = sign;
    Face {
        place_m: along(0.5),
        inside_m: along(0.49),
        outward,
        edge_m: lattice.spacing_m,
        axis: side / 2,
    }
}

impl Face {
    /// Its middle; in a body of smaller elements the middle of each of their faces in it, or a load would sink in as a
    /// point does.
    fn inside_of(&self, elements_m: f64) -> impl Iterator<Item = [f64; 3]> {
        let times = (self.edge_m / elements_m).round().max(1.0) as usize;
        let (middle_m, axis, edge_m) = (self.inside_m, self.axis, self.edge_m);
        (0..times * times).map(move |n| {
            let parts = [n % times, n / times].map(|n| (n as f64 + 0.5) / times as f64 - 0.5);
            let mut at = middle_m;
            at[(axis + 1) % 3] += parts[0] * edge_m;
            at[(axis + 2) % 3] += parts[1] * edge_m;
            at
        })
    }
}

/// Returns whether two faces are on one wall: faces that look away from each other are on two, however close.
fn faces_alike(a: &Face, b: &Face) -> bool {
    (0..3).map(|c| a.outward[c] * b.outward[c]).sum::<f64>() > -0.3
}

fn square_m2(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

fn separation(a: &Face, b: &Face) -> f64 {
    if faces_alike(a, b) {
        square_m2(a.place_m, b.place_m)
    } else {
        f64::INFINITY
    }
}

fn smoothed(faces: &[Face]) -> Vec<Face> {
    let smooth = |face: &Face| {
        let (mut place, mut outward, mut count) = ([0.0; 3], [0.0; 3], 0.0);
        for other in faces {
            if separation(face, other) <= SMOOTHED_M * SMOOTHED_M {
                for c in 0..3 {
                    place[c] += other.place_m[c];
                    outward[c] += other.outward[c];
                }
                count += 1.0;
            }
        }
        Face {
            place_m: place.map(|c| c / count),
            outward: unit(outward).unwrap_or(face.outward),
            ..*face
        }
    };
    faces.iter().map(smooth).collect()
}

/// Faces from each of which the next is as far from all before as it can be, until none is farther than the spacing.
fn spread(faces: &[Face], spacing_m: f64) -> Vec<usize> {
    let mut chosen = Vec::new();
    let mut nearest_m2 = vec![f64::INFINITY; faces.len()];
    let mut next = (!faces.is_empty()).then_some(0);
    while let Some(at) = next {
        chosen.push(at);
        for (slot, face) in nearest_m2.iter_mut().zip(faces) {
            *slot = slot.min(separation(face, &faces[at]));
        }
        let farthest = (0..faces.len()).max_by(|&a, &b| nearest_m2[a].total_cmp(&nearest_m2[b]));
        next = farthest.filter(|&n| nearest_m2[n] > spacing_m * spacing_m);
    }
    chosen
}

fn pad(faces: Vec<Face>, face_m2: f64) -> Option<Pad> {
    let count = faces.len() as f64;
    let mean = |of: &dyn Fn(&Face) -> [f64; 3]| {
        let sum = faces
            .iter()
            .map(of)
            .fold([0.0; 3], |s, v| [0, 1, 2].map(|c| s[c] + v[c]));
        sum.map(|c| c / count)
    };
    let (place_m, normal) = (mean(&|f| f.place_m), mean(&|f| f.outward));
    Some(Pad {
        place_m,
        outward: unit(normal)?,
        area_m2: count * face_m2,
        faces,
    })
}

/// Returns the smooth wall at a face.
fn point(at: &Face, all: &[Face]) -> Option<Point> {
    let mut faces = Vec::new();
    let mut sum = 0.0;
    for face in all {
        let part = 1.0 - separation(at, face) / (AROUND_M * AROUND_M);
        if part > 0.0 {
            faces.push((*face, part * part));
            sum += part * part;
        }
    }
    faces.iter_mut().for_each(|(_, share)| *share /= sum);
    let mean = |of: fn(&Face) -> [f64; 3]| {
        faces.iter().fold([0.0; 3], |mean, (face, share)| {
            [0, 1, 2].map(|c| mean[c] + share * of(face)[c])
        })
    };
    Some(Point {
        place_m: mean(|f| f.place_m),
        outward: unit(mean(|f| f.outward))?,
        faces,
    })
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    nalgebra::Vector3::from(v).try_normalize(1e-9).map(Into::into)
}
