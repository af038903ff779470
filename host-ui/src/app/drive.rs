//! Goals for the simulated hand, from the speed that keys, stick or cap ask for.

use crate::shown::TipOnPath;
use std::time::Duration;
use stylet_controllers::{SLOWEST_M_PER_S, Wish};

/// The goal of a driven needle runs ahead of the tip by no more than this, so that it stops when the keys or the device are released.
const LEAD_M: f64 = 0.004;
/// The needle may be drawn back so far before the entry.
pub const BEFORE_ENTRY_M: f64 = 0.02;
/// A longer frame counts as this long, so that a hiccup is not a jump of the needle.
const LONGEST_S: f64 = 0.05;
/// Goals are sent no more often, whatever the frame rate.
const GOALS_EVERY: Duration = Duration::from_millis(10);
/// The needle goes across the template only with its tip before this depth.
const OUTSIDE_M: f64 = 1e-3;

/// For the simulated hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    pub depth_m: f64,
    pub speed_m_per_s: f64,
}

/// A needle that is being driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Where it is sent, while it is driven.
    goal_m: Option<f64>,
    /// Beside the planned path; every goal of the window is, so that a needle in the tissue is not pulled aside.
    pub beside_m: [f64; 2],
    unsent_s: f64,
}

impl Drive {
    pub fn is_on(&self) -> bool {
        self.goal_m.is_some()
    }

    /// Nobody drives any more, and nothing is to be sent.
    pub fn forget(&mut self) {
        self.goal_m = None;
    }

    /// Whether the wish is one that is followed here: across only outside.
    pub fn follows(wish: &Wish, tip: &TipOnPath) -> bool {
        wish.along_m_per_s != 0.0 || (wish.across_m_per_s != [0.0; 2] && is_outside(tip))
    }

    /// The next goal, where it is time for one. The wish must be one that is followed.
    pub fn step(&mut self, wish: &Wish, tip: &TipOnPath, frame_s: f64) -> Option<Goal> {
        self.unsent_s += frame_s.clamp(0.0, LONGEST_S);
        if self.is_on() && self.unsent_s < GOALS_EVERY.as_secs_f64() {
            return None;
        }
        let step_s = self.unsent_s.min(LONGEST_S);
        self.unsent_s = 0.0;
        let from_m = self.goal_m.unwrap_or(tip.depth_m);
        let ahead_m = from_m + wish.along_m_per_s * step_s;
        let near_m = ahead_m.clamp(tip.depth_m - LEAD_M, tip.depth_m + LEAD_M);
        let depth_m = near_m.clamp(-BEFORE_ENTRY_M, tip.length_m.max(-BEFORE_ENTRY_M));
        self.goal_m = Some(depth_m);
        let across = wish.across_m_per_s;
        if across != [0.0; 2] && is_outside(tip) {
            for (axis, across) in across.into_iter().enumerate() {
                let ahead_m = self.beside_m[axis] + across * step_s;
                let near_m = ahead_m.clamp(tip.beside_m[axis] - LEAD_M, tip.beside_m[axis] + LEAD_M);
                let [low, high] = tip.room_m[axis];
                self.beside_m[axis] = near_m.clamp(low.min(high), high.max(low));
            }
        }
        let speed = wish.along_m_per_s.abs().max(across[0].hypot(across[1]));
        Some(Goal {
            depth_m,
            speed_m_per_s: speed.max(SLOWEST_M_PER_S),
        })
    }

    /// Whether the keys or the device were released just now, so that the core must stop the needle itself: the tip known here is delayed.
    pub fn stop(&mut self, tip: &TipOnPath) -> bool {
        let was_on = self.goal_m.take().is_some();
        if was_on && is_outside(tip) {
            self.beside_m = tip.beside_m;
        }
        was_on
    }
}

