//! Drives the stepped loops in a rehearsal: a simulated device, orders, and refusals.

use crate::rt::exchange::{HapticOrder, TissueOrder, TissueStep, hand_order};
use crate::rt::haptic_tape::HapticMemory;
use crate::rt::world::World;
use crate::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use nalgebra::Vector3;
use stylet_hw::{Device, DeviceInfo, Hand, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_shm_schema::{HandMove, HapticState, NeedleRehearsal, RefusalCode, SeedPose};
use stylet_sim::active::Active;
use stylet_sim::line::{LeftNeedles, LeftRecord, ReadyLine};
use stylet_sim::tissue::Deformed;

/// Distance before the entry at which the tip begins, and from which it approaches as in a run.
const RUN_UP_M: f64 = 0.01;

pub struct Rig {
    loops: SteppedLoops,
    refusal: Option<RefusalCode>,
    /// Lines of the needles still to come, the next one last.
    lines: Vec<ReadyLine>,
}

impl Rig {
    pub fn new(world: Box<World>, active: &Active, (device, hand): (&DeviceInfo, Hand), run: &NeedleRehearsal) -> Self {
        let direction = Vector3::from(run.direction);
        let phantom = SimulatedPhantom::new(SimulatedPhantomConfig {
            info: DeviceInfo {
                simulated: true,
                ..*device
            },
            hand,
            start_tip_in_world: Vector3::from(run.entry_m) - direction * RUN_UP_M,
            start_direction: direction,
            ..SimulatedPhantomConfig::default()
        });
        Self::with_device(world, active, device, Box::new(phantom))
    }

    /// Makes loops over a device that moves by itself.
    pub fn with_device(world: Box<World>, active: &Active, info: &DeviceInfo, device: Box<dyn Device>) -> Self {
        let memory = HapticMemory::new(info, (active.needle, active.force), 0);
        Self {
            loops: SteppedLoops::new(world, device, &memory, HAPTIC_TICKS_PER_TISSUE_TICK),
            refusal: None,
            lines: Vec::new(),
        }
    }

    /// Takes lines in the order of the needles; the first is applied at once.
    pub fn take_lines(&mut self, mut lines: Vec<ReadyLine>) {
        if lines.len() > 1 {
            self.take_lines_of_many(lines);
        } else if let Some(line) = lines.pop() {
            self.take_line(line);
        }
    }

    /// Takes lines in the order of the needles, some of which stay in; [`next_line`](Self::next_line) applies each.
    pub fn take_lines_of_many(&mut self, mut lines: Vec<ReadyLine>) {
        lines.reverse();
        self.lines = lines;
        let _ = self.loops.control.rooms.push(LeftNeedles::with_room());
    }

    /// Places needles that stay in as in `record`, on those of `lines` that it names. Call before the first tick.
    pub fn stand(&mut self, lines: &[ReadyLine], record: &LeftRecord) -> bool {
        let of = |generation: u64| lines.iter().find(|line| line.hand.generation == generation);
        let fits = self
            .loops
            .haptic
            .resume_left(record, |n| of(n).map(|line| line.hand.clone()));
        let bodies = record
            .line_numbers()
            .filter_map(|n| of(n).map(|line| line.body.clone()));
        self.loops
            .tissue
            .begin_beside(bodies.collect(), &self.loops.haptic.left_loads());
        fits
    }

    /// Returns the state of the needles that stay in.
    pub fn standing(&self) -> LeftRecord {
        self.loops.haptic.left_record()
    }

    /// Applies the next needle's line.
    pub fn next_line(&mut self) {
        if let Some(line) = self.lines.pop() {
            self.take_line(line);
        }
    }

    /// Applies a line before the needle begins.
    pub fn take_line(&mut self, line: ReadyLine) {
        // Both rings are empty.
        let _ = self.loops.control.lines.push(line.hand);
        let _ = self.loops.control.tissue_orders.push(TissueOrder::Line(line.body));
    }

    /// Runs one tick of the force loop, and one of the tissue loop when due, in which case it returns true.
    pub fn tick(&mut self) -> bool {
        let tissue_tick = self.loops.tissue.response().tick;
        self.loops.step();
        self.refusal = self.loops.answers().or(self.refusal);
        self.loops.tissue.response().tick != tissue_tick
    }

    /// Returns a refusal since the last call.
    pub fn refusal(&mut self) -> Option<RefusalCode> {
        self.refusal.take()
    }

    pub fn engage(&mut self) {
        // Both rings are emptied before the script continues, and are never full.
        let _ = self.loops.control.haptic_orders.push((0, HapticOrder::Engage));
    }

    pub fn leave_needle(&mut self) {
        let _ = self.loops.control.haptic_orders.push((0, HapticOrder::LeaveNeedle));
    }

    /// Forgets the peaks of stabilising needles, which do not count for this needle.
    pub fn forget_peaks(&mut self) {
        self.loops.haptic.memory.state.peak_force_n = 0.0;
    }

    pub fn move_hand(&mut self, hand: &HandMove) {
        let _ = self.loops.control.haptic_orders.push((0, hand_order(hand, None, None)));
    }

    pub fn drop_seed(&mut self, strand_pitch_m: Option<f64>) {
        let step = TissueStep::DropSeed { strand_pitch_m };
        let _ = self.loops.control.tissue_orders.push(TissueOrder::Step(0, step));
    }

    pub fn state(&self) -> &HapticState {
        &self.loops.haptic.memory.state
    }

    pub fn seeds(&self) -> Vec<SeedPose> {
        self.loops.tissue.seeds().collect()
    }

    /// Returns the seeds as they will be without a needle in the tissue.
    pub fn seeds_at_rest(&self) -> Vec<SeedPose> {
        self.loops.tissue.seeds_at_rest().collect()
    }

    pub fn deformed(&self) -> Deformed<'_> {
        self.loops.tissue.world().tissue.deformed()
    }

    pub fn displacement_m(&self) -> f64 {
        self.loops.tissue.displacement_m()
    }

    pub fn seconds(&self) -> f64 {
        self.loops.seconds()
    }

    pub fn into_world(self) -> Box<World> {
        self.loops.tissue.into_world()
    }
}

#[cfg(test)]
mod tests;
