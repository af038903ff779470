//! The same contact solved in full: every free node by the multigrid, an active set outside of it, directions until
//! they stand still.
//!
//! Nothing is condensed and nothing packed: each product with the compliance is a solution for the whole body.

use super::{Fixture, displace, finely};
use crate::probe::wall::Wall;
use crate::probe::{ProbePose, ProbeState};
use crate::tissue::ElementField;
use crate::tissue::fem::batch::{BatchState, NodeWeight};
use nalgebra::Vector3;

/// Residual of a solution, over its load.
const TOLERANCE: f64 = 3e-6;
/// Largest gap of points in contact, m.
const CLOSED_M: f64 = 2e-7;

/// The contact of a probe with the points of a wall, in full: each force is on the faces around its point.
pub(in crate::probe) struct Reference<'a> {
    fixture: &'a Fixture,
    wall: &'a Wall,
    weights: Vec<Vec<(u32, f64)>>,
    solver: BatchState<f32>,
    moved: Vec<[f64; 3]>,
    is_in: Vec<bool>,
    pressed: Vec<f64>,
    /// Forces on the tissue, N.
    pub loads_n: Vec<[f64; 3]>,
    /// Displacement of the element centres, m.
    pub field: ElementField,
    pub solutions: usize,
}

impl<'a> Reference<'a> {
    pub fn new(fixture: &'a Fixture, wall: &'a Wall) -> Self {
        let weights = wall
            .points
            .iter()
            .map(|p| p.weights(&fixture.body).expect("in the body"));
        Reference {
            weights: weights.collect(),
            solver: BatchState::new(&fixture.body),
            moved: vec![[0.0; 3]; wall.points.len()],
            is_in: vec![false; wall.points.len()],
            pressed: vec![0.0; wall.points.len()],
            loads_n: vec![[0.0; 3]; wall.points.len()],
            field: ElementField::zeros(fixture.body.element_count()),
            solutions: 0,
            fixture,
            wall,
        }
    }

    /// Returns the displacement of all points by these loads.
    fn answer(&mut self, loads_n: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let load: Vec<NodeWeight> = loads_n
            .iter()
            .zip(&self.weights)
            .filter(|(force, _)| **force != [0.0; 3])
            .flat_map(|(force, of_point)| {
                of_point.iter().map(|&(node, part)| NodeWeight {
                    node,
                    weight: force.map(|f| f * part),
                })
            })
            .collect();
        self.solver.begin(&self.fixture.body, &[&load]);
        loop {
            let progress = self.solver.advance(&self.fixture.body);
            if self.solver.is_whole() && (progress.residual <= TOLERANCE || progress.iterations >= 60) {
                break;
            }
        }
        self.solutions += 1;
        self.weights.iter().map(|of_point| self.sample(of_point)).collect()
    }

    /// Solves the body under these loads on the pads.
    pub fn load_pads(&mut self, loads_n: &[[f64; 3]]) {
        let pads = self
            .wall
            .pads
            .iter()
            .map(|p| p.weights(&self.fixture.body).expect("in the body"));
        let points = std::mem::replace(&mut self.weights, pads.collect());
        self.answer(loads_n);
        self.weights = points;
    }

    /// Returns the displacement of the last answer under weights, m.
    pub fn sample(&self, weights: &[(u32, f64)]) -> [f64; 3] {
        [0, 1, 2].map(|c| {
            let along = weights.iter().map(|&(node, part)| {
                let mut weight = [0.0; 3];
                weight[c] = part;
                NodeWeight { node, weight }
            });
            self.solver.sample(0, &along.collect::<Vec<_>>())
        })
    }

    /// Finds the forces with which no point is in the probe and none is pulled, from those of the pose before.
    pub fn press(&mut self, pose: &ProbePose) {
        let count = self.wall.points.len();
        let mut moved = std::mem::take(&mut self.moved);
        let mut is_in = std::mem::take(&mut self.is_in);
        let mut pressed = std::mem::take(&mut self.pressed);
        for _ in 0..40 {
            let gaps: Vec<_> = (0..count)
                .map(|n| {
                    let rest = self.wall.points[n].place_m;
                    let at = [0, 1, 2].map(|c| rest[c] + moved[n][c]);
                    self.fixture.probe.shape.gap_m(pose, at)
                })
                .collect();
            let outward: Vec<Vector3<f64>> = gaps.iter().map(|(_, o)| Vector3::from(*o)).collect();
            let free: Vec<f64> = (0..count)
                .map(|n| gaps[n].0 - outward[n].dot(&Vector3::from(moved[n])))
                .collect();
            let mut has_changed = false;
            // The set for these directions.
            for _ in 0..20 {
                self.close(&outward, &free, &is_in, &mut pressed);
                let loads: Vec<[f64; 3]> = (0..count).map(|n| (outward[n] * pressed[n]).into()).collect();
                moved = self.answer(&loads);
                self.loads_n = loads;
                let mut changed = false;
                for n in 0..count {
                    let facing = outward[n].dot(&Vector3::from(self.wall.points[n].outward)) < 0.2;
                    let gap_m = free[n] + outward[n].dot(&Vector3::from(moved[n]));
                    let stays = facing && if is_in[n] { pressed[n] > 0.0 } else { gap_m < -CLOSED_M };
                    changed |= stays != is_in[n];
                    is_in[n] = stays;
                    if !stays {
                        pressed[n] = 0.0;
                    }
                }
                has_changed |= changed;
                if !changed {
                    break;
                }
            }
            let open_m = (0..count).filter(|&n| is_in[n]).map(|n| {
                let rest = self.wall.points[n].place_m;
                let at = [0, 1, 2].map(|c| rest[c] + moved[n][c]);
                self.fixture.probe.shape.gap_m(pose, at).0.abs()
            });
            if open_m.fold(0.0, f64::max) < 10.0 * CLOSED_M && !has_changed {
                break;
            }
        }
        (self.moved, self.is_in, self.pressed) = (moved, is_in, pressed);
        self.solver.write(&self.fixture.body, 0, &mut self.field);
    }

