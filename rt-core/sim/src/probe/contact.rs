//! One tick of the probe: forces between it and the wall, none of which pulls, and what they do to the body.

use super::columns::ReadyProbe;
use super::complementarity::Problem;
use super::response::ProbeResponse;
use super::shape::ProbePose;
use crate::tissue::ElementField;
use nalgebra::{Matrix3, Vector3};

/// Pads farther from the probe than that are not looked at in a pass.
const NEAR_M: f64 = 4e-3;
/// A pad is pressed from the side of the hollow: the probe's surface there faces into the wall.
const FACING: f64 = 0.2;
/// A pose farther from the one before is reached in steps, since the wall's way out of the probe is that to the nearest side.
const STEP_M: f64 = 2e-3;
const MOST_STEPS: usize = 8;
/// Passes over the directions of the forces at the end of a tick, at most, and in a step on the way there.
const PASSES: usize = 40;
const PASSES_ON_THE_WAY: usize = 2;
/// A pass that leaves no pad farther than that from the probe's surface, on the wrong side, and no force turned farther from it, is the last.
const CLOSED_M: f64 = 2e-8;
const TURNED: f64 = 1e-5;
/// From that pass on a force turns half as far as the surface does: a pad that is hardly pressed may be in contact in every other pass.
const HALF_FROM: usize = 12;

/// What came of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactReport {
    /// Passes in all of its steps.
    pub passes: u32,
    /// Most rounds of active sets in a pass.
    pub rounds: u32,
    /// Pads that are looked at.
    pub near: u32,
    /// Deepest pad in the probe, and the largest gap under a force, m.
    pub open_m: f64,
    /// How far a force is from square to the probe's surface, rad.
    pub turned: f64,
}

/// What a probe has done so far; nothing is allocated after `new`.
#[derive(Clone, Debug)]
pub struct ProbeState {
    pose: Option<ProbePose>,
    /// On the tissue at each pad, along x, y, z, N.
    loads_n: Vec<f64>,
    /// How far each pad is displaced by them, m.
    moved_m: Vec<f64>,
    /// How hard each pad is pressed, N.
    pressed_n: Vec<f64>,
    near: Vec<u32>,
    outward: Vec<[f64; 3]>,
    problem: Problem,
    /// What the loads do to the body, m.
    pub share: ElementField,
    report: ContactReport,
}

impl ProbeState {
    /// No contact yet.
    pub fn new(probe: &ReadyProbe) -> Self {
        let pads = probe.wall.pads.len();
        let elements = probe.columns.first().map_or(0, crate::tissue::PackedField::elements);
        ProbeState {
            pose: None,
            loads_n: vec![0.0; 3 * pads],
            moved_m: vec![0.0; 3 * pads],
            pressed_n: vec![0.0; pads],
            near: Vec::with_capacity(pads),
            outward: vec![[0.0; 3]; pads],
            problem: Problem::with_room(pads),
            share: ElementField::with_room(elements),
            report: ContactReport::default(),
        }
    }

    /// Loads on the tissue, pad after pad, along x, y, z, N.
    pub fn loads_n(&self) -> &[f64] {
        &self.loads_n
    }

    /// Displacements of the pads by these loads, pad after pad, along x, y, z, m.
    pub fn moved_m(&self) -> &[f64] {
        &self.moved_m
    }

    /// What came of the last tick.
    pub fn report(&self) -> ContactReport {
        self.report
    }

    /// Nothing is pressed.
    pub fn is_at_rest(&self) -> bool {
        self.pressed_n.iter().all(|p| *p == 0.0)
    }

    /// Tissue at rest, and the probe out of it.
    pub fn reset(&mut self) {
        self.pose = None;
        for values in [&mut self.loads_n, &mut self.moved_m, &mut self.pressed_n] {
            values.fill(0.0);
        }
    }
}

