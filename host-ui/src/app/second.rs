//! Goals for the simulated hand that holds the second device, from the speed that keys ask for.

use super::App;
use nalgebra::Vector3;
use std::time::Duration;
use stylet_controllers::Wish;
use stylet_shm_schema::{HandMove, Request, flags};

/// A hand that is held back lags behind by no more than this.
const LEAD_M: f64 = 0.004;
/// The hand goes on without another goal for so long: a window that hangs stops it.
const HOLD_S: f64 = 0.15;
/// Goals are sent no more often, whatever the frame rate.
const GOALS_EVERY: Duration = Duration::from_millis(10);
const ACCELERATION_M_PER_S2: f64 = 2.0;

/// The other hand while it is driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SecondDrive {
    at_m: Option<Vector3<f64>>,
    unsent_s: f64,
}

impl SecondDrive {
    /// The next goal, where it is time for one.
    pub fn step(&mut self, wish: Vector3<f64>, tip_m: Vector3<f64>, frame_s: f64) -> Option<Vector3<f64>> {
        self.unsent_s += frame_s.clamp(0.0, HOLD_S);
        if self.at_m.is_some() && self.unsent_s < GOALS_EVERY.as_secs_f64() {
            return None;
        }
        let went_s = if self.at_m.is_some() { self.unsent_s } else { 0.0 };
        self.unsent_s = 0.0;
        let went_m = self.at_m.unwrap_or(tip_m) + wish * went_s;
        let ahead_m = went_m - tip_m;
        let share = (LEAD_M / ahead_m.norm().max(LEAD_M)).min(1.0);
        let at_m = tip_m + ahead_m * share;
        self.at_m = Some(at_m);
        Some(at_m + wish * HOLD_S)
    }

    /// Whether the keys were released just now, so that the core must stop the hand itself.
    pub fn stop(&mut self) -> bool {
        self.at_m.take().is_some()
    }
}

impl App {
    /// The needle's hand, and the other one.
    pub(super) fn drive_both(&mut self, needle: Wish, other_m_per_s: [f64; 3], frame_s: f64) {
        self.drive(needle, frame_s);
        self.drive_second(other_m_per_s, frame_s);
    }

    /// Held keys move the other hand; letting go stops it. Nothing in a run without a second device, or over one that a real hand holds.
    fn drive_second(&mut self, wish_m_per_s: [f64; 3], frame_s: f64) {
        let wish = Vector3::from(wish_m_per_s);
        let is_simulated = self
            .shown
            .second
            .is_some_and(|s| s.flags & flags::SIMULATED_DEVICE != 0);
        let pose = self.shown.second_tip_m().zip(self.shown.second_axis());
        let (Some((tip_m, direction)), true) = (pose, is_simulated && self.shown.is_live() && !self.watches()) else {
            self.second_drive = SecondDrive::default();
            return;
        };
        if wish == Vector3::zeros() {
            if self.second_drive.stop() {
                self.send("Stop other hand", &Request::StopSecondHand);
            }
            return;
        }
        if let Some(goal) = self.second_drive.step(wish, tip_m.into(), frame_s) {
            let hand = HandMove {
                tip_m: goal.into(),
                direction,
                speed_m_per_s: wish.norm(),
                acceleration_m_per_s2: ACCELERATION_M_PER_S2,
            };
            self.send("Other hand", &Request::MoveSecondHand(hand));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hand_goes_as_fast_as_it_is_wished_and_no_goal_runs_away_from_one_that_is_held_back() {
        let wish = Vector3::new(0.0, 0.03, 0.04);
        let (mut drive, mut tip) = (SecondDrive::default(), Vector3::zeros());
        let mut goal = Vector3::zeros();
        for _ in 0..60 {
            goal = drive.step(wish, tip, 0.016).unwrap_or(goal);
            let left: Vector3<f64> = goal - tip;
            tip += left * (0.05 * 0.016 / left.norm()).min(1.0);
        }
        assert!((tip.norm() - 0.05 * 60.0 * 0.016).abs() < 1e-3, "{tip}");
        assert!(drive.stop() && !drive.stop());
        let mut held = SecondDrive::default();
        for frame_s in [0.016, 100.0].repeat(500) {
            let goal = held.step(wish, Vector3::zeros(), frame_s);
            assert!(goal.is_none_or(|goal| goal.norm() <= LEAD_M + 0.05 * HOLD_S + 1e-12));
        }
    }
}
