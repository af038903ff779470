//! The lease of a motion: the hand follows a host's goal only while that host renews it.
//!
//! The lease is counted in ticks of the loop that moves the hand, so a hung control thread stops the hand as well.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use stylet_hw::{Device, HandGoal, Sample};

/// Initial lease of a request that begins a motion.
const FIRST_VALID_S: f64 = 0.02;
/// Grace after braking begins: a host heard again within it resumes the motion.
const GRACE_S: f64 = 0.3;
/// Deceleration so hard that the mass of the hand, not its path, decides the stopping distance: 1.6 mm from 123 mm/s.
const BRAKE_M_PER_S2: f64 = 20.0;
/// Farthest motion after the last renewal, [`brake`] included.
const MOST_TRAVEL_M: f64 = 4.8e-3;
/// Deceleration of the tip when the hand brakes: less than that of its path, by its mass on its spring.
const TIP_BRAKES_M_PER_S2: f64 = 4.7;
/// Cosine of the angle within which a tool's orientation matches its goal: 1.4 mrad.
const TURNED: f64 = 1.0 - 1e-6;

/// A host's promise to renew in time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    /// The host.
    pub host_id: u64,
    /// Time for which the motion continues without another promise.
    pub valid_s: f64,
}

impl Promise {
    /// Returns the promise of a request that begins a motion.
    pub fn first(host_id: u64) -> Self {
        Self {
            host_id,
            valid_s: FIRST_VALID_S,
        }
    }

    /// Shortens the promise so that a hand at the ordered speed comes to rest within 4.8 mm; never below the initial
    /// lease.
    pub fn limited_to_travel(self, speed_m_per_s: f64) -> Self {
        let speed_m_per_s = speed_m_per_s.max(1e-3);
        let braking_m = speed_m_per_s.powi(2) / (2.0 * TIP_BRAKES_M_PER_S2);
        let valid_s = (MOST_TRAVEL_M - braking_m) / speed_m_per_s;
        Self {
            valid_s: self.valid_s.min(valid_s.max(FIRST_VALID_S)),
            ..self
        }
    }
}

/// Right of a motion to continue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum MotionLease {
    /// Nothing moves, or no renewal is needed: rehearsals and steppers have no host.
    #[default]
    Free,
    /// The motion continues.
    Valid {
        /// Owner of the motion.
        host_id: u64,
        /// Ticks left without another promise.
        ticks_left: u32,
    },
    /// The hand brakes or rests.
    Lapsed {
        /// Owner of the motion.
        host_id: u64,
        /// Ticks left until it is given up.
        ticks_left: u32,
    },
}

/// Action required in the tick in which a lease changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lapse {
    /// Brake and keep the goal.
    Brake,
    /// Drop the goal.
    GiveUp,
}

impl MotionLease {
    /// Returns the lease of a new motion; no renewal is needed without a promise.
    pub fn begin(promise: Option<Promise>, period_s: f64) -> Self {
        promise.map_or(Self::Free, |promise| Self::Valid {
            host_id: promise.host_id,
            ticks_left: ticks(promise.valid_s, period_s),
        })
    }

    /// Takes a promise. True if it resumes a lapsed motion.
    pub fn renew(&mut self, promise: &Promise, period_s: f64) -> bool {
        let was_lapsed = match *self {
            Self::Valid { host_id, .. } if host_id == promise.host_id => false,
            Self::Lapsed { host_id, .. } if host_id == promise.host_id => true,
            _ => return false,
        };
        *self = Self::begin(Some(*promise), period_s);
        was_lapsed
    }

    /// Counts one tick. A finished motion needs no lease.
    pub fn tick(&mut self, has_ended: bool, period_s: f64) -> Option<Lapse> {
        if has_ended {
            *self = Self::Free;
        }
        match self {
            Self::Free => None,
            Self::Valid { host_id, ticks_left: 0 } => {
                *self = Self::Lapsed {
                    host_id: *host_id,
                    ticks_left: ticks(GRACE_S, period_s),
                };
                Some(Lapse::Brake)
            }
            Self::Lapsed { ticks_left: 0, .. } => {
                *self = Self::Free;
                Some(Lapse::GiveUp)
            }
            Self::Valid { ticks_left, .. } | Self::Lapsed { ticks_left, .. } => {
                *ticks_left -= 1;
                None
            }
        }
    }
}

fn ticks(time_s: f64, period_s: f64) -> u32 {
    (time_s / period_s).round() as u32
}

