//! Both loops on one thread and one clock: the ticks of a run, in the order that the clock would give them.
//!
//! Rehearsals, measurements and tests step the same `HapticLoop` and `TissueLoop` that a run drives from two threads.

use crate::rt::clock::{HAPTIC_PERIOD_NS, TISSUE_PERIOD_NS};
use crate::rt::exchange::Notice;
use crate::rt::haptic::HapticLoop;
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::tissue::TissueLoop;
use crate::rt::tissue_tape::TissueTape;
use crate::rt::wiring::{Capacities, ControlPorts, TapePorts, Wiring};
use crate::rt::world::World;
use stylet_hw::Device;
use stylet_shm_schema::RefusalCode;
use stylet_sim::force::chain::ChainOutput;

/// Ticks of the force loop for each tick of the tissue loop, in a run.
pub const HAPTIC_TICKS_PER_TISSUE_TICK: u64 = TISSUE_PERIOD_NS / HAPTIC_PERIOD_NS;

/// Two loops without threads, and the control thread's ends of their rings.
pub struct SteppedLoops {
    /// The force loop.
    pub haptic: HapticLoop,
    /// The tissue loop.
    pub tissue: TissueLoop,
    /// Takes orders and gives notices. Records are dropped after each step.
    pub control: ControlPorts,
    /// Flight recordings of loops that have a tape.
    pub tapes: TapePorts,
    tissue_period_ns: u64,
    now_ns: u64,
    missed: u32,
}

impl SteppedLoops {
    /// Begins at time 0 with `memory`. The tissue loop ticks after every `haptic_ticks_per_tissue_tick`-th force-loop
    /// tick, at least one. Nothing is recorded.
    pub fn new(
        world: Box<World>,
        device: Box<dyn Device>,
        memory: &HapticMemory,
        haptic_ticks_per_tissue_tick: u64,
    ) -> Self {
        Self::with_tapes(world, device, memory, haptic_ticks_per_tissue_tick, (None, None))
    }

    /// As [`new`](Self::new), with flight recordings of the loops that have a tape.
    pub fn with_tapes(
        world: Box<World>,
        device: Box<dyn Device>,
        memory: &HapticMemory,
        haptic_ticks_per_tissue_tick: u64,
        (haptic_tape, tissue_tape): (Option<Box<HapticTape>>, Option<Box<TissueTape>>),
    ) -> Self {
        let Wiring {
            haptic,
            tissue,
            control,
            tapes,
        } = Wiring::new(Capacities::STEPPED, haptic_tape, tissue_tape);
        let tissue_period_ns = haptic_ticks_per_tissue_tick.max(1) * HAPTIC_PERIOD_NS;
        let seconds = |ns: u64| ns as f64 / 1e9;
        Self {
            haptic: HapticLoop::new(0, device, haptic, memory, seconds(HAPTIC_PERIOD_NS)),
            tissue: TissueLoop::new(0, tissue, world, seconds(tissue_period_ns)),
            control,
            tapes,
            tissue_period_ns,
            now_ns: 0,
            missed: 0,
        }
    }

    /// Runs one tick of the force loop, and one of the tissue loop when due. Returns the output of the force chain.
    pub fn step(&mut self) -> ChainOutput {
        self.now_ns += HAPTIC_PERIOD_NS;
        let output = self.haptic.tick(self.now_ns, self.now_ns, 0);
        while self.control.records.pop().is_ok() {}
        if self.now_ns.is_multiple_of(self.tissue_period_ns) {
            if self.missed == 0 {
                self.tissue.tick(self.now_ns);
            }
            self.missed = self.missed.saturating_sub(1);
        }
        output
    }

    /// Frees the lines that both loops gave back, drops their notices, and returns the last refusal among them.
    pub fn answers(&mut self) -> Option<RefusalCode> {
        let control = &mut self.control;
        while control.old_hand_lines.pop().is_ok() || control.old_body_lines.pop().is_ok() {}
        let mut refusal = None;
        for notices in [&mut control.haptic_notices, &mut control.tissue_notices] {
            while let Ok(notice) = notices.pop() {
                if let Notice::Refused { why, .. } = notice {
                    refusal = Some(why);
                }
            }
        }
        refusal
    }

    /// Skips the tissue loop's next ticks, as on a busy machine.
    pub fn miss_tissue_ticks(&mut self, ticks: u32) {
        self.missed = ticks;
    }

    /// Simulated time since the start, s.
    pub fn seconds(&self) -> f64 {
        self.now_ns as f64 / 1e9
    }
}
