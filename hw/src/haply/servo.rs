//! One tick of the servo thread: send the newest force, read the state that answers it.

use std::time::Instant;

use nalgebra::{UnitQuaternion, Vector3};

use crate::device::{DeviceFault, Sample};
use crate::driver_thread::arm::{Arm, ArmError};
use crate::driver_thread::ends::ServoEnd;
use crate::driver_thread::hold::Hold;
use crate::driver_thread::serving::{self, Serve};
use crate::driver_thread::shared::Shared;
use crate::haply::message::{self, Frame, Grip, Inverse};
use crate::haply::session::Description;
use crate::haply::wire::{Wire, WireError};
use crate::placement::Placement;

/// Age at which an outstanding answer is late: the force goes to zero at once.
const LATE_S: f64 = 0.02;
/// Age of an outstanding answer at which the service counts as lost.
const SILENT_S: f64 = 0.25;
/// Time for which a loaded device may not move by a single bit; after it the service counts as
/// repeating an old state.
const FROZEN_S: f64 = 0.25;
/// Farthest reach of any device of this maker from the centre of its workspace.
const FARTHEST_M: f64 = 1.0;
/// Most states read in one tick.
const MOST_STATES: u32 = 16;
/// Longest state that is read; a normal one has some kilobytes.
const LONGEST_STATE: usize = 16 * 1024;
/// Unsolicited messages tolerated per tick; the burst limit is larger.
const SURPLUS_A_TICK: u32 = 2;
const MOST_SURPLUS: u32 = 500;

/// Reasons for a lost connection, by number.
pub mod loss {
    /// The service closed it.
    pub const CLOSED: u32 = 1;
    /// The service does not answer.
    pub const SILENT: u32 = 2;
    /// The device is missing from the service's list.
    pub const UNPLUGGED: u32 = 3;
    /// A tick panicked.
    pub const PANIC: u32 = 4;
    /// The service sends unsolicited messages.
    pub const FLOOD: u32 = 5;

    /// Returns the reason in words, with the remedy.
    pub fn text(code: u32) -> &'static str {
        match code {
            CLOSED => "the service closed the connection; it is reopened automatically",
            SILENT => "the service does not answer: restart it; it is reconnected automatically",
            UNPLUGGED => "it is unplugged or switched off; it is reconnected automatically",
            FLOOD => "the service sends unsolicited messages: restart it; it is reconnected automatically",
            _ => "an error in rt-core: report it",
        }
    }
}

/// Ports and settings of a servo tick, and its state.
pub struct Servo {
    placement: Placement,
    arm: Arm,
    end: ServoEnd,
    servo_hz: u32,
    hold: Hold,
    sequence: u64,
    served: bool,
    link: Option<Link>,
    grip: HandleOrientation,
    arrived: String,
    out: String,
}

/// One connection.
struct Link {
    wire: Box<dyn Wire>,
    id: String,
    /// Force of the last message, N, device frame.
    sent_n: Vector3<f64>,
    /// Messages without an answer.
    owed: u32,
    /// Unsolicited messages beyond the tolerated rate.
    surplus: u32,
    /// Ticks since the oldest unanswered message.
    waited: u32,
    /// Position and velocity of the last state.
    last: [Vector3<f64>; 2],
    /// Ticks for which they have not changed under a force.
    still: u32,
}

/// Orientation of the handle relative to the first opening of the device, when it is assumed to
/// point straight ahead.
#[derive(Default)]
struct HandleOrientation {
    straight: Option<UnitQuaternion<f64>>,
    now: UnitQuaternion<f64>,
    buttons: u32,
}

impl Servo {
    pub fn new(placement: Placement, arm: Arm, end: ServoEnd, servo_hz: u32) -> Self {
        Self {
            placement,
            arm,
            end,
            servo_hz,
            hold: Hold::default(),
            sequence: 0,
            served: false,
            link: None,
            grip: HandleOrientation::default(),
            arrived: String::with_capacity(16 * 1024),
            out: String::with_capacity(1024),
        }
    }

