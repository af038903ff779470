//! Solids and lines that are not tissue: needle, seeds, path, entry, grid and axes.

use crate::theme::{DARK, Tokens};
use bytemuck::{Pod, Zeroable};
use egui::Color32;
use nalgebra::Vector3;

type V = Vector3<f32>;

const SEED_LENGTH_M: f32 = stylet_shm_schema::SEED_LENGTH_M as f32;
const SEED_RADIUS_M: f32 = stylet_shm_schema::SEED_RADIUS_M as f32;
/// Radius of an 18 gauge needle.
const NEEDLE_RADIUS_M: f32 = 0.635e-3;
/// Drawn length of the needle.
pub const NEEDLE_LENGTH_M: f64 = 0.12;
const BEVEL_M: f32 = 2.5e-3;
/// Radius of the second hand's tool, thinner than an ultrasound probe, so that it hides little.
const SECOND_RADIUS_M: f32 = 3e-3;
const RING_RADIUS_M: f32 = 1.6e-3;
const RING_THICKNESS_M: f32 = 0.16e-3;
const DASH_M: f32 = 2e-3;
const SIDES: usize = 16;
const CAP_RINGS: usize = 4;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct MarkVertex {
    pub place_m: [f32; 3],
    /// Normal; zero for lines, which are not lit.
    pub normal: [f32; 3],
    pub color: [u8; 4],
}

/// Triangles and line segments of one picture, both as plain lists.
pub struct Marks {
    pub triangles: Vec<MarkVertex>,
    pub lines: Vec<MarkVertex>,
    tokens: &'static Tokens,
}

impl Default for Marks {
    fn default() -> Self {
        Self {
            triangles: Vec::new(),
            lines: Vec::new(),
            tokens: &DARK,
        }
    }
}

fn single(v: [f64; 3]) -> V {
    V::new(v[0] as f32, v[1] as f32, v[2] as f32)
}

/// Returns the unit vector; z for a vector without direction.
fn unit_or_z(v: V) -> V {
    v.try_normalize(1e-6).unwrap_or_else(V::z)
}

fn frame_about(axis: V) -> (V, V) {
    let helper = if axis.x.abs() < 0.8 { V::x() } else { V::y() };
    let u = unit_or_z(axis.cross(&helper));
    (u, axis.cross(&u))
}

impl Marks {
    /// Clears the marks, for a picture in these colours.
    pub fn begin(&mut self, tokens: &'static Tokens) {
        self.tokens = tokens;
        self.triangles.clear();
        self.lines.clear();
    }

    /// Adds the needle through these places, from the tip back; at least two.
    pub fn needle(&mut self, points_m: &[[f64; 3]]) {
        let [tip, next, ..] = points_m else { return };
        let (tip, next) = (single(*tip), single(*next));
        let shoulder = tip - unit_or_z(tip - next) * BEVEL_M;
        let radii = [NEEDLE_RADIUS_M, NEEDLE_RADIUS_M];
        self.cone(shoulder, tip, [NEEDLE_RADIUS_M, 0.0], self.tokens.needle_tip);
        let (mut front, mut axis) = (shoulder, unit_or_z(tip - next));
        for place in &points_m[1..] {
            let place = single(*place);
            axis = unit_or_z(front - place);
            self.cone(place, front, radii, self.tokens.needle);
            front = place;
        }
        let hub = front;
        // The hub shows which end is held.
        let grip = hub - axis * 0.012;
        self.cone(grip, hub, [2.6e-3, 2.0e-3], self.tokens.path);
        self.cone(grip - axis * 1e-4, grip, [0.0, 2.6e-3], self.tokens.path);
        self.cone(hub, hub + axis * 1e-4, [2.0e-3, 0.0], self.tokens.path);
    }

