//! A Phantom Premium 1.5 in the grip of a hand: inertia, dry friction, encoders, amplifiers.

use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

use crate::convert::quantise;
use crate::device::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
use crate::sim::hand::Hand;
use crate::sim::path::HandPath;

/// Longest step of the dynamics; keeps their error small at the period of the force loop.
const LONGEST_STEP_S: f64 = 5e-5;
/// Longest time by which one read advances the device, so that a read after a delay stays short.
const LONGEST_ADVANCE_S: f64 = 0.02;

/// Properties of a simulated device and its hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedPhantomConfig {
    /// Name and limits.
    pub info: DeviceInfo,
    /// Inertia of the device at its tip.
    pub apparent_mass_kg: f64,
    /// Dry friction of its joints, as a force at the tip.
    pub coulomb_friction_n: f64,
    /// The hand that holds the device.
    pub hand: Hand,
    /// Position of the tip at the start, m.
    pub start_tip_in_world: Vector3<f64>,
    /// Needle axis at the start, of any length.
    pub start_direction: Vector3<f64>,
    /// Rate at which the tool turns to the direction of the goal.
    pub turn_rate_rad_per_s: f64,
}

impl Default for SimulatedPhantomConfig {
    fn default() -> Self {
        Self {
            info: DeviceInfo {
                name: "simulated Phantom Premium 1.5 6DOF",
                simulated: true,
                ..DeviceInfo::phantom_premium_1_5()
            },
            apparent_mass_kg: 0.075,
            coulomb_friction_n: 0.04,
            hand: Hand::steady(),
            start_tip_in_world: Vector3::zeros(),
            start_direction: Vector3::z(),
            turn_rate_rad_per_s: 2.0,
        }
    }
}

/// A simulated Phantom in the grip of a hand. A read advances it; a written wrench acts during the next read.
#[derive(Debug, Clone)]
pub struct SimulatedPhantom {
    config: SimulatedPhantomConfig,
    path: HandPath,
    tip_in_world: Vector3<f64>,
    velocity_m_per_s: Vector3<f64>,
    push_n: Vector3<f64>,
    world_from_tool: UnitQuaternion<f64>,
    /// Direction of the tool's +y, if the hand controls the roll.
    up: Option<Vector3<f64>>,
    wrench: Wrench,
    work_j: f64,
    sequence: u64,
}

impl SimulatedPhantom {
    /// Creates a device at rest at the start.
    pub fn new(config: SimulatedPhantomConfig) -> Self {
        let direction = unit_or_z(&config.start_direction);
        Self {
            config,
            path: HandPath::at(config.start_tip_in_world, direction),
            tip_in_world: config.start_tip_in_world,
            velocity_m_per_s: Vector3::zeros(),
            push_n: Vector3::zeros(),
            world_from_tool: turn(&Vector3::z(), &direction, core::f64::consts::PI),
            up: None,
            wrench: Wrench::zero(),
            work_j: 0.0,
            sequence: 0,
        }
    }

    /// Returns the position of the tip before the encoders quantise it.
    pub fn true_tip_in_world(&self) -> &Vector3<f64> {
        &self.tip_in_world
    }

    /// Returns the velocity of the tip.
    pub fn true_velocity_m_per_s(&self) -> &Vector3<f64> {
        &self.velocity_m_per_s
    }

    /// Returns the path of the hand.
    pub fn path(&self) -> &HandPath {
        &self.path
    }

    /// Returns the wrench that acts, limited by the amplifiers.
    pub fn applied_wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// Returns the work that the applied force has done on device and hand since the start.
    pub fn work_j(&self) -> f64 {
        self.work_j
    }

    /// Returns the kinetic energy of device and hand, plus the energy in the spring of the hand.
    pub fn energy_j(&self) -> f64 {
        let lag_m = self.path.position_m() - self.tip_in_world;
        0.5 * self.moving_mass_kg() * self.velocity_m_per_s.norm_squared()
            + 0.5 * self.config.hand.total_stiffness_n_per_m() * lag_m.norm_squared()
    }

    /// Replaces the hand; the new one starts without a push.
    pub fn set_hand(&mut self, hand: Hand) {
        self.config.hand = hand;
        self.push_n = Vector3::zeros();
    }

    fn moving_mass_kg(&self) -> f64 {
        (self.config.apparent_mass_kg + self.config.hand.mass_kg).max(1e-3)
    }