fn is_outside(tip: &TipOnPath) -> bool {
    tip.is_free && tip.depth_m < OUTSIDE_M
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTSIDE: TipOnPath = TipOnPath {
        depth_m: 0.0,
        length_m: 0.08,
        beside_m: [0.0; 2],
        room_m: [[-0.03, 0.03], [-0.03, 0.03]],
        is_free: true,
    };

    fn along(speed: f64) -> Wish {
        Wish {
            along_m_per_s: speed,
            ..Wish::REST
        }
    }

    fn across(right: f64, up: f64) -> Wish {
        Wish {
            across_m_per_s: [right, up],
            ..Wish::REST
        }
    }

    #[test]
    fn the_goal_goes_as_fast_as_it_is_wished_whatever_the_frames_and_goals_are_bounded() {
        for frame_s in [0.001, 0.004, 0.016, 0.040] {
            let (mut drive, mut tip, mut goals, mut time_s) = (Drive::default(), OUTSIDE, 0, 0.0);
            while time_s < 1.0 {
                if let Some(goal) = drive.step(&along(0.02), &tip, frame_s) {
                    // A hand that follows at once.
                    tip.depth_m = goal.depth_m;
                    goals += 1;
                    assert_eq!(goal.speed_m_per_s, 0.02);
                }
                time_s += frame_s;
            }
            assert!((tip.depth_m - 0.02).abs() < 0.02 * 0.05, "{frame_s}: {}", tip.depth_m);
            assert!(goals <= 101, "{goals} in a second");
        }
    }

    #[test]
    fn a_needle_that_is_held_back_or_a_frame_that_hangs_is_no_jump() {
        let mut drive = Drive::default();
        for _ in 0..1000 {
            let goal = drive.step(&along(0.04), &OUTSIDE, 0.016).expect("a goal");
            assert!(goal.depth_m <= LEAD_M + 1e-12);
        }
        let goal = Drive::default().step(&along(0.04), &OUTSIDE, 100.0).expect("a goal");
        assert!(goal.depth_m <= 0.04 * LONGEST_S + 1e-12);
    }

    #[test]
    fn the_needle_stays_on_its_path_between_both_ends() {
        let mut drive = Drive::default();
        let mut tip = TipOnPath {
            depth_m: 0.0799,
            ..OUTSIDE
        };
        for (speed, end) in [(0.04, 0.08), (-0.04, -BEFORE_ENTRY_M)] {
            for _ in 0..1000 {
                if let Some(goal) = drive.step(&along(speed), &tip, 0.016) {
                    tip.depth_m = goal.depth_m;
                }
            }
            assert!((tip.depth_m - end).abs() < 1e-12);
        }
    }

    #[test]
    fn a_release_is_reported_once_and_the_next_drive_begins_at_the_tip() {
        let mut drive = Drive::default();
        assert!(!drive.stop(&OUTSIDE), "nothing was driven");
        drive.step(&along(0.04), &OUTSIDE, 0.016);
        let tip = TipOnPath {
            depth_m: 0.0123,
            ..OUTSIDE
        };
        assert!(drive.stop(&tip));
        assert!(!drive.stop(&tip));
        let goal = drive.step(&along(0.04), &tip, 0.016).expect("a goal");
        assert!((goal.depth_m - 0.0123 - 0.04 * 0.016).abs() < 1e-12);
    }

    #[test]
    fn across_the_template_only_outside_and_only_where_there_are_holes() {
        let wish = across(0.01, -0.01);
        assert!(Drive::follows(&wish, &OUTSIDE));
        for inside in [
            TipOnPath {
                depth_m: 0.02,
                ..OUTSIDE
            },
            TipOnPath {
                is_free: false,
                ..OUTSIDE
            },
        ] {
            assert!(!Drive::follows(&wish, &inside));
            let mut drive = Drive {
                beside_m: [0.005, 0.0],
                ..Drive::default()
            };
            drive.step(
                &Wish {
                    along_m_per_s: 0.01,
                    ..wish
                },
                &inside,
                0.016,
            );
            assert_eq!(drive.beside_m, [0.005, 0.0], "a needle in the tissue keeps its line");
            drive.stop(&inside);
            assert_eq!(drive.beside_m, [0.005, 0.0]);
        }
        let (mut drive, mut tip) = (Drive::default(), OUTSIDE);
        for _ in 0..1000 {
            drive.step(&wish, &tip, 0.016);
            assert!((drive.beside_m[0] - tip.beside_m[0]).abs() <= LEAD_M + 1e-12);
            tip.beside_m = drive.beside_m;
        }
        assert_eq!(drive.beside_m, [0.03, -0.03]);
    }

    #[test]
    fn no_goal_is_slower_than_the_core_takes() {
        let goal = Drive::default().step(&along(1e-9), &OUTSIDE, 0.016).expect("a goal");
        assert_eq!(goal.speed_m_per_s, SLOWEST_M_PER_S);
    }
}
