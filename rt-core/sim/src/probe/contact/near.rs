//! Points of the wall that may be in contact: where the probe's surface is there, where their forces go, and the
//! problem of these forces.

use super::{ProbeState, place_m};
use crate::probe::columns::ReadyProbe;
use crate::probe::shape::ProbePose;
use nalgebra::Vector3;

/// Distance from the probe up to which points are examined on the way to a pose, and in a pass.
const REACH_M: f64 = 4e-3;
const NEAR_M: f64 = 0.15e-3;
/// Least cosine between the probe's surface and the wall's normal at a pressed point: it is pressed from the side of
/// the hollow.
const FACING: f64 = 0.2;
/// Angle by which a force may turn before the problem is condensed again.
const OTHERWISE: f64 = 0.03;

/// Returns the share of the way to the surface that a force turns in a pass: farther in every other pass, since one
/// that has turned moves its point on by up to half as much again; and half as far from the 12th on, since a lightly
/// pressed point may be in contact in every other pass.
fn part_of(pass: usize) -> f64 {
    match pass {
        12.. => 0.5,
        2.. if pass.is_multiple_of(2) => 1.8,
        _ => 1.0,
    }
}

/// Measures the distance of the examined points from the probe.
pub(super) fn measure(probe: &ReadyProbe, state: &mut ProbeState, pose: &ProbePose) {
    for &n in &state.reach {
        let n = n as usize;
        (state.gaps_m[n], state.surface[n]) = probe.shape.gap_m(pose, place_m(probe, state, n));
    }
}

/// Returns whether the probe's surface faces into the wall there.
fn faces(probe: &ReadyProbe, state: &ProbeState, n: usize) -> bool {
    let along: f64 = (0..3)
        .map(|c| state.surface[n][c] * probe.wall.points[n].outward[c])
        .sum();
    along < FACING
}

/// Finds the points to examine on the way to a pose: those near the probe whose wall it faces, and those that were
/// pressed.
pub(super) fn reach(probe: &ReadyProbe, state: &mut ProbeState) {
    state.reach.clear();
    for n in 0..probe.wall.points.len() {
        if state.pressed_n[n] > 0.0 || (faces(probe, state, n) && state.gaps_m[n] < REACH_M) {
            state.reach.push(n as u32);
        }
    }
}

/// Turns the forces to the probe's surface. Returns false where other points may be in contact than before, or the
/// directions differ from those of the problem.
pub(super) fn turn(probe: &ReadyProbe, state: &mut ProbeState, pass: usize) -> bool {
    for at in 0..state.near.len() {
        let n = state.near[at] as usize;
        let outward = towards(state, n, pass);
        let off: f64 = (0..3).map(|c| (outward[c] - state.condensed[at][c]).powi(2)).sum();
        if state.is_missed || !faces(probe, state, n) || off > OTHERWISE * OTHERWISE {
            return false;
        }
        state.outward[at] = outward;
    }
    true
}

/// Lists the points that may be in contact.
pub(super) fn list(probe: &ReadyProbe, state: &mut ProbeState, pass: usize) {
    state.near.clear();
    state.is_near.fill(false);
    for at in 0..state.reach.len() {
        let n = state.reach[at] as usize;
        if faces(probe, state, n) && (state.pressed_n[n] > 0.0 || state.gaps_m[n] < NEAR_M) {
            state.outward[state.near.len()] = towards(state, n, pass);
            state.near.push(n as u32);
            state.is_near[n] = true;
        } else {
            // The probe is no longer on its side of the wall.
            state.pressed_n[n] = 0.0;
        }
    }
}

/// Computes how the gaps of the near points close with the forces on each.
pub(super) fn condense(probe: &ReadyProbe, state: &mut ProbeState) {
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

/// Returns the displacement of point `b` along a direction by a newton on another along its own.
#[inline]
fn along(rows: [&[f32]; 3], b: usize, own: [f64; 3], to: [f64; 3]) -> f64 {
    let moved = |row: &[f32]| match row.get(3 * b..3 * b + 3) {
        Some(m) => f64::from(m[0]) * to[0] + f64::from(m[1]) * to[1] + f64::from(m[2]) * to[2],
        None => 0.0,
    };
    own[0] * moved(rows[0]) + own[1] * moved(rows[1]) + own[2] * moved(rows[2])
}

/// Returns the direction towards which the force of a point turns in a pass: a point that did not press has none
/// before.
fn towards(state: &ProbeState, n: usize, pass: usize) -> [f64; 3] {
    match state.pressed_n[n] > 0.0 {
        true => turned(state.pushed[n], state.surface[n], part_of(pass)),
        false => state.surface[n],
    }
}

/// Turns the direction of a force that part of the way to another.
fn turned(before: [f64; 3], outward: [f64; 3], part: f64) -> [f64; 3] {
    let before = Vector3::from(before);
    let mixed = before + (Vector3::from(outward) - before) * part;
    mixed.try_normalize(1e-9).map_or(outward, Into::into)
}

/// Returns how far points are on the wrong side: pressed ones on either, the others inside the probe. The second is the
/// largest angle of a force from square to the probe's surface.
pub(super) fn left_over(probe: &ReadyProbe, state: &mut ProbeState) -> [f64; 2] {
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
