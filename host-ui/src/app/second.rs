//! Goals for the simulated hand that holds the probe, from keys, gamepad, pointer and stepper.

use super::App;
use crate::action::ProbeAction;
use nalgebra::Vector3;
use stylet_controllers::{ProbeWish, SLOWEST_M_PER_S};
use stylet_imaging::ultrasound::{Pose, Probe};
use stylet_shm_schema::{HandMove, ProbeMove, Request};
use web_time::{Duration, Instant};

/// Largest lead over a hand that is held back.
const LEAD_M: f64 = 0.004;
const LEAD_RAD: f64 = 0.2;
/// Time for which the hand continues without another goal, so that a window that hangs stops it.
const HOLD_S: f64 = 0.15;
/// Shortest time between two goals, at any frame rate.
const GOALS_EVERY: Duration = Duration::from_millis(10);
const ACCELERATION_M_PER_S2: f64 = 2.0;
/// Speed of the stepper, and of a hand on the picture.
const STEP_M_PER_S: f64 = 0.05;
/// Distance from the stepper's setting beyond which another host has moved the probe, and the time
/// for which it must last.
const MOVED_M: f64 = 2e-3;
const MOVED_AFTER: Duration = Duration::from_secs(3);

/// Second hand while it is driven, and the stepper.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SecondDrive {
    at: Option<Pose>,
    unsent_s: f64,
    stepper: Option<(Pose, Instant)>,
    is_locked: bool,
}

/// Requested speed of the probe in the scene frame, and of its turn about its axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speed {
    pub m_per_s: Vector3<f64>,
    pub rad_per_s: f64,
}

impl Speed {
    fn went(&self, from: &Pose, time_s: f64) -> Pose {
        let turned = from.moved(0.0, self.rad_per_s * time_s);
        Pose {
            middle_m: from.middle_m + self.m_per_s * time_s,
            ..turned
        }
    }
}

impl SecondDrive {
    /// Returns the next goal when one is due.
    pub fn step(&mut self, wish: &Speed, now: &Pose, frame_s: f64) -> Option<Pose> {
        self.unsent_s += frame_s.clamp(0.0, HOLD_S);
        if self.at.is_some() && self.unsent_s < GOALS_EVERY.as_secs_f64() {
            return None;
        }
        let went_s = if self.at.is_some() { self.unsent_s } else { 0.0 };
        self.unsent_s = 0.0;
        let went = wish.went(&self.at.unwrap_or(*now), went_s);
        let ahead_m = went.middle_m - now.middle_m;
        let share = (LEAD_M / ahead_m.norm().max(LEAD_M)).min(1.0);
        let (_, ahead_rad) = went.way_and_turn(now);
        let at = Pose {
            middle_m: now.middle_m + ahead_m * share,
            ..now.moved(0.0, ahead_rad.clamp(-LEAD_RAD, LEAD_RAD))
        };
        self.at = Some(at);
        self.stepper = None;
        Some(wish.went(&at, HOLD_S))
    }

    /// Returns whether the keys were just released, so that the core must stop the hand.
    pub fn stop(&mut self) -> bool {
        self.at.take().is_some()
    }

    /// Returns the stepper's setting, unless another host has moved the probe since.
    fn goal(&mut self, now: &Pose) -> Option<Pose> {
        let is_off = |goal: &Pose| (goal.middle_m - now.middle_m).norm() > MOVED_M;
        self.stepper
            .take_if(|(goal, at)| at.elapsed() > MOVED_AFTER && is_off(goal));
        self.stepper.map(|(goal, _)| goal)
    }
}

impl App {
    /// Takes the stepper's state for display. Shows nothing without a second hand, or if a real
    /// hand holds it.
    pub(super) fn take_stepper(&mut self) {
        let held = self.shown.probe_pose().filter(|_| self.shown.is_second_simulated());
        match held {
            Some(now) => self.shown.stepper.goal = self.second_drive.goal(&now),
            None => self.second_drive = SecondDrive::default(),
        }
        self.shown.stepper.is_locked = self.second_drive.is_locked;
        if held.is_none() {
            self.shown.stepper.goal = None;
        }
    }

    /// Moves the second hand by held keys and a second gamepad; releasing them stops it.
    pub(super) fn drive_second(&mut self, keys_m_per_s: [f64; 3], gamepad: ProbeWish, frame_s: f64) {
        let now = self.shown.probe_pose().filter(|_| self.shown.is_second_simulated());
        let Some(now) = now.filter(|_| !self.watches()) else {
            self.second_drive = SecondDrive::default();
            return;
        };
        let wish = Speed {
            m_per_s: Vector3::from(keys_m_per_s) + now.axis * gamepad.along_m_per_s,
            rad_per_s: gamepad.turn_rad_per_s,
        };
        if wish == Speed::default() {
            if self.second_drive.stop() {
                self.send("Stop second hand", &Request::StopSecondHand);
            }
        } else if self.second_drive.is_locked {
            self.refuse_locked();
        } else if let Some(goal) = self.second_drive.step(&wish, &now, frame_s) {
            self.move_probe(&goal, wish.m_per_s.norm());
        }
    }

