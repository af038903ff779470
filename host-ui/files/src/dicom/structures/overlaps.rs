//! Contours of one plane against each other: a copy counts once, and contours that overlap in part
//! are one body.

use super::planes::{Polygon, area, by_height, height_m, in_mm};
use super::{Contoured, SAME_PLANE_M};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay;
use nalgebra::{Matrix3, Vector3};

/// Mean distance below which two outlines are one that was drawn, or resampled, twice.
const COPY_M: f64 = 0.05e-3;
/// Largest difference of a copy, as a share of its area: small outlines may lie close together.
const COPY_SHARE: f64 = 0.1;
/// Mean distance below which outlines touch and do not overlap.
const TOUCHING_M: f64 = 0.01e-3;
/// Mean thickness below which a wall between two outlines is reported.
const THIN_M: f64 = 0.5e-3;
/// Shares by which an inner contour that reaches out of the outer one is still a hole: of its area
/// inside, and of the outer area.
const HOLE_INSIDE: f64 = 0.9;
const HOLE_OF_OUTER: f64 = 0.8;
/// Most contours of a plane that are compared.
const MOST: usize = 64;

/// Height of a plane, m, and an area in it, m², or a length, m.
type At = (f64, f64);

/// Findings in all planes of a structure.
#[derive(Default)]
pub struct Overlaps {
    /// Heights of removed copies.
    pub copies_m: Vec<f64>,
    united: Vec<At>,
    holes_beyond: Vec<At>,
    thin: Vec<At>,
    unchecked_m: Vec<f64>,
}

/// Removes copies and unites contours that overlap in part, unless the file says that overlaps
/// are holes.
pub fn settle(structure: &mut Contoured, axes: &Matrix3<f64>, is_exclusive: bool) -> Overlaps {
    let contours = std::mem::take(&mut structure.contours).into_iter();
    let contours = contours.map(|corners| (height_m(&corners, axes), corners)).collect();
    let mut found = Overlaps::default();
    for (height_m, of_plane) in by_height(contours, SAME_PLANE_M) {
        if (2..=MOST).contains(&of_plane.len()) {
            let mut plane = Plane::of(height_m, of_plane, axes);
            plane.settle(is_exclusive, &mut found);
            structure.contours.extend(plane.contours.into_iter().map(|c| c.corners));
            continue;
        }
        if of_plane.len() > MOST {
            found.unchecked_m.push(height_m);
        }
        structure.contours.extend(of_plane);
    }
    found
}

impl Overlaps {
    /// Returns remarks; `usual_m` is the distance between planes.
    pub fn notes(&self, name: &str, usual_m: f64) -> Vec<String> {
        let planes = |at: &[At]| format!("planes at {} mm", in_mm(at.iter().map(|(m, _)| *m)));
        let cc = |at: &[At]| at.iter().map(|(_, m2)| m2 * usual_m * 1e6).sum::<f64>();
        let mut notes = Vec::new();
        if !self.united.is_empty() {
            notes.push(format!(
                "{name}: contours of one plane overlap in part; they are taken as one body, and the overlap of {:.2} cc counts once ({})",
                cc(&self.united),
                planes(&self.united)
            ));
        }
        if !self.holes_beyond.is_empty() {
            notes.push(format!(
                "{name}: a contour reaches in part out of the one around it; it is taken as a hole of {:.2} cc ({})",
                cc(&self.holes_beyond),
                planes(&self.holes_beyond)
            ));
        }
        if let Some((_, least_m)) = self.thin.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            notes.push(format!(
                "{name}: two contours, one in the other, leave a wall of only {:.2} mm ({}); is one of them a second outline of the same body?",
                least_m * 1e3,
                planes(&self.thin)
            ));
        }
        if !self.unchecked_m.is_empty() {
            notes.push(format!(
                "{name}: planes at {} mm have more than {MOST} contours, whose overlaps are holes",
                in_mm(self.unchecked_m.iter().copied())
            ));
        }
        notes
    }
}

struct Flat {
    polygon: Polygon,
    corners: Vec<Vector3<f64>>,
    area_m2: f64,
    around_m: f64,
}

struct Plane<'a> {
    height_m: f64,
    axes: &'a Matrix3<f64>,
    contours: Vec<Flat>,
}

/// Relation of two contours of one plane.
enum Pair {
    /// Apart, or one in the other, with the thickness of the wall between them.
    Apart,
    Nested(f64),
    Copy,
    /// Overlap in part, with the common area.
    Partial(f64),
    /// A hole that reaches out of the outer contour, with the common area.
    HoleBeyond(f64),
}

impl<'a> Plane<'a> {
    fn of(height_m: f64, contours: Vec<Vec<Vector3<f64>>>, axes: &'a Matrix3<f64>) -> Self {
        let flat = |corners: Vec<Vector3<f64>>| {
            let in_plane = corners.iter().map(|p| axes.tr_mul(p));
            Flat::of(in_plane.map(|p| [p.x, p.y]).collect(), corners)
        };
        Self {
            height_m,
            axes,
            contours: contours.into_iter().map(flat).collect(),
        }
    }

