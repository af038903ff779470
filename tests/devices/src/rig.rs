//! The whole haptic loop over a stepped device, against a membrane at z = 0: one thread, one clock.

use stylet_hw::Device;
use stylet_runtime::rt::exchange::HapticOrder;
use stylet_runtime::rt::haptic::HapticLoop;
use stylet_runtime::rt::haptic_tape::HapticMemory;
use stylet_runtime::rt::response::TissueResponse;
use stylet_runtime::rt::wiring::{Capacities, ControlPorts, TissuePorts, Wiring};
use stylet_shm_schema::{Fault, TickRecord};
use stylet_sim::force::ForceParameters;
use stylet_sim::needle::{LayerKind, NeedleParameters};

const TICK_NS: u64 = 1_000_000;
/// Depth at which the hand waits; the pressing depth follows.
const OUTSIDE_M: f64 = -0.005;
const PRESSED_M: f64 = 0.006;
const SPEED_M_PER_TICK: f64 = 4e-5;

/// A fake device that a test leads.
pub trait FakeDevice {
    /// Sets the time of the fake.
    fn at(&self, now_ns: u64);
    /// Holds the tip at this depth along world z.
    fn hold(&self, depth_m: f64);
    /// Returns the force of the device's motors, N.
    fn motors_n(&self) -> f64;
}

pub struct Rig<F: FakeDevice> {
    pub fake: F,
    haptic: HapticLoop,
    tissue: TissueResponse,
    tissue_ports: TissuePorts,
    control: ControlPorts,
    contacts: u64,
    now_ns: u64,
    hand_m: f64,
}

/// Result of one tick.
pub struct Seen {
    pub record: TickRecord,
    /// Force of the device's motors, N.
    pub motors_n: f64,
}

impl Seen {
    pub fn fault(&self) -> Fault {
        Fault::from_number(self.record.fault).expect("a known fault")
    }
}

impl<F: FakeDevice> Rig<F> {
    /// Creates a rig over the device that `open` gives for this fake.
    pub fn over(fake: F, open: impl FnOnce(&F) -> Box<dyn Device>) -> Self {
        let now_ns = 1_000_000_000;
        fake.at(now_ns);
        let device = open(&fake);
        let parameters = (NeedleParameters::default(), ForceParameters::default());
        let memory = HapticMemory::new(&device.info(), parameters, 0);
        let wiring = Wiring::new(Capacities::STEPPED, None, None);
        let mut rig = Self {
            fake,
            haptic: HapticLoop::new(1, device, wiring.haptic, &memory, 1e-3),
            tissue: TissueResponse::default(),
            tissue_ports: wiring.tissue,
            control: wiring.control,
            contacts: 0,
            now_ns,
            hand_m: OUTSIDE_M,
        };
        rig.hold(OUTSIDE_M);
        rig
    }

    /// Holds the tip at this depth.
    fn hold(&mut self, depth_m: f64) {
        self.hand_m = depth_m;
        self.fake.hold(depth_m);
    }

    pub fn tick(&mut self) -> Seen {
        self.now_ns += TICK_NS;
        self.fake.at(self.now_ns);
        self.tissue.time_ns = self.now_ns;
        self.tissue_ports.response.write(self.tissue);
        self.haptic.tick(self.now_ns, self.now_ns, 0);
        while self.control.haptic_notices.pop().is_ok() {}
        let record = self.control.records.pop().expect("a record for each tick");
        // The membrane is in contact once the tip passes it, until the tip is well outside.
        let depth_m = record.tip_in_scene_m[2];
        if depth_m > 0.0 && self.tissue.contact == 0 {
            self.contacts += 1;
            self.tissue.contact = self.contacts;
            (self.tissue.layer, self.tissue.layer_number) = (LayerKind::Gland, self.contacts);
        } else if depth_m < -2e-3 {
            self.tissue.contact = 0;
        }
        Seen {
            record,
            motors_n: self.fake.motors_n(),
        }
    }

    fn move_to(&mut self, depth_m: f64) -> Seen {
        loop {
            let left_m = depth_m - self.hand_m;
            self.hold(self.hand_m + left_m.clamp(-SPEED_M_PER_TICK, SPEED_M_PER_TICK));
            let seen = self.tick();
            if left_m == 0.0 {
                return seen;
            }
        }
    }

    /// Draws back, arms again, and presses until the membrane resists. Returns false if the force
    /// did not return.
    pub fn press(&mut self) -> bool {
        self.move_to(OUTSIDE_M);
        for _ in 0..3000 {
            let seen = self.tick();
            if seen.fault() == Fault::None && self.haptic.memory.state.flags & stylet_shm_schema::flags::ENGAGED != 0 {
                break;
            }
            if self.control.haptic_orders.slots() > 1 {
                let _ = self.control.haptic_orders.push((0, HapticOrder::Engage));
            }
        }
        for _ in 0..250 {
            self.tick();
        }
        let seen = self.move_to(PRESSED_M);
        seen.fault() == Fault::None && (1.0..8.5).contains(&seen.motors_n)
    }
}
