//! A point of the tissue: the element it belongs to and where in that element; moves and turns with it.

use super::{Carried, Deformed};
use crate::scene::Lattice;
use serde::{Deserialize, Serialize};

/// `local` runs from -0.5 to 0.5 across an element, along the deformed links.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaterialPoint {
    /// Number of the element.
    pub element: u32,
    /// Place in it, in elements.
    pub local: [f32; 3],
}

/// Elements visited by one walk, at most.
const MAX_WALK: usize = 512;
/// Elements looked at to find a start for a walk without a hint, at most.
const MAX_STARTS: usize = 32_768;
/// Cells of a sheared lattice do not quite fill space: so far outside a cell still counts as in it, where
/// there is a neighbour on that side.
const GAP: f64 = 0.3;

impl MaterialPoint {
    /// Returns the material point at a place of the scene frame; `None` outside the tissue.
    ///
    /// Walks through the deformed lattice from `hint`, or else from the nearest of a bounded sample.
    pub fn locate(body: &Deformed, point_m: [f64; 3], hint: Option<u32>) -> Option<MaterialPoint> {
        let p = in_reach(body, point_m)?;
        let from_hint = hint.and_then(|element| Self::locate_from(body, point_m, element));
        from_hint.or_else(|| walk(body, p, nearest_sample(body, p)))
    }

    /// Returns the middle of an element.
    pub fn centre(element: u32) -> MaterialPoint {
        MaterialPoint {
            element,
            local: [0.0; 3],
        }
    }

    /// Returns the material point at a place of the scene frame while the body is at rest; `None` outside the tissue.
    pub fn at_rest(lattice: &Lattice, point_m: [f64; 3]) -> Option<MaterialPoint> {
        let p = point_m.map(|c| c / lattice.spacing_m);
        if !p.iter().all(|&c| c >= 0.0) {
            return None;
        }
        let element = lattice.element_of_cell(p[0] as usize, p[1] as usize, p[2] as usize)?;
        Some(MaterialPoint {
            element,
            local: p.map(|c| (c - c.floor() - 0.5) as f32),
        })
    }

    /// Its place while the body is at rest, m.
    pub fn rest_m(&self, lattice: &Lattice) -> [f64; 3] {
        let centre_m = lattice.rest_m(self.element);
        [0, 1, 2].map(|a| centre_m[a] + f64::from(self.local[a]) * lattice.spacing_m)
    }

    /// Returns it by a walk from `element` alone: as cheap where there is no tissue.
    pub fn locate_from(body: &Deformed, point_m: [f64; 3], element: u32) -> Option<MaterialPoint> {
        let p = in_reach(body, point_m)?;
        let is_known = (element as usize) < body.lattice.element_count();
        is_known.then(|| walk(body, p, element)).flatten()
    }

    /// Returns the present position of the point, in the scene frame.
    pub fn position_m(&self, body: &Deformed) -> [f64; 3] {
        match body.carried {
            Carried::Not => self.position_by(body, |element| body.not_carried(element)),
            _ => self.position_by(body, |element| body.displacement(element)),
        }
    }

    #[inline(always)]
    fn position_by(&self, body: &Deformed, displacement: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
        let links = links_by(body, self.element, &displacement);
        let (cell, u) = (body.lattice.cell(self.element), displacement(self.element));
        let mut p = [0, 1, 2].map(|a| cell[a] as f64 + 0.5 + u[a]);
        for (link, local) in links.iter().zip(self.local) {
            for axis in 0..3 {
                p[axis] += f64::from(local) * link[axis];
            }
        }
        p.map(|c| c * body.lattice.spacing_m)
    }

    /// Its displacement, m: between those of the elements around it, so that it does not jump from one element to the
    /// next.
    pub fn displacement_m(&self, body: &Deformed) -> [f64; 3] {
        let cell = body.lattice.cell(self.element);
        let side = self.local.map(|l| if l < 0.0 { -1_i64 } else { 1 });
        let mut sum = [0.0; 3];
        for corner in 0..8 {
            let goes = [0, 1, 2].map(|a| corner >> a & 1 == 1);
            let share = |a: usize| {
                let part = f64::from(self.local[a].abs()).min(0.5);
                if goes[a] { part } else { 1.0 - part }
            };
            let weight = share(0) * share(1) * share(2);
            let at = [0, 1, 2].map(|a| cell[a] as i64 + if goes[a] { side[a] } else { 0 });
            let [x, y, z] = at.map(|c| usize::try_from(c).ok());
            let beside = x
                .zip(y)
                .zip(z)
                .and_then(|((x, y), z)| body.lattice.element_of_cell(x, y, z));
            let u = body.displacement(beside.unwrap_or(self.element));
            for (sum, u) in sum.iter_mut().zip(u) {
                *sum += weight * u * body.lattice.spacing_m;
            }
        }
        sum
    }