/// The probe goes to `pose`; `beside_m` is how far other loads displace each pad, along x, y, z. A pose that is no number counts as the one before.
pub fn step(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose, beside_m: &[f64]) -> ProbeResponse {
    let is_finite = pose.tip_m.iter().chain(&pose.axis).all(|c| c.is_finite());
    let from = state.pose.unwrap_or(*pose);
    let pose = if is_finite { *pose } else { from };
    state.report = ContactReport::default();
    if is_finite || state.pose.is_some() {
        let steps = steps_between(&from, &pose);
        for n in 1..=steps {
            let here = from.towards(&pose, n as f64 / steps as f64);
            press(
                probe,
                state,
                &here,
                beside_m,
                if n < steps { PASSES_ON_THE_WAY } else { PASSES },
            );
        }
        state.pose = Some(pose);
    }
    respond(state, probe, &pose, beside_m)
}

/// Adds up what the loads do to the body; where they are others than before, which this does not look for. Does not allocate.
pub fn displace(probe: &ReadyProbe, state: &mut ProbeState) {
    state.share.load(&probe.columns, &state.loads_n);
}

/// The farthest that a point of the probe in the wall moves decides.
fn steps_between(from: &ProbePose, to: &ProbePose) -> usize {
    /// From the tip to the end of the wall.
    const REACH_M: f64 = 0.1;
    let motion = from.motion_to(to);
    let moved_m = Vector3::new(motion[0], motion[1], motion[2]).norm();
    let turned_m = REACH_M * Vector3::new(motion[3], motion[4], motion[5]).norm();
    (((moved_m + turned_m) / STEP_M).ceil() as usize).clamp(1, MOST_STEPS)
}

fn press(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose, beside_m: &[f64], passes: usize) {
    for pass in 0..passes {
        state.report.passes += 1;
        look(probe, state, pose, beside_m, if pass < HALF_FROM { 1.0 } else { 0.5 });
        let n = state.near.len();
        state.problem.count = n;
        for a in 0..n {
            let (pad, outward) = (state.near[a] as usize, Vector3::from(state.outward[a]));
            state.problem.forces_n[a] = state.pressed_n[pad];
            for b in 0..=a {
                let other = state.near[b] as usize;
                let between = block(probe, pad, other) * Vector3::from(state.outward[b]);
                let value = outward.dot(&between);
                state.problem.matrix[a * n + b] = value;
                state.problem.matrix[b * n + a] = value;
            }
        }
        state.problem.solve();
        state.report.rounds = state.report.rounds.max(state.problem.rounds as u32);
        state.report.near = n as u32;
        take_forces(probe, state);
        [state.report.open_m, state.report.turned] = left_over(probe, state, pose, beside_m);
        if state.report.open_m <= CLOSED_M && state.report.turned <= TURNED {
            break;
        }
    }
}

/// Pads near the probe, where its surface is there, and how far each gap would be without the forces. Forces turn that part of the way.
fn look(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose, beside_m: &[f64], part: f64) {
    state.near.clear();
    for (n, pad) in probe.wall.pads.iter().enumerate() {
        let (gap_m, outward) = gap(probe, state, pose, beside_m, n);
        let facing = (0..3).map(|c| outward[c] * pad.outward[c]).sum::<f64>();
        let is_pressed = state.pressed_n[n] > 0.0;
        if facing < FACING && (is_pressed || gap_m < NEAR_M) {
            let at = state.near.len();
            let outward = if is_pressed {
                turned(state, n, outward, part)
            } else {
                outward
            };
            let moved_m: f64 = (0..3).map(|c| outward[c] * state.moved_m[3 * n + c]).sum();
            state.outward[at] = outward;
            state.problem.free_m[at] = gap_m - moved_m;
            state.near.push(n as u32);
        }
    }
}

/// The direction of the force on a pad, that part of the way to another.
fn turned(state: &ProbeState, n: usize, outward: [f64; 3], part: f64) -> [f64; 3] {
    let before = Vector3::from_fn(|c, _| state.loads_n[3 * n + c] / state.pressed_n[n]);
    let mixed = before + (Vector3::from(outward) - before) * part;
    mixed.try_normalize(1e-9).map_or(outward, Into::into)
}

fn gap(probe: &ReadyProbe, state: &ProbeState, pose: &ProbePose, beside_m: &[f64], n: usize) -> (f64, [f64; 3]) {
    let rest_m = probe.wall.pads[n].place_m;
    let by_others = |c: usize| {
        beside_m
            .get(3 * n + c)
            .copied()
            .filter(|m| m.is_finite())
            .unwrap_or(0.0)
    };
    let place_m = [0, 1, 2].map(|c| rest_m[c] + state.moved_m[3 * n + c] + by_others(c));
    probe.shape.gap_m(pose, place_m)
}

