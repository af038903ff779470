//! Goals for the simulated hand, from the speed that keys, stick or cap request.

use crate::shown::TipOnPath;
use std::time::Duration;
use stylet_controllers::{SLOWEST_M_PER_S, Wish};

/// Largest lead of the hand over a tip that is held back.
const LEAD_M: f64 = 0.004;
/// Time for which the hand continues without another goal, in multiples of the longest recent
/// frame. Slow frames do not stop the needle, a window that hangs does. Keys are read once a frame,
/// so an earlier detection is impossible.
const HOLD_FRAMES: f64 = 1.5;
/// Bounds of that time, for fast and for slow frames.
const HOLD_S: [f64; 2] = [0.1, 0.5];
/// Number of recent frames of this drive that count.
const FRAMES: usize = 8;
/// Assumed time of the frames before a drive, which may be rare because nothing changed.
const FIRST_FRAME_S: f64 = 0.16;
/// Distance before the entry to which the needle may be drawn back.
pub const BEFORE_ENTRY_M: f64 = 0.02;
/// Shortest time between two goals, at any frame rate.
const GOALS_EVERY: Duration = Duration::from_millis(10);
/// Depth of the tip before which the needle may move across the template.
const OUTSIDE_M: f64 = 1e-3;

/// Goal of the simulated hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    pub depth_m: f64,
    /// Offset from the planned path.
    pub offset_m: [f64; 2],
    pub speed_m_per_s: f64,
}

/// Needle that is being driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Present depth of the hand, while it is driven.
    at_m: Option<f64>,
    /// Offset of the line on which all goals of the window lie, so that a needle in the tissue is
    /// not pulled aside. `None` until this window has chosen a line or found a needle in the
    /// tissue.
    offset_m: Option<[f64; 2]>,
    unsent_s: f64,
    /// Time for which the hand continues after the last goal.
    hold_s: f64,
    frames: RecentFrames,
}

/// Durations of the last frames, while the needle was driven.
#[derive(Clone, Debug, PartialEq)]
struct RecentFrames {
    took_s: [f64; FRAMES],
    next: usize,
}

impl Default for RecentFrames {
    fn default() -> Self {
        Self {
            took_s: [FIRST_FRAME_S; FRAMES],
            next: 0,
        }
    }
}

impl RecentFrames {
    fn take(&mut self, took_s: f64) {
        self.took_s[self.next % FRAMES] = took_s;
        self.next = (self.next + 1) % FRAMES;
    }

    fn hold_s(&self) -> f64 {
        let longest = self.took_s.iter().copied().fold(0.0, f64::max);
        (HOLD_FRAMES * longest).clamp(HOLD_S[0], HOLD_S[1])
    }
}

impl Drive {
    pub fn is_on(&self) -> bool {
        self.at_m.is_some()
    }

    /// Forgets the drive without sending anything.
    pub fn forget(&mut self) {
        self.at_m = None;
    }

    /// Returns the offset of the needle's line from the planned path.
    pub fn offset_m(&self) -> [f64; 2] {
        self.offset_m.unwrap_or_default()
    }

    /// Puts the needle back on the planned path.
    pub fn keep_to_path(&mut self) {
        self.offset_m = Some([0.0; 2]);
    }

    /// Takes over the line of a needle that another window left in the tissue.
    pub fn find(&mut self, tip: &TipOnPath) {
        if self.offset_m.is_none() && !is_outside(tip) {
            self.offset_m = Some(tip.offset_m);
        }
    }

    /// Returns whether the wish can be followed: across only while the tip is outside.
    pub fn follows(wish: &Wish, tip: &TipOnPath) -> bool {
        wish.along_m_per_s != 0.0 || (wish.across_m_per_s != [0.0; 2] && is_outside(tip))
    }