    /// Returns where a direction of the tissue at rest points now, as a unit vector; unchanged if it has no length.
    pub fn direction(&self, body: &Deformed, rest_dir: [f64; 3]) -> [f64; 3] {
        let links = link_vectors(body, self.element);
        let mut now = [0.0; 3];
        for (link, part) in links.iter().zip(rest_dir) {
            for axis in 0..3 {
                now[axis] += part * link[axis];
            }
        }
        let length = now.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 1e-12 && length.is_finite() {
            now.map(|c| c / length)
        } else {
            rest_dir
        }
    }
}

/// Returns the centre of an element, in elements.
fn centre(body: &Deformed, element: u32) -> [f64; 3] {
    let cell = body.lattice.cell(element);
    let u = body.displacement(element);
    [0, 1, 2].map(|a| cell[a] as f64 + 0.5 + u[a])
}

/// Returns the links through an element along each axis: central differences, one-sided at the surface, as at rest
/// where there is no neighbour.
fn link_vectors(body: &Deformed, element: u32) -> [[f64; 3]; 3] {
    links_by(body, element, &|element| body.displacement(element))
}

#[inline(always)]
fn links_by(body: &Deformed, element: u32, displacement: &impl Fn(u32) -> [f64; 3]) -> [[f64; 3]; 3] {
    let around = body.lattice.neighbours(element);
    [0, 1, 2].map(|axis| {
        let (below, above) = (around[2 * axis], around[2 * axis + 1]);
        let steps = f64::from(u8::from(below.is_some()) + u8::from(above.is_some()));
        let lo = displacement(below.unwrap_or(element));
        let hi = displacement(above.unwrap_or(element));
        let mut link = [0, 1, 2].map(|a| (hi[a] - lo[a]) / steps.max(1.0));
        link[axis] += 1.0;
        link
    })
}

/// Coefficients of `p - centre` in the links of an element; `None` for a flat cell.
fn local_of(body: &Deformed, p: [f64; 3], element: u32) -> Option<[f64; 3]> {
    let [a, b, c] = link_vectors(body, element);
    let x = centre(body, element);
    let r = [0, 1, 2].map(|axis| p[axis] - x[axis]);
    let volume = dot(a, cross(b, c));
    if volume.abs() < 1e-9 {
        return None;
    }
    let parts = [dot(r, cross(b, c)), dot(r, cross(c, a)), dot(r, cross(a, b))];
    Some(parts.map(|part| part / volume))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns the place in elements, unless it is too far away for any element.
fn in_reach(body: &Deformed, point_m: [f64; 3]) -> Option<[f64; 3]> {
    let p = point_m.map(|c| c / body.lattice.spacing_m);
    (p.iter().all(|c| c.is_finite()) && !out_of_reach(body, p)).then_some(p)
}

/// Returns whether a place is farther from the body at rest than any element has moved, and its own size at the largest
/// stretch.
fn out_of_reach(body: &Deformed, p: [f64; 3]) -> bool {
    let (low, high) = body.lattice.bounds_m();
    let [low, high] = [low, high].map(|corner| corner.map(|c| c / body.lattice.spacing_m));
    let margin = f64::from(body.reach);
    (0..3).any(|a| p[a] < low[a] - margin || p[a] > high[a] + margin)
}

/// Steps to the neighbour on the side where the point is farthest out, until it is inside a cell.
fn walk(body: &Deformed, p: [f64; 3], start: u32) -> Option<MaterialPoint> {
    let mut element = start;
    let mut best: Option<(f64, MaterialPoint)> = None;
    for _ in 0..MAX_WALK {
        let local = local_of(body, p, element)?;
        let around = body.lattice.neighbours(element);
        let outside = |axis: usize| local[axis].abs() - 0.5;
        let beyond = |axis: usize| around[2 * axis + usize::from(local[axis] > 0.0)];
        let worst = (0..3).map(outside).fold(f64::MIN, f64::max);
        let in_tissue = (0..3).all(|a| outside(a) <= 1e-6 || beyond(a).is_some());
        let found = MaterialPoint {
            element,
            local: local.map(|c| c as f32),
        };
        if worst <= 1e-6 {
            return Some(found);
        }
        if in_tissue && worst <= GAP && best.is_none_or(|(least, _)| worst < least) {
            best = Some((worst, found));
        }
        let ways = (0..3).filter(|&a| outside(a) > 1e-6 && beyond(a).is_some());
        let way = ways.max_by(|&a, &b| outside(a).total_cmp(&outside(b)));
        let Some(next) = way.and_then(beyond) else {
            break;
        };
        element = next;
    }
    best.map(|(_, found)| found)
}

/// Returns the element nearest to `p` now, among a sample.
fn nearest_sample(body: &Deformed, p: [f64; 3]) -> u32 {
    let stride = body.lattice.element_count().div_ceil(MAX_STARTS).max(1);
    let mut nearest = (f64::INFINITY, 0);
    for element in (0..body.lattice.element_count() as u32).step_by(stride) {
        let x = centre(body, element);
        let square = (0..3).map(|a| (p[a] - x[a]).powi(2)).sum::<f64>();
        if square < nearest.0 {
            nearest = (square, element);
        }
    }
    nearest.1
}

#[cfg(test)]
mod tests;