    /// Serves this device from the next tick on. After an earlier connection the force stays off
    /// until no fault has occurred for a while.
    pub fn begin(&mut self, wire: Box<dyn Wire>, description: &Description) {
        if self.served {
            self.hold.pause(DeviceFault::NotConnected);
        }
        self.served = true;
        self.link = Some(Link {
            wire,
            id: description.id.clone(),
            sent_n: Vector3::zeros(),
            owed: 0,
            surplus: 0,
            waited: 0,
            last: [Vector3::zeros(); 2],
            still: 0,
        });
    }

    /// Runs one servo tick, until `until`, in the order of the data.
    pub fn tick(&mut self, shared: &Shared, until: Instant) {
        shared.count_tick();
        let wrench = self.hold.wrench(self.end.commands.read(), self.servo_hz);
        let force_n = self.placement.to_device(&wrench.force_n);
        let answered = self.link.as_ref().is_some_and(|link| link.owed == 0);
        if answered || force_n == Vector3::zeros() && self.has_force() {
            self.send(shared, force_n);
        }
        self.take_states(shared, until);
        self.check_silence(shared);
        // A fault found in this tick withdraws the force at once.
        if self.hold.fault().is_some() && self.has_force() {
            self.send(shared, Vector3::zeros());
        }
        shared.fault.set(self.hold.end_tick(self.servo_hz));
    }

    /// Writes zero force and closes the connection.
    pub fn end_connection(&mut self) {
        if let Some(mut link) = self.link.take() {
            message::force(&mut self.out, &link.id, [0.0; 3]);
            let _ = link.wire.send(&self.out);
            link.wire.close();
        }
    }

    fn has_force(&self) -> bool {
        self.link.as_ref().is_some_and(|link| link.sent_n != Vector3::zeros())
    }

    fn send(&mut self, shared: &Shared, force_n: Vector3<f64>) {
        let Some(link) = &mut self.link else { return };
        message::force(&mut self.out, &link.id, force_n.into());
        link.sent_n = force_n;
        match link.wire.send(&self.out) {
            Ok(()) => link.owed += 1,
            Err(_) => self.lose(shared, DeviceFault::NotConnected, loss::CLOSED),
        }
    }

    /// Reads the states that have arrived, and waits for outstanding answers.
    fn take_states(&mut self, shared: &Shared, until: Instant) {
        let mut arrived = core::mem::take(&mut self.arrived);
        if let Some(link) = &mut self.link {
            link.surplus = link.surplus.saturating_sub(SURPLUS_A_TICK);
        }
        for _ in 0..MOST_STATES {
            let Some(link) = &mut self.link else { break };
            // Unsolicited messages must not make us read old states.
            let limit = if link.owed == 0 { Instant::now() } else { until };
            let received = link.wire.receive(limit, &mut arrived);
            if received == Ok(false) {
                break;
            }
            link.surplus += u32::from(link.owed == 0);
            let is_flood = link.surplus > MOST_SURPLUS;
            link.owed = link.owed.saturating_sub(1);
            link.waited = 0;
            if is_flood {
                self.lose(shared, DeviceFault::Driver, loss::FLOOD);
                break;
            }
            match received {
                Err(WireError::Closed) => {
                    self.lose(shared, DeviceFault::NotConnected, loss::CLOSED);
                    break;
                }
                Err(WireError::NoText) => self.fail(shared, DeviceFault::Driver),
                Ok(_) if arrived.len() > LONGEST_STATE => self.fail(shared, DeviceFault::Driver),
                Ok(_) => self.take_state(shared, &arrived),
            }
        }
        self.arrived = arrived;
    }

    fn take_state(&mut self, shared: &Shared, text: &str) {
        let Some(frame) = Frame::of(text) else {
            return self.fail(shared, DeviceFault::Driver);
        };
        let found = self.link.as_ref().and_then(|link| frame.device(&link.id));
        let Some(device) = found else {
            return self.lose(shared, DeviceFault::NotConnected, loss::UNPLUGGED);
        };
        match self.sample(device, frame.grip()) {
            Ok(sample) => self.end.samples.write(Some(sample)),
            Err(fault) => self.fail(shared, fault),
        }
    }