    /// Advances by one step, implicit in spring, damper and friction. Without friction `(m + h b +
    /// h^2 k) v' = p`; friction reduces the impulse `p`, at most to zero. Stable at any stiffness.
    fn advance(&mut self, h: f64) {
        self.path.step(h);
        let hand = &self.config.hand;
        let (k, b) = (hand.total_stiffness_n_per_m(), hand.total_damping_n_s_per_m());
        let lag_m = self.path.position_m() - self.tip_in_world;
        self.push_n = hand.push_n(&self.push_n, &lag_m, h);
        let mass = self.moving_mass_kg();
        let force_n = self.wrench.force_n + self.push_n + lag_m * k + self.path.velocity_m_per_s() * b;
        let impulse = self.velocity_m_per_s * mass + force_n * h;
        let friction = self.config.coulomb_friction_n * h;
        let size = impulse.norm();
        self.velocity_m_per_s = if size <= friction {
            Vector3::zeros()
        } else {
            impulse * ((size - friction) / size / (mass + h * b + h * h * k))
        };
        self.tip_in_world += self.velocity_m_per_s * h;
        self.work_j += self.wrench.force_n.dot(&self.velocity_m_per_s) * h;
    }

    fn sample(&self) -> Sample {
        Sample {
            tip_in_world: quantise(&self.tip_in_world, self.config.info.position_step_m),
            world_from_tool: self.world_from_tool,
            buttons: 0,
            sequence: self.sequence,
        }
    }
}

impl Device for SimulatedPhantom {
    fn info(&self) -> DeviceInfo {
        self.config.info
    }

    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault> {
        if !dt_s.is_finite() || dt_s < 0.0 {
            return Err(DeviceFault::InvalidPeriod);
        }
        if dt_s > 0.0 {
            let span_s = dt_s.min(LONGEST_ADVANCE_S);
            let steps = (span_s / LONGEST_STEP_S - 1e-9).ceil().max(1.0);
            for _ in 0..steps as u32 {
                self.advance(span_s / steps);
            }
            let aim = unit_or_z(&self.path.goal().direction);
            let step_rad = self.config.turn_rate_rad_per_s * span_s;
            let axis = self.world_from_tool * Vector3::z();
            let by = match self.up.and_then(|up| upright(&aim, &up)) {
                Some(goal) => part_of(&(goal * self.world_from_tool.inverse()), step_rad),
                None => turn(&axis, &aim, step_rad),
            };
            self.world_from_tool = by * self.world_from_tool;
            self.world_from_tool.renormalize_fast();
            self.sequence = self.sequence.wrapping_add(1);
        }
        let sample = self.sample();
        if sample.is_finite() {
            Ok(sample)
        } else {
            Err(DeviceFault::NonFiniteSample)
        }
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        if !wrench.is_finite() {
            self.wrench = Wrench::zero();
            return Err(DeviceFault::NonFiniteWrench);
        }
        self.wrench = wrench.within(&self.config.info);
        Ok(())
    }

    fn set_hand_goal(&mut self, goal: &HandGoal) {
        self.path.set_goal(goal);
    }

    fn set_hand_up(&mut self, up: Option<Vector3<f64>>) {
        self.up = up.filter(|up| up.iter().all(|x| x.is_finite()));
    }

    fn stop_hand(&mut self) {
        self.path.stop();
    }
}

fn unit_or_z(v: &Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(1e-9).unwrap_or_else(Vector3::z)
}

/// Returns the tool along `aim`, its +y as near to `up` as it can be; `None` where both are parallel.
fn upright(aim: &Vector3<f64>, up: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let up = (up - aim * up.dot(aim)).try_normalize(1e-6)?;
    let axes = Matrix3::from_columns(&[up.cross(aim), up, *aim]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(
        axes,
    )))
}

/// Returns the rotation, or as much of it as is within `limit_rad`.
fn part_of(rotation: &UnitQuaternion<f64>, limit_rad: f64) -> UnitQuaternion<f64> {
    let turn = rotation.scaled_axis();
    let angle = turn.norm();
    let share = if angle > limit_rad { limit_rad / angle } else { 1.0 };
    UnitQuaternion::from_scaled_axis(turn * share)
}

/// Returns the rotation that takes `from` towards `to` (unit vectors) by at most `limit_rad`.
fn turn(from: &Vector3<f64>, to: &Vector3<f64>, limit_rad: f64) -> UnitQuaternion<f64> {
    let normal = from.cross(to);
    let angle = normal.norm().atan2(from.dot(to));
    let axis = Unit::try_new(normal, 1e-12).unwrap_or_else(|| {
        // Parallel: the angle is zero. Opposite: any axis perpendicular to the needle is right.
        let helper = if from.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        Unit::new_normalize(from.cross(&helper))
    });
    UnitQuaternion::from_axis_angle(&axis, angle.min(limit_rad))
}