    /// Returns the next goal when one is due. The wish must be one that can be followed; `frame_s`
    /// is the time since the last frame.
    pub fn step(&mut self, wish: &Wish, tip: &TipOnPath, frame_s: f64) -> Option<Goal> {
        let frame_s = frame_s.clamp(0.0, HOLD_S[1]);
        self.unsent_s += frame_s;
        if self.is_on() {
            self.frames.take(frame_s);
        } else {
            self.frames = RecentFrames::default();
        }
        if self.is_on() && self.unsent_s < GOALS_EVERY.as_secs_f64() {
            return None;
        }
        // The hand was at rest until now, or moved as requested, but for no longer than its hold
        // time.
        let went_s = if self.is_on() {
            self.unsent_s.min(self.hold_s)
        } else {
            0.0
        };
        self.unsent_s = 0.0;
        let hold_s = self.frames.hold_s();
        self.hold_s = hold_s;
        let along = wish.along_m_per_s;
        let on_path = |depth_m: f64| depth_m.clamp(-BEFORE_ENTRY_M, tip.length_m.max(-BEFORE_ENTRY_M));
        let went_m = self.at_m.unwrap_or(tip.depth_m) + along * went_s;
        let at_m = on_path(went_m.clamp(tip.depth_m - LEAD_M, tip.depth_m + LEAD_M));
        self.at_m = Some(at_m);
        let mut offset_m = self.offset_m();
        let across = wish.across_m_per_s;
        if across != [0.0; 2] && is_outside(tip) {
            let mut goes_on_m = offset_m;
            for (axis, across) in across.into_iter().enumerate() {
                let [low, high] = tip.room_m[axis];
                let in_room = |m: f64| m.clamp(low.min(high), high.max(low));
                let went_m = offset_m[axis] + across * went_s;
                offset_m[axis] = in_room(went_m.clamp(tip.offset_m[axis] - LEAD_M, tip.offset_m[axis] + LEAD_M));
                goes_on_m[axis] = in_room(offset_m[axis] + across * hold_s);
            }
            self.offset_m = Some(offset_m);
            offset_m = goes_on_m;
        }
        let speed = along.abs().max(across[0].hypot(across[1]));
        Some(Goal {
            depth_m: on_path(at_m + along * hold_s),
            offset_m,
            speed_m_per_s: speed.max(SLOWEST_M_PER_S),
        })
    }