    fn sample(&mut self, device: &Inverse<'_>, grip: Option<&Grip<'_>>) -> Result<Sample, DeviceFault> {
        let status = device.status;
        if status.power_supply == Some(false) {
            return Err(DeviceFault::NotConnected);
        }
        if status.calibrated == Some(false) {
            return Err(DeviceFault::NotCalibrated);
        }
        if status.ready == Some(false) || device.state.transform.as_ref().is_some_and(|t| !t.keeps_axes()) {
            return Err(DeviceFault::Driver);
        }
        let position = device.state.cursor_position.ok_or(DeviceFault::Driver)?.vector();
        let velocity = device.state.cursor_velocity.map_or(Vector3::zeros(), |v| v.vector());
        if position.iter().chain(velocity.iter()).any(|x| !x.is_finite()) {
            return Err(DeviceFault::NonFiniteSample);
        }
        if position.amax() > FARTHEST_M {
            return Err(DeviceFault::Driver);
        }
        self.check_motion([position, velocity])?;
        self.grip.follow(grip)?;
        self.sequence += 1;
        let (tip_in_world, world_from_tool) = self.placement.pose(&position, &self.grip.now);
        Ok(Sample {
            tip_in_world,
            world_from_tool,
            buttons: self.grip.buttons,
            sequence: self.sequence,
        })
    }

    /// Detects a service that repeats an old state: only a loaded hand that does not move at all
    /// reveals it.
    fn check_motion(&mut self, state: [Vector3<f64>; 2]) -> Result<(), DeviceFault> {
        let is_pushed = self.has_force();
        let Some(link) = &mut self.link else { return Ok(()) };
        link.still = if is_pushed && state == link.last {
            link.still + 1
        } else {
            0
        };
        link.last = state;
        if f64::from(link.still) >= FROZEN_S * f64::from(self.servo_hz) {
            Err(DeviceFault::TimedOut)
        } else {
            Ok(())
        }
    }

    fn check_silence(&mut self, shared: &Shared) {
        let Some(link) = &mut self.link else { return };
        link.waited = if link.owed > 0 { link.waited + 1 } else { 0 };
        let waited_s = f64::from(link.waited) / f64::from(self.servo_hz.max(1));
        if waited_s >= SILENT_S {
            self.lose(shared, DeviceFault::TimedOut, loss::SILENT);
        } else if waited_s >= LATE_S {
            self.hold.pause(DeviceFault::TimedOut);
        }
    }

    /// Turns the force off; the connection holds.
    fn fail(&mut self, shared: &Shared, fault: DeviceFault) {
        shared.errors.note(0);
        self.hold.pause(fault);
    }

    /// Declares the connection lost.
    fn lose(&mut self, shared: &Shared, fault: DeviceFault, why: u32) {
        self.hold.lose(fault);
        shared.fault.set(Some(fault));
        shared.errors.note(why);
        shared.errors.set_lost();
    }
}

impl HandleOrientation {
    /// Takes the orientation of the handle; without one, the last one holds.
    fn follow(&mut self, grip: Option<&Grip<'_>>) -> Result<(), DeviceFault> {
        let Some(grip) = grip else { return Ok(()) };
        if let Some(orientation) = grip.state.orientation {
            let rotation = orientation.rotation().ok_or(DeviceFault::NonFiniteSample)?;
            let straight = self.straight.get_or_insert(rotation);
            self.now = rotation * straight.inverse();
        }
        self.buttons = grip.state.buttons();
        Ok(())
    }
}

impl Serve for Servo {
    fn arm(&self) -> Result<String, ArmError> {
        (self.arm)()
    }

    fn run(&mut self, shared: &Shared) {
        if !serving::at_rate(shared, self.servo_hz, |until| self.tick(shared, until)) {
            self.lose(shared, DeviceFault::Driver, loss::PANIC);
        }
        self.end_connection();
    }
}