    /// Adds the tool of the second hand, from its tip to the hand, as a plain rod.
    pub fn second_tool(&mut self, tip_m: [f64; 3], end_m: [f64; 3]) {
        let (tip, end) = (single(tip_m), single(end_m));
        let color = self.tokens.path;
        self.cone(end, tip, [SECOND_RADIUS_M; 2], color);
        self.cap(tip, unit_or_z(tip - end), SECOND_RADIUS_M, color);
    }

    pub fn placed_seed(&mut self, center_m: [f64; 3], axis: [f64; 3]) {
        let (center, axis) = (single(center_m), unit_or_z(single(axis)));
        let half = axis * (0.5 * SEED_LENGTH_M - SEED_RADIUS_M);
        let radius = SEED_RADIUS_M * 1.35;
        self.cone(center - half, center + half, [radius, radius], self.tokens.seed_placed);
        self.cap(center + half, axis, radius, self.tokens.seed_placed);
        self.cap(center - half, -axis, radius, self.tokens.seed_placed);
    }

    /// Adds a planned seed as three rings, a wire sphere, unlike the capsule of a placed seed.
    pub fn planned_seed(&mut self, center_m: [f64; 3], direction: [f64; 3]) {
        let (center, axis) = (single(center_m), unit_or_z(single(direction)));
        let (u, v) = frame_about(axis);
        for (a, b) in [(u, v), (axis, u), (axis, v)] {
            self.ring(center, a, b, RING_RADIUS_M, self.tokens.seed_planned);
        }
    }

    /// Adds seeds of other needles as wire spheres in thin lines, because there may be a hundred.
    pub fn planned_seeds_thin(&mut self, centers_m: impl Iterator<Item = [f64; 3]>, direction: [f64; 3]) {
        const STEPS: usize = 10;
        let axis = unit_or_z(single(direction));
        let (u, v) = frame_about(axis);
        let about = |(a, b): (V, V)| {
            let at = move |step: usize| {
                let (s, c) = (std::f32::consts::TAU * step as f32 / STEPS as f32).sin_cos();
                (a * c + b * s) * RING_RADIUS_M
            };
            (0..STEPS).map(move |step| [at(step), at(step + 1)])
        };
        let sphere: Vec<[V; 2]> = [(u, v), (axis, u), (axis, v)].into_iter().flat_map(about).collect();
        for center in centers_m.map(single) {
            for [from, to] in &sphere {
                self.line(center + from, center + to, self.tokens.seed_planned);
            }
        }
    }

    /// Adds the path of another needle.
    pub fn path_thin(&mut self, from_m: [f64; 3], to_m: [f64; 3]) {
        self.line(single(from_m), single(to_m), self.tokens.path);
    }

    pub fn path(&mut self, from_m: [f64; 3], to_m: [f64; 3]) {
        let (from, to) = (single(from_m), single(to_m));
        let length = (to - from).norm().min(1.0);
        let axis = unit_or_z(to - from);
        let dashes = (length / (2.0 * DASH_M)).ceil() as usize;
        for dash in 0..dashes {
            let start = dash as f32 * 2.0 * DASH_M;
            let end = (start + DASH_M).min(length);
            self.cone(from + axis * start, from + axis * end, [0.17e-3; 2], self.tokens.path);
        }
    }

    /// Adds a flat ring and a cross about the entry.
    pub fn entry(&mut self, place_m: [f64; 3], direction: [f64; 3]) {
        let (center, axis) = (single(place_m), unit_or_z(single(direction)));
        let (u, v) = frame_about(axis);
        self.ring(center, u, v, 3.2e-3, self.tokens.entry);
        for arm in [u, -u, v, -v] {
            self.cone(
                center + arm * 2.0e-3,
                center + arm * 4.6e-3,
                [0.2e-3; 2],
                self.tokens.entry,
            );
        }
    }

