//! One tick of the probe: forces between it and the wall, none of which pulls, and what they do to the body.

use super::columns::ReadyProbe;
use super::complementarity::Problem;
use super::moves;
use super::response::ProbeResponse;
use super::shape::ProbePose;
use crate::tissue::ElementField;
use nalgebra::Vector3;

/// Points farther from the probe than that are not looked at on the way to a pose, and in a pass.
const REACH_M: f64 = 4e-3;
const NEAR_M: f64 = 0.15e-3;
/// A point is pressed from the side of the hollow: the probe's surface there faces into the wall.
const FACING: f64 = 0.2;
/// A pose farther from the one before is reached in steps, since the wall's way out of the probe is that to the nearest side.
const STEP_M: f64 = 2e-3;
const MOST_STEPS: usize = 8;
/// Passes over the directions of the forces at the end of a tick, at most, and in a step on the way there.
const PASSES: usize = 16;
const PASSES_ON_THE_WAY: usize = 2;
/// A pass that leaves no pad farther than that from the probe's surface, on the wrong side, and no force turned farther from it, is the last.
const CLOSED_M: f64 = 4e-7;
const TURNED: f64 = 2e-4;
/// A problem is condensed anew where a force has turned by more than that since.
const OTHERWISE: f64 = 0.03;
/// How far a force turns in a pass, of the way to the surface: farther in every other pass, since one that has turned moves its point on by up to half
/// as much again; and half as far from the 12th on, since a point that is hardly pressed may be in contact in every other pass.
fn part_of(pass: usize) -> f64 {
    match pass {
        12.. => 0.5,
        2.. if pass.is_multiple_of(2) => 1.8,
        _ => 1.0,
    }
}

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
    /// How far each point is displaced by them, and by others, m.
    moved_m: Vec<[f64; 3]>,
    beside_m: Vec<[f64; 3]>,
    /// Room for how others displace the pads.
    pads_m: Vec<f64>,
    /// How hard each point is pressed, N, and where to.
    pressed_n: Vec<f64>,
    pushed: Vec<[f64; 3]>,
    /// Points that are looked at; how far each is from the probe, m, and where its surface faces there.
    reach: Vec<u32>,
    gaps_m: Vec<f64>,
    surface: Vec<[f64; 3]>,
    /// Those that may be in contact, where their forces go, and where these went when the problem was condensed.
    near: Vec<u32>,
    is_near: Vec<bool>,
    outward: Vec<[f64; 3]>,
    condensed: Vec<[f64; 3]>,
    /// One that may not be in contact overlaps.
    is_missed: bool,
    problem: Problem,
    /// What the loads do to the body, m.
    pub share: ElementField,
    report: ContactReport,
}

impl ProbeState {
    /// No contact yet.
    pub fn new(probe: &ReadyProbe) -> Self {
        let (rows, points) = (probe.rows(), probe.wall.points.len());
        let elements = probe.columns.first().map_or(0, crate::tissue::PackedField::elements);
        ProbeState {
            pose: None,
            loads_n: vec![0.0; rows],
            moved_m: vec![[0.0; 3]; points],
            beside_m: vec![[0.0; 3]; points],
            pads_m: vec![0.0; rows],
            pressed_n: vec![0.0; points],
            pushed: vec![[0.0; 3]; points],
            reach: Vec::with_capacity(points),
            gaps_m: vec![0.0; points],
            surface: vec![[0.0; 3]; points],
            near: Vec::with_capacity(points),
            is_near: vec![false; points],
            outward: vec![[0.0; 3]; points],
            condensed: vec![[0.0; 3]; points],
            is_missed: false,
            problem: Problem::with_room(points),
            share: ElementField::with_room(elements),
            report: ContactReport::default(),
        }
    }

    /// Loads on the tissue, pad after pad, along x, y, z, N.
    pub fn loads_n(&self) -> &[f64] {
        &self.loads_n
    }

