//! Path of the simulated hand: a straight line to the goal with a trapezoidal speed.

use nalgebra::Vector3;

use crate::device::HandGoal;

/// The moving equilibrium of the hand.
///
/// From rest it follows a straight line to its goal. A new goal starts from the present position and velocity, so that
/// the velocity never changes by more than acceleration times period.
#[derive(Debug, Clone)]
pub struct HandPath {
    position_m: Vector3<f64>,
    velocity_m_per_s: Vector3<f64>,
    goal: HandGoal,
}

impl HandPath {
    /// Creates a path at rest at `start_m`, with the needle along `direction`.
    pub fn at(start_m: Vector3<f64>, direction: Vector3<f64>) -> Self {
        Self {
            position_m: start_m,
            velocity_m_per_s: Vector3::zeros(),
            goal: HandGoal {
                tip_in_world: start_m,
                direction,
                speed_m_per_s: 0.05,
                acceleration_m_per_s2: 1.0,
            },
        }
    }

    /// Takes a new goal; returns `false` and ignores an invalid one.
    pub fn set_goal(&mut self, goal: &HandGoal) -> bool {
        let valid = goal.is_valid();
        if valid {
            self.goal = *goal;
        }
        valid
    }

    /// Stops with the acceleration of the last goal, `v^2 / 2a` ahead, without reversing.
    pub fn stop(&mut self) {
        let stopping_s = self.velocity_m_per_s.norm() / (2.0 * self.goal.acceleration_m_per_s2);
        self.goal.tip_in_world = self.position_m + self.velocity_m_per_s * stopping_s;
    }

    /// Returns the present position of the equilibrium.
    pub fn position_m(&self) -> &Vector3<f64> {
        &self.position_m
    }

    /// Returns the present velocity of the equilibrium.
    pub fn velocity_m_per_s(&self) -> &Vector3<f64> {
        &self.velocity_m_per_s
    }

    /// Returns the present goal.
    pub fn goal(&self) -> &HandGoal {
        &self.goal
    }

    /// Advances by `dt_s`, which the caller has checked to be positive.
    pub fn step(&mut self, dt_s: f64) {
        let to_goal = self.goal.tip_in_world - self.position_m;
        let distance = to_goal.norm();
        let speed_step = self.goal.acceleration_m_per_s2 * dt_s;
        let close = distance <= 0.5 * speed_step * dt_s || distance < 1e-12;
        if close && self.velocity_m_per_s.norm() <= speed_step {
            self.position_m = self.goal.tip_in_world;
            self.velocity_m_per_s = Vector3::zeros();
            return;
        }
        let wanted = if distance > 1e-12 {
            to_goal * (self.approach_speed(distance, speed_step, dt_s) / distance)
        } else {
            Vector3::zeros()
        };
        let change = wanted - self.velocity_m_per_s;
        let size = change.norm();
        let limited = if size > speed_step {
            change * (speed_step / size)
        } else {
            change
        };
        self.velocity_m_per_s += limited;
        self.position_m += self.velocity_m_per_s * dt_s;
    }

    /// Returns the fastest speed from which steps of `speed_step` still stop at the goal: the
    /// solution of `v^2 / 2a + v dt / 2 = distance`, for the discrete motion. The last step may
    /// overshoot the goal by a small part of `a dt^2`; the next one is at the goal.
    fn approach_speed(&self, distance: f64, speed_step: f64, dt_s: f64) -> f64 {
        let stopping = speed_step * ((0.25 + 2.0 * distance / (speed_step * dt_s)).sqrt() - 0.5);
        stopping.min(self.goal.speed_m_per_s).min(distance / dt_s)
    }
}
