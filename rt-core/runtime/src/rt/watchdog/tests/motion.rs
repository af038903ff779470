//! A hand whose host falls silent, in the whole loop: it used to move on for 55 mm and more after its host was killed.

use super::*;
use crate::rt::exchange::Moved;
use crate::rt::motion_lease::Promise;

const MINE: Promise = Promise {
    host_id: 7,
    valid_s: 0.02,
};

fn away(promise: Promise) -> HapticOrder {
    HapticOrder::Hand {
        up: None,
        promise: Some(promise),
        goal: HandGoal {
            tip_in_world: Vector3::new(0.0, 0.0, -0.4),
            direction: Vector3::new(0.0, 1.0, 1.0).normalize(),
            speed_m_per_s: 0.123,
            acceleration_m_per_s2: 2.0,
        },
    }
}

impl Rig {
    /// Moves for that many ticks, with a promise every 8 ms.
    fn move_on(&mut self, promise: Promise, ticks: usize) -> Vec<TickRecord> {
        let each = |tick: usize| {
            if tick.is_multiple_of(8) {
                self.order(HapticOrder::KeepMoving(promise));
            }
            self.tick()
        };
        (0..ticks).map(each).collect()
    }

    fn given_up(&self) -> Vec<Moved> {
        let what = |notice: &Notice| match notice {
            Notice::Event {
                what: Happened::MotionGivenUp(what),
                ..
            } => Some(*what),
            _ => None,
        };
        self.seen.iter().filter_map(what).collect()
    }
}

fn way_m(records: &[TickRecord]) -> f64 {
    let [from, to] = [records.first(), records.last()].map(|r| Vector3::from(r.expect("ticks").tip_in_scene_m));
    (to - from).norm()
}

/// A hand at 123 mm/s whose host was last heard in the tick before.
fn moving() -> Rig {
    let mut rig = Rig::new();
    rig.order(away(MINE));
    let moved = rig.move_on(MINE, 193);
    assert!((way_m(&moved[150..193]) - 0.123 * 0.042).abs() < 5e-4, "at full speed");
    rig
}

#[test]
fn a_hand_whose_host_falls_silent_is_at_rest_within_5_mm() {
    let mut rig = moving();
    let silent = rig.run(300);
    let farthest_m = (2..=300).map(|n| way_m(&silent[..n])).fold(0.0, f64::max);
    assert!((3e-3..4.5e-3).contains(&farthest_m), "{farthest_m} m");
    let left_m = (150..300).map(|n| way_m(&silent[n..])).fold(0.0, f64::max);
    assert!(left_m < 1.5e-4, "at rest after 150 ms: {left_m} m");
    assert_eq!(silent[40].world_from_tool, silent[299].world_from_tool, "turns no more");
    assert_eq!(rig.given_up(), []);
}

#[test]
fn a_hand_goes_on_when_its_host_is_heard_again_and_not_for_another() {
    let mut rig = moving();
    rig.run(200);
    let another = rig.move_on(Promise { host_id: 8, ..MINE }, 100);
    assert!(way_m(&another) < 1.5e-4, "another host moves nothing");
    let on = rig.move_on(MINE, 200);
    assert!(way_m(&on) > 0.015, "{}", way_m(&on));
    assert_eq!(rig.given_up(), []);
}

#[test]
fn a_goal_is_given_up_after_long_host_silence_until_a_new_one() {
    let mut rig = moving();
    rig.run(325);
    assert_eq!(rig.given_up(), [Moved::Needle]);
    assert!(way_m(&rig.move_on(MINE, 200)) < 1.5e-4);
    rig.order(away(MINE));
    assert!(way_m(&rig.move_on(MINE, 200)) > 0.01);
    // A stop ends the lease with the goal.
    rig.order(HapticOrder::StopHand);
    rig.run(600);
    assert_eq!(rig.given_up(), [Moved::Needle], "said once");
}

#[test]
fn a_hand_at_its_goal_needs_no_host() {
    let mut rig = Rig::new();
    let mut near = away(MINE);
    if let HapticOrder::Hand { goal, .. } = &mut near {
        (goal.tip_in_world.z, goal.direction) = (-0.01, Vector3::z());
    }
    rig.order(near);
    rig.move_on(MINE, 600);
    let there = rig.run(600);
    assert!(there.iter().all(|record| record.flags & flags::AT_GOAL != 0));
    assert_eq!(rig.given_up(), []);
}

/// The spring of the hand kept pushing towards the goal behind the membrane.
#[test]
fn a_needle_that_presses_on_a_membrane_stays_where_it_is() {
    let mut rig = Rig::new();
    rig.order(HapticOrder::Engage);
    let mut press = to_depth(0.02);
    if let HapticOrder::Hand { promise, .. } = &mut press {
        *promise = Some(MINE);
    }
    rig.order(press);
    rig.move_on(MINE, 500);
    let silent = rig.run(2000);
    assert!(way_m(&silent) < 1.5e-3, "{}", way_m(&silent));
    assert!(way_m(&silent[400..]) < 2e-4, "{}", way_m(&silent[400..]));
    assert!(force_n(&silent[1999]) > 0.2, "the needle keeps the force of the tissue");
}