    /// Finds the forces that close the gaps of a set by conjugate gradients.
    fn close(&mut self, outward: &[Vector3<f64>], free: &[f64], is_in: &[bool], pressed: &mut [f64]) {
        let count = is_in.len();
        let product = |this: &mut Self, p: &[f64]| -> Vec<f64> {
            let loads: Vec<[f64; 3]> = (0..count).map(|n| (outward[n] * p[n]).into()).collect();
            let moved = this.answer(&loads);
            (0..count)
                .map(|n| {
                    if is_in[n] {
                        outward[n].dot(&Vector3::from(moved[n]))
                    } else {
                        0.0
                    }
                })
                .collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let begun = product(self, pressed);
        let mut r: Vec<f64> = (0..count)
            .map(|n| if is_in[n] { -free[n] - begun[n] } else { 0.0 })
            .collect();
        let mut p = r.clone();
        let mut rr = dot(&r, &r);
        for _ in 0..60 {
            if r.iter().fold(0.0, |m: f64, v| m.max(v.abs())) < CLOSED_M {
                break;
            }
            let q = product(self, &p);
            let alpha = rr / dot(&p, &q);
            for n in 0..count {
                pressed[n] += alpha * p[n];
                r[n] -= alpha * q[n];
            }
            let next = dot(&r, &r);
            for n in 0..count {
                p[n] = r[n] + next / rr * p[n];
            }
            rr = next;
        }
    }

    /// Returns the force of the tissue on the probe, N.
    pub fn force_n(&self) -> [f64; 3] {
        self.loads_n
            .iter()
            .fold([0.0; 3], |s, f| [0, 1, 2].map(|c| s[c] - f[c]))
    }
}

/// Compares element centres of the chosen structures: mean and largest displacement of the reference, RMS and largest
/// difference.
pub(in crate::probe) fn compare(
    fixture: &Fixture,
    ours: &ElementField,
    full: &ElementField,
    is_asked: &dyn Fn(&str) -> bool,
) -> [f64; 4] {
    let body = &fixture.scene.body;
    let (mut sum, mut count, mut largest, mut square, mut worst) = (0.0, 0.0, 0.0_f64, 0.0, 0.0_f64);
    for e in 0..body.element_count() {
        if !is_asked(&fixture.scene.structures[body.structure(e as u32) as usize].name) {
            continue;
        }
        let at = |f: &ElementField| Vector3::from_fn(|c, _| f64::from(f.0[c][e]));
        let (a, b) = (at(ours), at(full));
        sum += b.norm();
        count += 1.0;
        largest = largest.max(b.norm());
        square += (a - b).norm_squared();
        worst = worst.max((a - b).norm());
    }
    [sum / count, largest, (square / count).sqrt(), worst]
}

/// Measures a probe against the reference, and the time that the reference took.
pub(in crate::probe) fn beside_reference(
    fixture: &Fixture,
    wall: &Wall,
    pressed_m: f64,
    beyond_m: f64,
) -> ([f64; 4], f64) {
    let mut state = ProbeState::new(&fixture.probe);
    let response = fixture.go_in_and_press(&mut state, pressed_m, beyond_m);
    displace(&fixture.probe, &mut state);
    let mut full = Reference::new(fixture, wall);
    // From the middle of the hollow, where it is at once, on another way than ours.
    let begin_m = fixture.middle_m();
    let steps = ((pressed_m - begin_m).abs() / 2e-3).ceil().max(1.0) as i32;
    for n in 0..=steps {
        let part = f64::from(n) / f64::from(steps);
        full.press(&fixture.pose(begin_m + part * (pressed_m - begin_m), beyond_m));
    }
    let compared = compare(fixture, &state.share, &full.field, &|name| {
        name == "gland" || name == "capsule"
    });
    let (ours, theirs) = (Vector3::from(response.wrench.force_n()), Vector3::from(full.force_n()));
    println!(
        "pressed {:.1} mm: force {:.3?} N, in full {:.3?} N, off by {:.2e}; target moves {:.3} mm mean, {:.3} mm at most, off by {:.4} mm rms, {:.4} mm at most; {} solutions",
        1e3 * pressed_m,
        ours.as_slice(),
        theirs.as_slice(),
        (ours - theirs).norm() / theirs.norm(),
        1e3 * compared[0],
        1e3 * compared[1],
        1e3 * compared[2],
        1e3 * compared[3],
        full.solutions
    );
    (compared, (ours - theirs).norm() / theirs.norm())
}

#[test]
fn a_small_body_moves_as_with_the_contact_solved_in_full() {
    let fixture = finely();
    let ([_, largest_m, _, worst_m], force_off) = beside_reference(fixture, &fixture.probe.wall, 5e-3, 20e-3);
    assert!(force_off < 0.01, "{force_off}");
    assert!(worst_m < 0.01 * largest_m, "{worst_m} of {largest_m}");
}