    pub(super) fn act_on_probe(&mut self, action: ProbeAction) {
        let Some(now) = self.shown.probe_pose().filter(|_| self.shown.is_second_simulated()) else {
            return;
        };
        match action {
            ProbeAction::ToggleBrake => {
                self.second_drive.is_locked = !self.second_drive.is_locked;
                if self.second_drive.is_locked && self.second_drive.stop() {
                    self.send("Stop second hand", &Request::StopSecondHand);
                }
            }
            ProbeAction::Drag { .. } if self.second_drive.is_locked => self.refuse_locked(),
            ProbeAction::Drag { way_m, turn_rad } | ProbeAction::Step { way_m, turn_rad } => {
                let from = self.second_drive.goal(&now).unwrap_or(now);
                let goal = from.moved(way_m, turn_rad);
                self.second_drive.stepper = Some((goal, Instant::now()));
                self.move_probe(&goal, STEP_M_PER_S);
            }
        }
        self.take_stepper();
    }

    fn refuse_locked(&mut self) {
        let why = "The stepper's brake holds the probe: key B releases it, PgUp and PgDn step it.";
        self.refuse(why);
    }

    fn move_probe(&mut self, goal: &Pose, speed_m_per_s: f64) {
        let hand = HandMove {
            tip_m: goal.tip_m(&Probe::default()).into(),
            direction: goal.axis.into(),
            speed_m_per_s: speed_m_per_s.max(SLOWEST_M_PER_S),
            acceleration_m_per_s2: ACCELERATION_M_PER_S2,
        };
        let up = Some(goal.up.into());
        self.send("Second hand", &Request::MoveSecondHand(ProbeMove { hand, up }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn start() -> Pose {
        Pose::of_tool(Vector3::zeros(), &UnitQuaternion::identity(), &Probe::default())
    }

    #[test]
    fn the_probe_s_hand_moves_at_its_wished_speed() {
        let wish = Speed {
            m_per_s: Vector3::new(0.0, 0.03, 0.04),
            rad_per_s: 0.5,
        };
        let (mut drive, mut pose) = (SecondDrive::default(), start());
        let mut goal = pose;
        for _ in 0..60 {
            goal = drive.step(&wish, &pose, 0.016).unwrap_or(goal);
            let left: Vector3<f64> = goal.middle_m - pose.middle_m;
            let (_, turn_left) = goal.way_and_turn(&pose);
            pose = pose.moved(0.0, turn_left.clamp(-0.5 * 0.016, 0.5 * 0.016));
            pose.middle_m += left * (0.05 * 0.016 / left.norm()).min(1.0);
        }
        let (went_m, wished_m) = ((pose.middle_m - start().middle_m).norm(), 0.05 * 60.0 * 0.016);
        assert!((went_m - wished_m).abs() < 1e-3, "{went_m}");
        let (_, turned) = pose.way_and_turn(&start());
        assert!((turned - 0.5 * 60.0 * 0.016).abs() < 0.02, "{turned}");
        assert!(drive.stop() && !drive.stop());
        let mut held = SecondDrive::default();
        for frame_s in [0.016, 100.0].repeat(500) {
            let goal = held.step(&wish, &start(), frame_s).unwrap_or(start());
            let ahead_m = (goal.middle_m - start().middle_m).norm();
            assert!(ahead_m <= LEAD_M + 0.05 * HOLD_S + 1e-12);
            let (_, ahead_rad) = goal.way_and_turn(&start());
            assert!(ahead_rad <= LEAD_RAD + 0.5 * HOLD_S + 1e-12);
        }
    }

    #[test]
    fn the_stepper_keeps_its_goal_until_a_hand_moves_the_probe() {
        let mut drive = SecondDrive::default();
        let goal = start().moved(5e-3, 0.1);
        drive.stepper = Some((goal, Instant::now()));
        assert_eq!(drive.goal(&start()), Some(goal), "it is on its way");
        let Some(long_ago) = Instant::now().checked_sub(MOVED_AFTER * 2) else {
            return;
        };
        drive.stepper = Some((goal, long_ago));
        assert_eq!(drive.goal(&goal), Some(goal), "it is there");
        assert_eq!(drive.goal(&start()), None, "another has moved it");
        drive.stepper = Some((goal, Instant::now()));
        let wish = Speed {
            rad_per_s: 0.1,
            ..Speed::default()
        };
        drive.step(&wish, &start(), 0.016);
        assert_eq!(drive.stepper, None);
    }
}
