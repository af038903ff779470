//! Coupled mode: the tissue's answer at 200 Hz, extrapolated to 1 kHz.
//!
//! The tissue loop reports the force of its body, the travel of the held element that it answers to, and how
//! stiffly it would answer more. The haptic loop knows that travel at 1 kHz, so the force between two answers
//! follows to first order. What an answer then corrects is blended in over one tissue period: no staircase.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Response of the tissue at the tip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LocalResponse {
    /// Tick of the tissue loop; 0 for no answer.
    pub tick: u64,
    /// Travel of the held element since the loop began that the body has answered to.
    pub travel_m: Vector3<f64>,
    /// Displacement of the held element from rest, m.
    pub displacement_m: Vector3<f64>,
    /// Force on the needle, before the force scale, where the body knows forces.
    pub force_n: Option<Vector3<f64>>,
}

impl Default for LocalResponse {
    fn default() -> Self {
        Self {
            tick: 0,
            travel_m: Vector3::zeros(),
            displacement_m: Vector3::zeros(),
            force_n: None,
        }
    }
}

/// Nearer to rest than this, a stiffness cannot be read from force and displacement.
const SHORTEST_M: f64 = 1e-4;

impl LocalResponse {
    /// Returns the force, and the stiffness that would be added: the ratio of both for a linear body;
    /// `stiffness_n_per_m` for a body without forces.
    fn linear(&self, stiffness_n_per_m: f64) -> (Vector3<f64>, f64) {
        let u = self.displacement_m;
        match self.force_n {
            None => (u * -stiffness_n_per_m, stiffness_n_per_m),
            Some(force_n) if u.norm() > SHORTEST_M => (force_n, (-force_n.dot(&u) / u.norm_squared()).max(0.0)),
            Some(force_n) => (force_n, stiffness_n_per_m),
        }
    }
}

/// State that one tick leaves to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CouplingState {
    answered: u64,
    /// Correction by the last answer, and the share of it still to be blended in.
    correction_n: Vector3<f64>,
    share: f64,
    force_n: Vector3<f64>,
}

impl CouplingState {
    /// Forgets the answers: the tip holds no tissue.
    pub fn release(&mut self) {
        *self = Self::default();
    }

    /// Returns whether the tissue's force would drive a tip that slips by `slip_m`: friction does not, so the tissue
    /// goes along instead.
    pub fn drives(&self, slip_m: &Vector3<f64>) -> bool {
        self.force_n.dot(slip_m) > 0.0
    }
}

/// The tissue's answer along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TissueForce {
    /// Force on the hand, positive inwards.
    pub along_n: f64,
    /// Energy that the tissue holds along the path and may give back: half of force times displacement.
    pub stored_j: f64,
}

/// Returns the tissue's force on the hand now, along `axis`; `blend_ticks` is one tissue period in ticks of the caller.
pub fn step(
    state: &mut CouplingState,
    response: &LocalResponse,
    travel_m: &Vector3<f64>,
    stiffness_n_per_m: f64,
    axis: &Vector3<f64>,
    blend_ticks: u32,
) -> Option<TissueForce> {
    if response.tick == 0 {
        state.release();
        return None;
    }
    let (force_n, stiffness_n_per_m) = response.linear(stiffness_n_per_m);
    let ahead_m = travel_m - response.travel_m;
    let ahead_n = force_n - ahead_m * stiffness_n_per_m;
    if response.tick != state.answered {
        let first = state.answered == 0;
        state.answered = response.tick;
        state.correction_n = if first {
            Vector3::zeros()
        } else {
            state.force_n - ahead_n
        };
        state.share = 1.0;
    }
    state.share = (state.share - 1.0 / f64::from(blend_ticks.max(1))).max(0.0);
    state.force_n = ahead_n + state.correction_n * state.share;
    let along_n = state.force_n.dot(axis);
    Some(TissueForce {
        along_n,
        stored_j: 0.5 * (along_n * (response.displacement_m + ahead_m).dot(axis)).abs(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

    /// Moves a tip in at 50 mm/s against tissue that stiffens; answers come every fifth tick, one late. Returns error
    /// and longest step; `held` extrapolates nothing.
    fn errors(held: bool) -> (f64, f64) {
        let exact = |z: f64| -(600.0 * z + 5e3 * z * z);
        let (mut state, mut response) = (CouplingState::default(), LocalResponse::default());
        let (mut worst, mut longest, mut before) = (0.0f64, 0.0f64, None);
        for tick in 0..400u64 {
            let z = 5e-5 * tick as f64;
            let travel = if held { response.travel_m } else { AXIS * z };
            let force = step(&mut state, &response, &travel, 700.0, &AXIS, if held { 1 } else { 5 });
            if tick % 5 == 0 {
                response = LocalResponse {
                    tick: tick / 5 + 1,
                    travel_m: AXIS * z,
                    displacement_m: AXIS * z,
                    force_n: Some(AXIS * exact(z)),
                };
            }
            if let Some(TissueForce { along_n: force, .. }) = force {
                worst = worst.max((force - exact(z)).abs());
                longest = longest.max(before.map_or(0.0, |b: f64| (force - b).abs()));
                before = Some(force);
            }
        }
        (worst, longest)
    }

    #[test]
    fn first_order_follows_between_answers_without_a_staircase() {
        let (held, stairs) = errors(true);
        let (carried, steps) = errors(false);
        println!("error {carried:.4} N, step {steps:.4} N; held answers: {held:.4} N, {stairs:.4} N");
        assert!(carried < 0.3 * held, "{carried} N against {held} N");
        // 50 um against 800 N/m is 0.04 N.
        assert!(steps < 0.05, "a step of {steps} N");
    }

    #[test]
    fn tissue_without_forces_answers_by_displacement() {
        let response = LocalResponse {
            tick: 1,
            displacement_m: AXIS * 2e-3,
            ..LocalResponse::default()
        };
        let mut state = CouplingState::default();
        let force = step(&mut state, &response, &(AXIS * 1e-3), 700.0, &AXIS, 5).unwrap();
        assert!((force.along_n + 700.0 * 3e-3).abs() < 1e-12);
        assert!((force.stored_j - 0.5 * 700.0 * 3e-3 * 3e-3).abs() < 1e-12);
        // Pulled back, the tissue would push the needle through itself; pushed on, it resists.
        assert!(state.drives(&(AXIS * -1e-5)) && !state.drives(&(AXIS * 1e-5)));
    }

    #[test]
    fn no_answer_is_no_force() {
        let mut state = CouplingState::default();
        let none = LocalResponse::default();
        assert_eq!(step(&mut state, &none, &AXIS, 700.0, &AXIS, 5), None);
    }
}