    /// Adds the force on the hand, from the tip, 4 mm per newton.
    pub fn force(&mut self, tip_m: [f64; 3], force_n: [f64; 3]) {
        const M_PER_N: f32 = 4e-3;
        const LEAST_N: f32 = 0.05;
        const HEAD_M: f32 = 3e-3;
        let (tip, force) = (single(tip_m), single(force_n));
        let size = force.norm();
        // NaN is not drawn either.
        if !(LEAST_N..).contains(&size) {
            return;
        }
        let axis = force / size;
        let end = tip + axis * (size * M_PER_N).min(0.06);
        self.cone(tip, end, [0.5e-3; 2], self.tokens.force);
        self.cone(end, end + axis * HEAD_M, [1.3e-3, 0.0], self.tokens.force);
        self.cone(end - axis * 1e-4, end, [0.0, 1.3e-3], self.tokens.force);
    }

    /// Adds 13 by 13 holes 5 mm apart about the needle's path, `before_m` before the entry.
    pub fn template(&mut self, entry_m: [f64; 3], direction: [f64; 3], before_m: f32) {
        const HOLES: i32 = 6;
        const PITCH_M: f32 = 5e-3;
        const ARM_M: f32 = 0.7e-3;
        let (entry, axis) = (single(entry_m), unit_or_z(single(direction)));
        let (u, v) = frame_about(axis);
        let middle = entry - axis * before_m;
        for row in -HOLES..=HOLES {
            for column in -HOLES..=HOLES {
                let hole = middle + (u * row as f32 + v * column as f32) * PITCH_M;
                self.line(hole - u * ARM_M, hole + u * ARM_M, self.tokens.template);
                self.line(hole - v * ARM_M, hole + v * ARM_M, self.tokens.template);
            }
        }
        let edge = (HOLES as f32 + 1.0) * PITCH_M;
        let corners =
            [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(a, b)| middle + u * (a * edge) + v * (b * edge));
        for side in 0..4 {
            self.line(corners[side], corners[(side + 1) % 4], self.tokens.template);
        }
    }

    /// Adds a line between two places, or a ring about one.
    pub fn measured(&mut self, points: &[V]) {
        for point in points {
            self.ring(*point, V::x(), V::y(), 0.8e-3, self.tokens.measure);
        }
        if let [a, b] = points {
            self.cone(*a, *b, [0.2e-3; 2], self.tokens.measure);
        }
    }

    /// Adds lines each 10 mm under the body, and the three axes from a far corner, which is
    /// returned.
    pub fn grid_and_axes(&mut self, lower_m: [f64; 3], upper_m: [f64; 3]) -> [f32; 3] {
        const STEP_M: f32 = 0.01;
        let (lower, upper) = (single(lower_m), single(upper_m));
        let y = lower.y - STEP_M;
        let cells = |from: f32, to: f32| {
            let first = (from / STEP_M).floor() - 1.0;
            let last = (to / STEP_M).ceil() + 1.0;
            (first, (last - first).clamp(1.0, 60.0) as usize)
        };
        let (x0, nx) = cells(lower.x, upper.x);
        let (z0, nz) = cells(lower.z, upper.z);
        let at = |i: usize, k: usize| V::new((x0 + i as f32) * STEP_M, y, (z0 + k as f32) * STEP_M);
        for i in 0..=nx {
            self.line(at(i, 0), at(i, nz), self.tokens.grid);
        }
        for k in 0..=nz {
            self.line(at(0, k), at(nx, k), self.tokens.grid);
        }
        let corner = at(nx, 0);
        for axis in [V::x(), V::y(), V::z()] {
            self.cone(corner, corner + axis * STEP_M, [0.2e-3; 2], self.tokens.weak);
            self.cone(
                corner + axis * STEP_M,
                corner + axis * 1.25 * STEP_M,
                [0.6e-3, 0.0],
                self.tokens.weak,
            );
        }
        corner.into()
    }

    fn line(&mut self, from: V, to: V, color: Color32) {
        for place in [from, to] {
            self.lines.push(vertex(place, V::zeros(), color));
        }
    }

    fn quad(&mut self, corners: [(V, V); 4], color: Color32) {
        for index in [0, 1, 2, 0, 2, 3] {
            let (place, normal) = corners[index];
            self.triangles.push(vertex(place, normal, color));
        }
    }