    /// Displacements of the points of the wall by these loads, along x, y, z, m.
    pub fn moved_m(&self) -> &[[f64; 3]] {
        &self.moved_m
    }

    /// How hard the probe presses each point of the wall, N, and where to; no direction where it does not.
    pub fn pressed(&self) -> impl Iterator<Item = (f64, [f64; 3])> {
        let pressed = self.pressed_n.iter().copied().zip(self.pushed.iter().copied());
        pressed.map(|(force_n, to)| (force_n, if force_n > 0.0 { to } else { [0.0; 3] }))
    }

    /// Where the last tick had the probe.
    pub(super) fn pose(&self) -> Option<ProbePose> {
        self.pose
    }

    /// Goes on from forces on the points of the wall.
    pub(super) fn take_up(&mut self, probe: &ReadyProbe, pose: Option<ProbePose>, pressed: &[(f64, [f64; 3])]) {
        self.reset();
        self.pose = pose;
        let slots = self.pressed_n.iter_mut().zip(&mut self.pushed);
        for ((force_n, pushed), pressed) in slots.zip(pressed) {
            (*force_n, *pushed) = *pressed;
        }
        self.move_wall(probe);
        self.load_pads(probe);
    }

    /// Where the force of a point turns in a pass: one that did not press has no direction before.
    fn turned(&self, n: usize, pass: usize) -> [f64; 3] {
        match self.pressed_n[n] > 0.0 {
            true => turned(self.pushed[n], self.surface[n], part_of(pass)),
            false => self.surface[n],
        }
    }

    fn move_wall(&mut self, probe: &ReadyProbe) {
        moves::wall(probe, &self.pressed_n, &self.pushed, &mut self.moved_m);
    }

    fn load_pads(&mut self, probe: &ReadyProbe) {
        moves::pads(probe, &self.pressed_n, &self.pushed, &mut self.loads_n);
    }

    fn reach_all(&mut self, probe: &ReadyProbe) {
        self.reach.clear();
        self.reach.extend(0..probe.wall.points.len() as u32);
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
        for values in [&mut self.loads_n, &mut self.pressed_n] {
            values.fill(0.0);
        }
        self.moved_m.fill([0.0; 3]);
    }
}

