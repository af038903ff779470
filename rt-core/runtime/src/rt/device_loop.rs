//! Common part of every loop that owns a device: ticks on the ideal grid, the newest sample, and the end at zero force.

use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid, Wait};
use crate::rt::timing::Probe;
use crate::rt::watchdog::device_fault;
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_hw::{DeviceFault, HandGoal, Sample};
use stylet_shm_schema::{DeadlineTotals, Fault};

/// Largest distance from its goal at which a resting hand has arrived.
const AT_GOAL_M: f64 = 4e-4;
const AT_REST_M_PER_S: f64 = 3e-3;

/// Ticks of a loop, and their lateness.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// Ticks made.
    pub ticks: u64,
    /// Since the loop began.
    pub since_start: DeadlineTotals,
    /// Since the force was last turned on.
    pub since_armed: DeadlineTotals,
}

/// A loop that owns a device.
pub trait DeviceLoop {
    /// State shown to hosts.
    type State: bytemuck::Pod + Send;
    /// Returns the state shown to hosts, after the newest tick.
    fn state(&self) -> &Self::State;
    /// Returns the counts since the loop began; a reset does not clear them.
    fn counts(&self) -> Counts;
    /// Time between two ticks, s.
    fn period_s(&self) -> f64;
    /// Returns how it waits for each deadline.
    fn wait(&self) -> Wait;
    /// Returns its phase within a period of the clock.
    fn phase(&self) -> f64;
    /// Number of ticks of the ramp to zero force.
    fn ramp_out_ticks(&self) -> u32;
    /// Begins the ramp to zero force.
    fn release_for_the_end(&mut self);
    /// Runs one tick.
    fn step(&mut self, due_ns: u64, woke_ns: u64, missed: u32);
    /// Returns the probe of a measurement.
    fn probe(&mut self) -> Option<&mut Probe>;
    /// Sets zero force.
    fn end(&mut self);
}

/// Runs on the ideal grid until `stop`, then ramps the force to zero and ends. Returns the number of sleeps.
pub fn run<L: DeviceLoop>(
    device_loop: &mut L,
    _armed: &Armed,
    stop: &AtomicBool,
    mut publish: impl FnMut(&L::State),
) -> u64 {
    let period_ns = (device_loop.period_s() * 1e9).round() as u64;
    let phase_ns = clock::phase_ns(device_loop.phase(), period_ns);
    let mut grid = Grid::at_phase(clock::now_ns(), period_ns, phase_ns);
    let (mut missed, mut sleeps) = (0, 0);
    let mut last_ticks = device_loop.ramp_out_ticks() + 1;
    while last_ticks > 0 {
        // SYNC: pairs with the control thread's release store; nothing but the flag is carried.
        if stop.load(Ordering::Acquire) {
            device_loop.release_for_the_end();
            last_ticks -= 1;
        }
        sleeps += device_loop.wait().until(grid.due_ns);
        let woke_ns = clock::now_ns();
        device_loop.step(grid.due_ns, woke_ns, missed);
        publish(device_loop.state());
        if let Some(probe) = device_loop.probe() {
            probe.finish(grid.due_ns, woke_ns, missed);
        }
        missed = grid.advance(clock::now_ns());
    }
    device_loop.end();
    sleeps
}

/// Result of reading a device.
pub struct Reading {
    /// The newest sample; the last good one when the device has a fault.
    pub sample: Sample,
    /// The fault, if any.
    pub fault: Option<Fault>,
    /// The sample repeats the last one.
    pub is_repeated: bool,
}

/// Evaluates the answer of a device whose last good sample is `before`.
pub fn judge(answer: Result<Sample, DeviceFault>, before: Option<Sample>) -> Reading {
    let last = before.unwrap_or(Sample {
        tip_in_world: Vector3::zeros(),
        world_from_tool: UnitQuaternion::identity(),
        buttons: 0,
        sequence: 0,
    });
    let (sample, fault) = match answer {
        Ok(sample) if sample.is_finite() => (sample, None),
        Ok(_) => (last, Some(Fault::NonFiniteInput)),
        Err(fault) => (last, Some(device_fault(fault))),
    };
    Reading {
        sample,
        fault,
        is_repeated: before.is_some_and(|before| before.sequence == sample.sequence),
    }
}

/// True if a simulated hand rests at its goal.
pub fn is_at_goal(goal: Option<HandGoal>, tip: &Vector3<f64>, speed_m_per_s: f64) -> bool {
    goal.is_some_and(|goal| (tip - goal.tip_in_world).norm() < AT_GOAL_M && speed_m_per_s < AT_REST_M_PER_S)
}