    fn settle(&mut self, is_exclusive: bool, found: &mut Overlaps) {
        // Each union removes at least one pair; beyond a bound, nothing more is united.
        for _ in 0..MOST * MOST {
            let Some((a, b, pair)) = self.next_pair(is_exclusive) else {
                break;
            };
            let second = self.contours.remove(b);
            if let Pair::Partial(m2) = pair {
                let first = self.contours.remove(a);
                found.united.push((self.height_m, m2));
                let united = first
                    .polygon
                    .overlay(&second.polygon, OverlayRule::Union, FillRule::EvenOdd);
                for polygon in united.into_iter().flatten() {
                    let corner = |p: &[f64; 2]| self.axes * Vector3::new(p[0], p[1], self.height_m);
                    let corners = polygon.iter().map(corner).collect();
                    self.contours.push(Flat::of(polygon, corners));
                }
            } else {
                found.copies_m.push(self.height_m);
            }
        }
        for b in 1..self.contours.len() {
            for a in 0..b {
                match self.contours[a].beside(&self.contours[b]) {
                    Pair::Nested(wall_m) if wall_m < THIN_M => found.thin.push((self.height_m, wall_m)),
                    Pair::HoleBeyond(m2) => found.holes_beyond.push((self.height_m, m2)),
                    _ => {}
                }
            }
        }
    }

    /// Returns the first two contours that are copies or overlap in part; copies come first.
    fn next_pair(&self, is_exclusive: bool) -> Option<(usize, usize, Pair)> {
        let mut partial = None;
        for b in 1..self.contours.len() {
            for a in 0..b {
                match self.contours[a].beside(&self.contours[b]) {
                    Pair::Copy => return Some((a, b, Pair::Copy)),
                    pair @ Pair::Partial(_) if !is_exclusive => {
                        partial.get_or_insert((a, b, pair));
                    }
                    _ => {}
                }
            }
        }
        partial
    }
}

impl Flat {
    fn of(polygon: Polygon, corners: Vec<Vector3<f64>>) -> Self {
        let next = polygon.iter().cycle().skip(1);
        let around_m = polygon
            .iter()
            .zip(next)
            .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
            .sum();
        Self {
            area_m2: area_m2(&polygon, &Vec::new(), OverlayRule::Subject),
            polygon,
            corners,
            around_m,
        }
    }

    fn beside(&self, other: &Self) -> Pair {
        if !self.may_touch(other) {
            return Pair::Apart;
        }
        let both_m2 = area_m2(&self.polygon, &other.polygon, OverlayRule::Intersect);
        let [own_m2, others_m2] = [self, other].map(|c| (c.area_m2 - both_m2).max(0.0));
        let mean_around_m = (self.around_m + other.around_m) / 2.0;
        let (smaller, larger) = if self.area_m2 <= other.area_m2 {
            (self, other)
        } else {
            (other, self)
        };
        let apart_m2 = own_m2 + others_m2;
        if apart_m2 <= (COPY_M * mean_around_m).min(COPY_SHARE * larger.area_m2) {
            return Pair::Copy;
        }
        let touching_m2 = TOUCHING_M * smaller.around_m;
        if both_m2 <= touching_m2.min(COPY_SHARE * smaller.area_m2) {
            return Pair::Apart;
        }
        if own_m2.min(others_m2) <= touching_m2 {
            return Pair::Nested(apart_m2 / mean_around_m);
        }
        let is_hole = both_m2 > HOLE_INSIDE * smaller.area_m2 && smaller.area_m2 < HOLE_OF_OUTER * larger.area_m2;
        if is_hole {
            Pair::HoleBeyond(both_m2)
        } else {
            Pair::Partial(both_m2)
        }
    }

    /// Returns whether the boxes around both overlap.
    fn may_touch(&self, other: &Self) -> bool {
        let bounds = |of: &Self, a: usize| {
            let along = of.polygon.iter().map(|p| p[a]);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                [low.min(v), high.max(v)]
            })
        };
        (0..2).all(|a| {
            let ([low, high], [from, to]) = (bounds(self, a), bounds(other, a));
            low <= to && from <= high
        })
    }
}

/// Returns the area of a combination of two polygons.
fn area_m2(one: &Polygon, other: &Polygon, rule: OverlayRule) -> f64 {
    let shapes = one.overlay(other, rule, FillRule::EvenOdd);
    // The first contour of a shape is its outline; the others are holes.
    let of_shape = |shape: &Vec<Polygon>| {
        let areas: Vec<f64> = shape.iter().map(|polygon| area(polygon)).collect();
        areas
            .first()
            .map_or(0.0, |first| 2.0 * first - areas.iter().sum::<f64>())
    };
    shapes.iter().map(of_shape).sum()
}
