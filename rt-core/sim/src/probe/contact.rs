//! One tick of the probe: pushing forces between it and the wall, and the displacement of the body by them.

mod near;

use super::columns::ReadyProbe;
use super::complementarity::Problem;
use super::moves;
use super::response::ProbeResponse;
use super::shape::ProbePose;
use crate::tissue::ElementField;
use nalgebra::Vector3;
use near::{condense, left_over, list, measure, reach, turn};

/// Largest motion in one step: a farther pose is reached in several, since the wall leaves the probe towards the
/// nearest side.
const STEP_M: f64 = 2e-3;
const MOST_STEPS: usize = 8;
/// Largest number of passes over the directions of the forces at the end of a tick, and in a step on the way there.
const PASSES: usize = 16;
const PASSES_ON_THE_WAY: usize = 2;
/// Tolerances of the last pass: distance of a pad on the wrong side of the probe's surface, and angle of a force from
/// its normal.
const CLOSED_M: f64 = 4e-7;
const TURNED: f64 = 2e-4;

/// Outcome of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactReport {
    /// Number of passes in all of its steps.
    pub passes: u32,
    /// Largest number of rounds of active sets in a pass.
    pub rounds: u32,
    /// Number of examined pads.
    pub near: u32,
    /// Deepest pad in the probe, and the largest gap under a force, m.
    pub open_m: f64,
    /// Largest angle between a force and the normal of the probe's surface, rad.
    pub turned: f64,
}

/// State of a probe; nothing is allocated after `new`.
#[derive(Clone, Debug)]
pub struct ProbeState {
    pose: Option<ProbePose>,
    /// Forces on the tissue at each pad, along x, y, z, N.
    loads_n: Vec<f64>,
    /// Displacement of each point by them, and by others, m.
    pub(super) moved_m: Vec<[f64; 3]>,
    beside_m: Vec<[f64; 3]>,
    /// Work space for the displacement of the pads by others.
    pads_m: Vec<f64>,
    /// Force on each point, N, and its direction.
    pressed_n: Vec<f64>,
    pushed: Vec<[f64; 3]>,
    /// Examined points, with the distance of each from the probe, m, and the normal of its surface there.
    reach: Vec<u32>,
    gaps_m: Vec<f64>,
    surface: Vec<[f64; 3]>,
    /// Points that may be in contact, the directions of their forces, and those when the problem was condensed.
    near: Vec<u32>,
    is_near: Vec<bool>,
    outward: Vec<[f64; 3]>,
    condensed: Vec<[f64; 3]>,
    /// Set where a point overlaps that was taken to be out of contact.
    is_missed: bool,
    problem: Problem,
    /// Displacement of the body by the loads, m.
    pub share: ElementField,
    report: ContactReport,
}

impl ProbeState {
    /// Makes a state without contact.
    pub fn new(probe: &ReadyProbe) -> Self {
        let (rows, points) = (probe.rows(), probe.wall.points.len());
        let elements = probe
            .solved
            .columns
            .first()
            .map_or(0, crate::tissue::PackedField::elements);
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

    /// Iterates over the force of the probe on each point of the wall, N, and its direction; no direction without a
    /// force.
    pub fn pressed(&self) -> impl Iterator<Item = (f64, [f64; 3])> {
        let pressed = self.pressed_n.iter().copied().zip(self.pushed.iter().copied());
        pressed.map(|(force_n, to)| (force_n, if force_n > 0.0 { to } else { [0.0; 3] }))
    }

    /// Returns the pose of the last tick.
    pub(super) fn pose(&self) -> Option<ProbePose> {
        self.pose
    }

    /// Continues from forces on the points of the wall.
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

    /// Returns the report of the last tick.
    pub fn report(&self) -> ContactReport {
        self.report
    }

    /// Brings the tissue to rest, and the probe out of it.
    pub fn reset(&mut self) {
        self.pose = None;
        for values in [&mut self.loads_n, &mut self.pressed_n] {
            values.fill(0.0);
        }
        self.moved_m.fill([0.0; 3]);
    }
}

/// Moves the probe to `pose`; `beside_m` is the displacement of each pad by other loads, along x, y, z. A pose that is
/// not finite counts as the one before.
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

/// Returns the number of steps, by the point of the probe in the wall that moves the farthest.
fn steps_between(from: &ProbePose, to: &ProbePose) -> usize {
    /// Distance from the tip to the end of the wall.
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
        // The directions may have turned a little since the problem was condensed: its forces close the present gaps.
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
    // A point that was not examined may have come into contact.
    state.reach_all(probe);
    measure(probe, state, pose);
    state.report.open_m = left_over(probe, state)[0];
}

/// Returns the place of a point of the wall.
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
    // The work space is taken out meanwhile, so that the factor next to it can be read.
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