fn block(probe: &ReadyProbe, a: usize, b: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| probe.at(3 * a + r, 3 * b + c))
}

fn take_forces(probe: &ReadyProbe, state: &mut ProbeState) {
    state.loads_n.fill(0.0);
    state.pressed_n.fill(0.0);
    for (at, &pad) in state.near.iter().enumerate() {
        let force_n = state.problem.forces_n[at].max(0.0);
        let pad = pad as usize;
        state.pressed_n[pad] = force_n;
        for c in 0..3 {
            state.loads_n[3 * pad + c] = force_n * state.outward[at][c];
        }
    }
    state.moved_m.fill(0.0);
    let rows = probe.rows();
    for (row, &load_n) in state.loads_n.iter().enumerate().filter(|(_, n)| **n != 0.0) {
        // Symmetric: a row is a column.
        let column = probe.compliance.get(row * rows..(row + 1) * rows).unwrap_or(&[]);
        for (moved_m, c) in state.moved_m.iter_mut().zip(column) {
            *moved_m += load_n * c;
        }
    }
}

/// How far pads are on the wrong side: those that are pressed on either, the others in the probe. And how far a force is from square to the
/// probe's surface.
fn left_over(probe: &ReadyProbe, state: &ProbeState, pose: &ProbePose, beside_m: &[f64]) -> [f64; 2] {
    let (mut open_m, mut turned) = (0.0_f64, 0.0_f64);
    for (n, pad) in probe.wall.pads.iter().enumerate() {
        let (gap_m, outward) = gap(probe, state, pose, beside_m, n);
        let facing = (0..3).map(|c| outward[c] * pad.outward[c]).sum::<f64>();
        let pressed_n = state.pressed_n[n];
        if pressed_n > 0.0 {
            open_m = open_m.max(gap_m.abs());
            let off = |c: usize| state.loads_n[3 * n + c] / pressed_n - outward[c];
            turned = turned.max((0..3).map(|c| off(c).powi(2)).sum::<f64>().sqrt());
        } else if facing < FACING {
            open_m = open_m.max(-gap_m);
        }
    }
    [open_m, turned]
}

fn respond(state: &mut ProbeState, probe: &ReadyProbe, pose: &ProbePose, beside_m: &[f64]) -> ProbeResponse {
    let mut response = ProbeResponse::nothing(*pose);
    let tip = Vector3::from(pose.tip_m);
    // Of the pads in contact: how each gap closes with the six motions of the probe.
    let arm = |state: &ProbeState, at: usize| {
        let pad = state.near[at] as usize;
        let rest_m = Vector3::from(probe.wall.pads[pad].place_m);
        let moved_m =
            Vector3::from_fn(|c, _| state.moved_m[3 * pad + c] + beside_m.get(3 * pad + c).copied().unwrap_or(0.0));
        let outward = Vector3::from(state.outward[at]);
        let turning = (rest_m + moved_m - tip).cross(&outward);
        [outward.x, outward.y, outward.z, turning.x, turning.y, turning.z]
    };
    for at in 0..state.near.len() {
        let force_n = state.pressed_n[state.near[at] as usize];
        if force_n > 0.0 {
            response.contacts += 1;
            let arm = arm(state, at);
            for c in 0..6 {
                response.wrench.0[c] -= force_n * arm[c];
            }
        }
    }
    if response.contacts == 0 {
        return response;
    }
    let set = state.problem.set.len();
    for motion in 0..6 {
        let mut values = std::mem::take(&mut state.problem.work);
        for at in 0..set {
            values[at] = arm(state, state.problem.set[at] as usize)[motion];
        }
        state.problem.back(&mut values[..set]);
        for at in 0..set {
            let arm = arm(state, state.problem.set[at] as usize);
            for c in 0..6 {
                response.stiffness[c][motion] -= values[at] * arm[c];
            }
        }
        state.problem.work = values;
    }
    response
}