/// The probe goes to `pose`; `beside_m` is how far other loads displace each pad, along x, y, z. A pose that is no number counts as the one before.
pub fn step(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose, beside_m: &[f64]) -> ProbeResponse {
    let is_finite = pose.tip_m.iter().chain(&pose.axis).all(|c| c.is_finite());
    let from = state.pose.unwrap_or(*pose);
    let pose = if is_finite { *pose } else { from };
    state.report = ContactReport::default();
    if is_finite || state.pose.is_some() {
        moves::beside(probe, beside_m, &mut state.pads_m, &mut state.beside_m);
        let steps = steps_between(&from, &pose);
        for n in 1..=steps {
            let here = from.towards(&pose, n as f64 / steps as f64);
            press(probe, state, &here, if n < steps { PASSES_ON_THE_WAY } else { PASSES });
        }
        state.load_pads(probe);
        state.pose = Some(pose);
    }
    respond(state, probe, &pose)
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

fn press(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose, passes: usize) {
    state.reach_all(probe);
    measure(probe, state, pose);
    reach(probe, state);
    for pass in 0..passes {
        state.report.passes += 1;
        if pass == 0 || !turn(probe, state, pass) {
            list(probe, state, pass);
            condense(probe, state);
        }
        for (at, &point) in state.near.iter().enumerate() {
            state.pushed[point as usize] = state.outward[at];
        }
        state.move_wall(probe);
        measure(probe, state, pose);
        let n = state.near.len();
        for (a, &point) in state.near.iter().enumerate() {
            state.problem.forces_n[a] = state.pressed_n[point as usize];
        }
        // The problem may be that of directions which have turned a little since: what its forces close is taken from the gaps as they are.
        for (a, &point) in state.near.iter().enumerate() {
            state.problem.free_m[a] = state.gaps_m[point as usize] - state.problem.closes_m(a);
        }
        state.problem.solve();
        state.report.rounds = state.report.rounds.max(state.problem.rounds as u32);
        state.report.near = n as u32;
        take_forces(probe, state);
        measure(probe, state, pose);
        [state.report.open_m, state.report.turned] = left_over(probe, state);
        if state.report.open_m <= CLOSED_M && state.report.turned <= TURNED {
            break;
        }
    }
    // A point that was not looked at may have got there.
    state.reach_all(probe);
    measure(probe, state, pose);
    state.report.open_m = left_over(probe, state)[0];
}

/// How far the points that are looked at are from the probe.
fn measure(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose) {
    for &n in &state.reach {
        let n = n as usize;
        (state.gaps_m[n], state.surface[n]) = probe.shape.gap_m(pose, place_m(probe, state, n));
    }
}

/// The probe's surface there faces into the wall.
fn faces(probe: &ReadyProbe, state: &ProbeState, n: usize) -> bool {
    let along: f64 = (0..3)
        .map(|c| state.surface[n][c] * probe.wall.points[n].outward[c])
        .sum();
    along < FACING
}

/// Points that are looked at on the way to a pose: those near the probe whose wall it faces, and those that were pressed.
fn reach(probe: &ReadyProbe, state: &mut ProbeState) {
    state.reach.clear();
    for n in 0..probe.wall.points.len() {
        if state.pressed_n[n] > 0.0 || (faces(probe, state, n) && state.gaps_m[n] < REACH_M) {
            state.reach.push(n as u32);
        }
    }
}

/// Forces turn to the probe's surface. False where other points may be in contact than before, or the directions are others than those of the problem.
fn turn(probe: &ReadyProbe, state: &mut ProbeState, pass: usize) -> bool {
    for at in 0..state.near.len() {
        let n = state.near[at] as usize;
        let outward = state.turned(n, pass);
        let off: f64 = (0..3).map(|c| (outward[c] - state.condensed[at][c]).powi(2)).sum();
        if state.is_missed || !faces(probe, state, n) || off > OTHERWISE * OTHERWISE {
            return false;
        }
        state.outward[at] = outward;
    }
    true
}

/// Points that may be in contact.
fn list(probe: &ReadyProbe, state: &mut ProbeState, pass: usize) {
    state.near.clear();
    state.is_near.fill(false);
    for at in 0..state.reach.len() {
        let n = state.reach[at] as usize;
        if faces(probe, state, n) && (state.pressed_n[n] > 0.0 || state.gaps_m[n] < NEAR_M) {
            state.outward[state.near.len()] = state.turned(n, pass);
            state.near.push(n as u32);
            state.is_near[n] = true;
        }
    }
}

/// How the gaps of the points that are near close with the forces on each.
fn condense(probe: &ReadyProbe, state: &mut ProbeState) {
    let n = state.near.len();
    state.problem.count = n;
    for a in 0..n {
        let (rows, outward) = (probe.between(state.near[a] as usize), state.outward[a]);
        for b in 0..=a {
            let value = along(rows, state.near[b] as usize, outward, state.outward[b]);
            state.problem.matrix[a * n + b] = value;
            state.problem.matrix[b * n + a] = value;
        }
    }
    state.condensed[..n].copy_from_slice(&state.outward[..n]);
    state.problem.is_new();
}

/// How far point `b` moves along a direction by a newton on another along its own.
#[inline]
fn along(rows: [&[f32]; 3], b: usize, own: [f64; 3], to: [f64; 3]) -> f64 {
    let moved = |row: &[f32]| match row.get(3 * b..3 * b + 3) {
        Some(m) => f64::from(m[0]) * to[0] + f64::from(m[1]) * to[1] + f64::from(m[2]) * to[2],
        None => 0.0,
    };
    own[0] * moved(rows[0]) + own[1] * moved(rows[1]) + own[2] * moved(rows[2])
}

/// The direction of a force, that part of the way to another.
fn turned(before: [f64; 3], outward: [f64; 3], part: f64) -> [f64; 3] {
    let before = Vector3::from(before);
    let mixed = before + (Vector3::from(outward) - before) * part;
    mixed.try_normalize(1e-9).map_or(outward, Into::into)
}

/// Where a point of the wall is.
fn place_m(probe: &ReadyProbe, state: &ProbeState, n: usize) -> [f64; 3] {
    let rest_m = probe.wall.points[n].place_m;
    [0, 1, 2].map(|c| rest_m[c] + state.moved_m[n][c] + state.beside_m[n][c])
}

fn take_forces(probe: &ReadyProbe, state: &mut ProbeState) {
    state.pressed_n.fill(0.0);
    for (at, &point) in state.near.iter().enumerate() {
        let force_n = state.problem.forces_n[at].max(0.0);
        if force_n > 0.0 {
            (state.pressed_n[point as usize], state.pushed[point as usize]) = (force_n, state.outward[at]);
        }
    }
    state.move_wall(probe);
}

/// How far points are on the wrong side: those that are pressed on either, the others in the probe. And how far a force is from square to the
/// probe's surface.
fn left_over(probe: &ReadyProbe, state: &mut ProbeState) -> [f64; 2] {
    let (mut open_m, mut turned) = (0.0_f64, 0.0_f64);
    state.is_missed = false;
    for at in 0..state.reach.len() {
        let n = state.reach[at] as usize;
        if state.pressed_n[n] > 0.0 {
            open_m = open_m.max(state.gaps_m[n].abs());
            let off = (0..3)
                .map(|c| (state.pushed[n][c] - state.surface[n][c]).powi(2))
                .sum::<f64>();
            turned = turned.max(off.sqrt());
        } else if faces(probe, state, n) {
            open_m = open_m.max(-state.gaps_m[n]);
            state.is_missed |= !state.is_near[n] && state.gaps_m[n] < 0.0;
        }
    }
    [open_m, turned]
}

fn respond(state: &mut ProbeState, probe: &ReadyProbe, pose: &ProbePose) -> ProbeResponse {
    let mut response = ProbeResponse::nothing(*pose);
    let tip = Vector3::from(pose.tip_m);
    // Of the points in contact: how each gap closes with the six motions of the probe.
    let arm = |state: &ProbeState, at: usize| {
        let place_m = Vector3::from(place_m(probe, state, state.near[at] as usize));
        let outward = Vector3::from(state.outward[at]);
        let turning = (place_m - tip).cross(&outward);
        [outward.x, outward.y, outward.z, turning.x, turning.y, turning.z]
    };
    for at in 0..state.near.len() {
        let force_n = state.pressed_n[state.near[at] as usize];
        if force_n > 0.0 {
            response.contacts += 1;
            let arm = arm(state, at);
            for (sum, arm) in response.wrench.0.iter_mut().zip(arm) {
                *sum -= force_n * arm;
            }
        }
    }
    if response.contacts == 0 {
        return response;
    }
    // The room is taken out meanwhile, so that the factor beside it can be read.
    let mut room = std::mem::take(&mut state.problem.work);
    let values = room.get_mut(..state.problem.set.len()).unwrap_or(&mut []);
    for motion in 0..6 {
        for (value, &at) in values.iter_mut().zip(&state.problem.set) {
            *value = arm(state, at as usize)[motion];
        }
        state.problem.back(values);
        for (value, &at) in values.iter().zip(&state.problem.set) {
            for (row, arm) in response.stiffness.iter_mut().zip(arm(state, at as usize)) {
                row[motion] -= value * arm;
            }
        }
    }
    state.problem.work = room;
    response
}
