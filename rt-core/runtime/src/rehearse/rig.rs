//! Both loops with a simulated device, stepped by hand: five force ticks, then one of the tissue, as the clock would have it.

use super::NeedleRun;
use crate::core::{HAPTIC_PERIOD_NS, TISSUE_PERIOD_NS};
use crate::rt::exchange::{HapticOrder, Notice, SnapshotReturn, TipPose, TissueOrder, TissueResponse};
use crate::rt::haptic::{HapticLoop, HapticPorts};
use crate::rt::haptic_tape::HapticMemory;
use crate::rt::recorder::Recorder;
use crate::rt::tissue::{TissueLoop, TissuePorts};
use crate::rt::world::World;
use nalgebra::Vector3;
use stylet_hw::{DeviceInfo, HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_shm_schema::{HapticState, RefusalCode, SeedPose, TickRecord};
use stylet_sim::active::Active;

/// The tip begins so far before the entry, and comes to it as in a run.
const RUN_UP_M: f64 = 0.01;

pub struct Rig {
    haptic: HapticLoop,
    tissue: TissueLoop,
    haptic_orders: rtrb::Producer<HapticOrder>,
    tissue_orders: rtrb::Producer<TissueOrder>,
    haptic_notices: rtrb::Consumer<Notice>,
    tissue_notices: rtrb::Consumer<Notice>,
    records: rtrb::Consumer<TickRecord>,
    /// Ends that nobody uses; a ring must keep both.
    _spare: (
        rtrb::Consumer<Box<World>>,
        rtrb::Consumer<SnapshotReturn>,
        rtrb::Producer<crate::rt::exchange::SnapshotSlot>,
    ),
    now_ns: u64,
    refusal: Option<RefusalCode>,
}

impl Rig {
    pub fn new(world: Box<World>, active: &Active, device: &DeviceInfo, run: &NeedleRun) -> Self {
        let (pose_in, pose_out) = triple_buffer::triple_buffer(&TipPose::default());
        let (response_in, response_out) = triple_buffer::triple_buffer(&TissueResponse::default());
        let (record_in, records) = rtrb::RingBuffer::new(16);
        let (haptic_orders, haptic_order_out) = rtrb::RingBuffer::new(16);
        let (haptic_notice_in, haptic_notices) = rtrb::RingBuffer::new(64);
        let (tissue_orders, tissue_order_out) = rtrb::RingBuffer::new(16);
        let (tissue_notice_in, tissue_notices) = rtrb::RingBuffer::new(64);
        let (old_world_in, old_worlds) = rtrb::RingBuffer::new(1);
        let (slot_in, slots) = rtrb::RingBuffer::new(1);
        let (filled_in, filled) = rtrb::RingBuffer::new(1);
        let phantom = SimulatedPhantom::new(SimulatedPhantomConfig {
            info: DeviceInfo {
                simulated: true,
                ..*device
            },
            start_tip_in_world: run.entry_m - run.direction * RUN_UP_M,
            start_direction: run.direction,
            ..SimulatedPhantomConfig::default()
        });
        let memory = HapticMemory::new(device, (active.needle, active.force), 0);
        let haptic_ports = HapticPorts {
            pose: pose_in,
            response: response_out,
            orders: haptic_order_out,
            notices: haptic_notice_in,
            records: record_in,
            flight: Recorder::without_tape(),
        };
        let tissue_ports = TissuePorts {
            pose: pose_out,
            response: response_in,
            orders: tissue_order_out,
            notices: tissue_notice_in,
            old_worlds: old_world_in,
            slots,
            filled: filled_in,
            flight: Recorder::without_tape(),
        };
        let seconds = |ns: u64| ns as f64 / 1e9;
        let (haptic_s, tissue_s) = (seconds(HAPTIC_PERIOD_NS), seconds(TISSUE_PERIOD_NS));
        Self {
            haptic: HapticLoop::new(0, Box::new(phantom), haptic_ports, &memory, haptic_s),
            tissue: TissueLoop::new(0, tissue_ports, world, tissue_s),
            haptic_orders,
            tissue_orders,
            haptic_notices,
            tissue_notices,
            records,
            _spare: (old_worlds, filled, slot_in),
            now_ns: 0,
            refusal: None,
        }
    }

    /// One tick of the force, and the tissue's where one is due.
    pub fn tick(&mut self) {
        self.now_ns += HAPTIC_PERIOD_NS;
        self.haptic.tick(self.now_ns, self.now_ns, 0);
        while self.records.pop().is_ok() {}
        if self.now_ns.is_multiple_of(TISSUE_PERIOD_NS) {
            self.tissue.tick(self.now_ns);
        }
        while let Ok(notice) = self.haptic_notices.pop() {
            self.hear(&notice);
        }
        while let Ok(notice) = self.tissue_notices.pop() {
            self.hear(&notice);
        }
    }

    fn hear(&mut self, notice: &Notice) {
        if let Notice::Refused { why, .. } = notice {
            self.refusal = Some(*why);
        }
    }

    /// What a loop refused since the last call.
    pub fn refusal(&mut self) -> Option<RefusalCode> {
        self.refusal.take()
    }

    pub fn engage(&mut self) {
        // Both rings are emptied before the script goes on, and are never full.
        let _ = self.haptic_orders.push(HapticOrder::Engage { ticket: 0 });
    }

    pub fn go(&mut self, to_m: Vector3<f64>, direction: Vector3<f64>, speed_m_per_s: f64, acceleration_m_per_s2: f64) {
        let goal = HandGoal {
            tip_in_world: to_m,
            direction,
            speed_m_per_s,
            acceleration_m_per_s2,
        };
        let _ = self.haptic_orders.push(HapticOrder::Hand { ticket: 0, goal });
    }

    pub fn drop_seed(&mut self) {
        let _ = self.tissue_orders.push(TissueOrder::DropSeed { ticket: 0 });
    }

    pub fn state(&self) -> &HapticState {
        &self.haptic.state
    }

    pub fn seeds(&self) -> Vec<SeedPose> {
        self.tissue.seeds().collect()
    }

    pub fn displacement_m(&self) -> f64 {
        self.tissue.displacement_m()
    }

    pub fn seconds(&self) -> f64 {
        self.now_ns as f64 / 1e9
    }

    pub fn into_world(self) -> Box<World> {
        self.tissue.into_world()
    }
}