    /// Returns whether keys or device were just released, so that the core must stop the needle:
    /// the tip known here is delayed.
    pub fn stop(&mut self, tip: &TipOnPath) -> bool {
        let was_on = self.at_m.take().is_some();
        if was_on && is_outside(tip) {
            self.offset_m = Some(tip.offset_m);
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
        offset_m: [0.0; 2],
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

    /// Moves a hand to its goal at the given speed, as the core does.
    fn goes(tip: &mut TipOnPath, goal: &Goal, time_s: f64) {
        let step_m = goal.speed_m_per_s * time_s;
        tip.depth_m += (goal.depth_m - tip.depth_m).clamp(-step_m, step_m);
    }

    /// Guards against two faults: a frame of more than 100 ms stopped the needle, and a sequence of
    /// slow frames slowed it.
    #[test]
    fn the_needle_moves_at_its_wished_speed_at_any_frame_rate() {
        for frame_s in [0.001, 0.004, 0.016, 0.040, 0.111, 0.200, 0.240] {
            let (mut drive, mut tip, mut goals, mut time_s) = (Drive::default(), OUTSIDE, 0, 0.0);
            let mut last = None;
            while time_s < 1.2 {
                if let Some(goal) = drive.step(&along(0.04), &tip, frame_s) {
                    assert_eq!(goal.speed_m_per_s, 0.04);
                    (last, goals) = (Some(goal), goals + 1);
                }
                goes(&mut tip, &last.expect("a goal in the first frame"), frame_s);
                time_s += frame_s;
            }
            let wished_m = 0.04 * time_s;
            assert!(
                (tip.depth_m - wished_m).abs() < 1e-9,
                "{frame_s}: {} of {wished_m}",
                tip.depth_m
            );
            assert!(goals <= 121, "{goals} in 1.2 s");
        }
    }

    /// Guards against a hand that continued for 0.5 s, 20 mm at the speed of the keys, however fast
    /// the frames had been.
    #[test]
    fn a_hung_window_stops_the_needle_in_time() {
        for (frame_s, goes_on_s) in [
            (0.004, 0.1),
            (0.016, 0.1),
            (0.060, 0.1),
            (0.111, 0.1665),
            (0.200, 0.3),
            (3.0, 0.5),
        ] {
            let (mut drive, mut tip, mut last) = (Drive::default(), OUTSIDE, None);
            for _ in 0..40 {
                tip.depth_m = 0.02;
                last = drive.step(&along(0.04), &tip, frame_s).or(last);
            }
            let goal = last.expect("a goal");
            let from_m = drive.at_m.expect("it is driven");
            goes(&mut tip, &goal, 60.0);
            let went_m = tip.depth_m - from_m;
            assert!((went_m - 0.04 * goes_on_s).abs() < 1e-12, "{frame_s}: {went_m}");
        }
    }

    /// Checks one slow frame among fast ones: the needle waits for the window, and continues from
    /// where it is.
    #[test]
    fn one_slow_frame_pauses_the_needle() {
        let (mut drive, mut tip) = (Drive::default(), OUTSIDE);
        let mut goal = drive.step(&along(0.04), &tip, 0.016).expect("a goal");
        for frame_s in [0.016; 20].into_iter().chain([0.3]).chain([0.016; 20]) {
            let before_m = tip.depth_m;
            goes(&mut tip, &goal, frame_s);
            assert!(tip.depth_m - before_m <= 0.04 * frame_s.min(HOLD_S[0]) + 1e-12);
            goal = drive.step(&along(0.04), &tip, frame_s).expect("a goal");
        }
        let driven_s = 40.0 * 0.016 + HOLD_S[0];
        assert!((tip.depth_m - 0.04 * driven_s).abs() < 1e-9, "{}", tip.depth_m);
    }

    #[test]
    fn a_held_needle_and_a_hung_frame_cause_no_jump() {
        let mut drive = Drive::default();
        for frame_s in [0.016, 100.0] {
            for _ in 0..1000 {
                let goal = drive.step(&along(0.04), &OUTSIDE, frame_s).expect("a goal");
                assert!(goal.depth_m <= LEAD_M + 0.04 * HOLD_S[1] + 1e-12);
            }
        }
    }

    /// Guards against a window that was opened while the needle was off its path and drew it aside
    /// in the tissue.
    #[test]
    fn a_needle_that_another_window_left_in_the_tissue_stays_on_its_line() {
        let tip = TipOnPath {
            depth_m: 0.03,
            offset_m: [0.005, -0.002],
            is_free: false,
            ..OUTSIDE
        };
        let mut drive = Drive::default();
        drive.find(&tip);
        assert_eq!(drive.offset_m(), tip.offset_m);
        let goal = drive.step(&along(0.02), &tip, 0.016).expect("a goal");
        assert_eq!(goal.offset_m, tip.offset_m);
        // Tissue that bends the tip does not move the line.
        drive.find(&TipOnPath {
            offset_m: [0.006, 0.0],
            ..tip
        });
        assert_eq!(drive.offset_m(), tip.offset_m);
        // Outside it may return to the path.
        let mut drive = Drive::default();
        drive.find(&TipOnPath {
            depth_m: 0.0,
            is_free: true,
            ..tip
        });
        assert_eq!(drive.offset_m(), [0.0; 2]);
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
    fn a_release_is_reported_once() {
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
        assert!((goal.depth_m - 0.0123 - 0.04 * HOLD_FRAMES * FIRST_FRAME_S).abs() < 1e-12);
    }

    #[test]
    fn the_needle_moves_across_only_outside_and_over_holes() {
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
                offset_m: Some([0.005, 0.0]),
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
            assert_eq!(drive.offset_m(), [0.005, 0.0], "a needle in the tissue keeps its line");
            drive.stop(&inside);
            assert_eq!(drive.offset_m(), [0.005, 0.0]);
        }
        let (mut drive, mut tip) = (Drive::default(), OUTSIDE);
        for _ in 0..1000 {
            let goal = drive.step(&wish, &tip, 0.016).expect("a goal");
            assert!((goal.offset_m[0] - tip.offset_m[0]).abs() <= LEAD_M + 0.01 * HOLD_S[1] + 1e-12);
            tip.offset_m = drive.offset_m();
        }
        assert_eq!(drive.offset_m(), [0.03, -0.03]);
    }

    #[test]
    fn no_goal_is_slower_than_the_core_s_limit() {
        let goal = Drive::default().step(&along(1e-9), &OUTSIDE, 0.016).expect("a goal");
        assert_eq!(goal.speed_m_per_s, SLOWEST_M_PER_S);
    }
}