/// Brakes a simulated hand at its tip, and ends its rotation. The spring of the hand must not pull the tip on: a hand
/// that pushes against a membrane is ahead of the tip.
pub fn brake(device: &mut dyn Device, goal: &HandGoal, sample: Option<Sample>, velocity_m_per_s: &Vector3<f64>) {
    let Some(sample) = sample else {
        return device.stop_hand();
    };
    let acceleration_m_per_s2 = goal.acceleration_m_per_s2.max(BRAKE_M_PER_S2);
    let stopping_s = velocity_m_per_s.norm() / (2.0 * acceleration_m_per_s2);
    device.set_hand_up(None);
    device.set_hand_goal(&HandGoal {
        tip_in_world: sample.tip_in_world + velocity_m_per_s * stopping_s,
        direction: sample.direction_in_world(),
        acceleration_m_per_s2,
        ..*goal
    });
}

/// True if a tool's direction and roll match its goal.
pub fn is_turned(goal: &HandGoal, up: Option<Vector3<f64>>, world_from_tool: &UnitQuaternion<f64>) -> bool {
    let is_along = |of_tool: Vector3<f64>, wanted: Vector3<f64>| {
        let wanted = wanted.try_normalize(1e-9);
        wanted.is_none_or(|wanted| (world_from_tool * of_tool).dot(&wanted) >= TURNED)
    };
    let axis = world_from_tool * Vector3::z();
    is_along(Vector3::z(), goal.direction) && up.is_none_or(|up| is_along(Vector3::y(), up - axis * up.dot(&axis)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINE: u64 = 7;

    fn promise(host_id: u64, ticks: u32) -> Promise {
        let valid_s = f64::from(ticks) * 1e-3;
        Promise { host_id, valid_s }
    }

    /// Ticks until the lease lapses and until the motion is given up.
    fn ends(mut lease: MotionLease) -> Vec<(u32, Lapse)> {
        let lapse = |n: u32| Some((n, lease.tick(false, 1e-3)?));
        (0..1000).filter_map(lapse).collect()
    }

    #[test]
    fn a_motion_lapses_with_its_promise_and_is_given_up_after_the_grace() {
        let lease = MotionLease::begin(Some(promise(MINE, 25)), 1e-3);
        assert_eq!(ends(lease), [(25, Lapse::Brake), (25 + 301, Lapse::GiveUp)]);
        assert_eq!(ends(MotionLease::begin(None, 1e-3)), [], "a rehearsal has no host");
    }

    #[test]
    fn a_promise_is_shortened_for_a_fast_hand() {
        for (speed_m_per_s, ticks_left) in [(0.01, 300.0), (0.05, 90.7), (0.123, 25.9), (0.2, 20.0)] {
            let valid_s = promise(MINE, 300).limited_to_travel(speed_m_per_s).valid_s;
            assert!((valid_s * 1e3 - ticks_left).abs() < 0.1, "{speed_m_per_s}: {valid_s}");
        }
        assert_eq!(promise(MINE, 5).limited_to_travel(0.123), promise(MINE, 5));
    }

    #[test]
    fn only_the_moving_host_renews_a_motion() {
        for (host_id, lapses) in [(MINE, 0), (MINE + 1, 1)] {
            let mut lease = MotionLease::begin(Some(promise(MINE, 25)), 1e-3);
            let mut seen = Vec::new();
            for tick in 0..200 {
                if tick % 20 == 0 {
                    assert!(!lease.renew(&promise(host_id, 25), 1e-3));
                }
                seen.extend(lease.tick(false, 1e-3));
            }
            assert_eq!(seen.len(), lapses, "host {host_id}");
        }
    }

    #[test]
    fn a_host_that_is_heard_within_the_grace_goes_on_and_after_it_does_not() {
        for (silent, goes_on) in [(30, true), (320, true), (330, false)] {
            let mut lease = MotionLease::begin(Some(promise(MINE, 25)), 1e-3);
            for _ in 0..silent {
                lease.tick(false, 1e-3);
            }
            assert!(!lease.renew(&promise(MINE + 1, 25), 1e-3));
            assert_eq!(lease.renew(&promise(MINE, 25), 1e-3), goes_on, "{silent}");
        }
    }

    #[test]
    fn a_motion_that_has_ended_never_lapses() {
        let mut lease = MotionLease::begin(Some(promise(MINE, 25)), 1e-3);
        assert_eq!(lease.tick(true, 1e-3), None);
        assert_eq!(ends(lease), []);
    }

    #[test]
    fn a_tool_is_turned_where_its_axis_and_its_side_are() {
        let goal = HandGoal {
            tip_in_world: Vector3::zeros(),
            direction: Vector3::z() * 3.0,
            speed_m_per_s: 0.1,
            acceleration_m_per_s2: 1.0,
        };
        let tool = UnitQuaternion::identity();
        let tilted = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.01);
        assert!(is_turned(&goal, None, &tool) && !is_turned(&goal, None, &tilted));
        let up = |v: Vector3<f64>| is_turned(&goal, Some(v), &tool);
        assert!(up(Vector3::new(0.0, 2.0, 5.0)) && up(Vector3::z()) && !up(Vector3::x()));
    }
}