    /// Adds the side of a cone, a cylinder if both radii are equal; open at both ends.
    fn cone(&mut self, from: V, to: V, radii: [f32; 2], color: Color32) {
        let axis = unit_or_z(to - from);
        let (u, v) = frame_about(axis);
        let slope = (radii[0] - radii[1]) / (to - from).norm().max(1e-9);
        let around = |side: usize| {
            let (s, c) = (std::f32::consts::TAU * side as f32 / SIDES as f32).sin_cos();
            u * c + v * s
        };
        for side in 0..SIDES {
            let (a, b) = (around(side), around(side + 1));
            let (na, nb) = (unit_or_z(a + axis * slope), unit_or_z(b + axis * slope));
            let corners = [
                (from + a * radii[0], na),
                (from + b * radii[0], nb),
                (to + b * radii[1], nb),
                (to + a * radii[1], na),
            ];
            self.quad(corners, color);
        }
    }

    fn cap(&mut self, center: V, axis: V, radius: f32, color: Color32) {
        let (u, v) = frame_about(axis);
        let normal = |ring: usize, side: usize| {
            let (lift, out) = (std::f32::consts::FRAC_PI_2 * ring as f32 / CAP_RINGS as f32).sin_cos();
            let (s, c) = (std::f32::consts::TAU * side as f32 / SIDES as f32).sin_cos();
            (u * c + v * s) * out + axis * lift
        };
        for ring in 0..CAP_RINGS {
            for side in 0..SIDES {
                let corners = [(ring, side), (ring, side + 1), (ring + 1, side + 1), (ring + 1, side)]
                    .map(|(r, s)| (center + normal(r, s) * radius, normal(r, s)));
                self.quad(corners, color);
            }
        }
    }

    fn ring(&mut self, center: V, a: V, b: V, radius: f32, color: Color32) {
        const STEPS: usize = 28;
        const TUBE: usize = 6;
        let out_of_plane = a.cross(&b);
        let corner = |step: usize, tube: usize| {
            let (s, c) = (std::f32::consts::TAU * step as f32 / STEPS as f32).sin_cos();
            let (ts, tc) = (std::f32::consts::TAU * tube as f32 / TUBE as f32).sin_cos();
            let outward = a * c + b * s;
            let normal = outward * tc + out_of_plane * ts;
            (center + outward * radius + normal * RING_THICKNESS_M, normal)
        };
        for step in 0..STEPS {
            for tube in 0..TUBE {
                let corners =
                    [(step, tube), (step + 1, tube), (step + 1, tube + 1), (step, tube + 1)].map(|(s, t)| corner(s, t));
                self.quad(corners, color);
            }
        }
    }
}

fn vertex(place: V, normal: V, color: Color32) -> MarkVertex {
    MarkVertex {
        place_m: place.into(),
        normal: normal.into(),
        color: color.to_array(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_degenerate_input_are_finite() {
        let mut marks = Marks::default();
        marks.needle(&[[0.0; 3]; 2]);
        marks.placed_seed([1.0; 3], [0.0; 3]);
        marks.planned_seed([0.0; 3], [0.0; 3]);
        marks.path([0.0; 3], [0.0; 3]);
        marks.planned_seeds_thin([[0.0; 3]].into_iter(), [0.0; 3]);
        marks.path_thin([0.0; 3], [0.0; 3]);
        marks.grid_and_axes([-20.0; 3], [20.0; 3]);
        marks.force([0.0; 3], [f64::NAN; 3]);
        marks.force([0.0; 3], [100.0, 0.0, 0.0]);
        marks.template([0.0; 3], [0.0; 3], 5e-3);
        marks.measured(&[V::zeros(), V::zeros()]);
        let all = marks.triangles.iter().chain(&marks.lines);
        assert!(
            all.flat_map(|v| v.place_m.iter().chain(&v.normal))
                .all(|c| c.is_finite())
        );
    }
}
