//! The tissue loop's side of the flight recorder: saves and restores all state between ticks.

use super::TissueLoop;
use super::left::LeftBody;
use crate::rt::probe_tape::ProbeEntry;
use crate::rt::tissue_tape::{TapedOrder, TissueEntry, TissueMemory, TissueState, TissueTape};
use stylet_sim::line::BodyLine;
use stylet_sim::probe::{BodyProbe, ProbeMemory};
use stylet_sim::tissue::{Deformed, Held};

impl TissueLoop {
    /// Copies all state but that of the lines, which `state.response` names. Allocates nothing: `to` was made for this
    /// body.
    fn copy_memory(&self, to: &mut TissueMemory) {
        to.state = self.state;
        to.seeds.clone_from(&self.seeds);
        to.removed.clone_from(&self.removed);
        to.left.clear();
        to.left.extend(self.left.iter().map(|left| left.used));
        match &self.pressed {
            Some(pressed) => pressed.save(&mut to.probe),
            None => to.probe.clear(),
        }
        to.limits.clone_from(&self.world.limits);
        to.migration = self.world.migration;
        self.world.tissue.save(&mut to.body);
    }

    /// Continues from the memory of another loop, with its line and those of needles that stayed in.
    pub fn remember(&mut self, memory: &TissueMemory, line: Option<Box<BodyLine>>, left: Vec<Box<BodyLine>>) {
        self.last_carry.forget();
        self.left.clear();
        for (line, used) in left.into_iter().zip(&memory.left) {
            let mut body = LeftBody { line, used: *used };
            body.stay(used);
            self.left.push(body);
        }
        self.state = memory.state;
        self.seeds.clone_from(&memory.seeds);
        self.removed.clone_from(&memory.removed);
        self.line = line;
        self.world.set_limits(memory.limits.clone());
        self.world.migration = memory.migration;
        self.world.tissue.load(&memory.body);
    }

    /// Restores the probe from that memory; false if it belongs to another wall.
    pub fn resume_probe(&mut self, mut probe: Box<BodyProbe>, memory: &TissueMemory) -> bool {
        let fits = probe.load(&memory.probe);
        self.pressed = Some(probe);
        fits
    }

    /// State of the probe between ticks.
    pub fn probe_memory(&self) -> ProbeMemory {
        let mut memory = ProbeMemory::default();
        if let Some(pressed) = &self.pressed {
            memory = ProbeMemory::with_room(pressed);
            pressed.save(&mut memory);
        }
        memory
    }

    /// The deformed body.
    pub fn body(&self) -> Deformed<'_> {
        self.world.tissue.deformed()
    }

    /// Results of the last tick to compare: the held element and the residual.
    pub fn last_step(&self) -> (Option<Held>, f64) {
        (self.state.held, self.report.map_or(0.0, |r| r.residual))
    }

    pub(super) fn checkpoint(&mut self) {
        let generation = self.world.generation;
        self.ports.flight.begin_tick(generation);
        self.give_probe_room();
        self.with_tape(|this, tape| {
            if let Some(memory) = tape.checkpoint_due(this.world.tissue.is_all_saved()) {
                this.copy_memory(memory);
            }
        });
    }

    pub(super) fn tape_order(&mut self, order: TapedOrder) {
        if let Some(tape) = self.ports.flight.tape() {
            tape.order(order);
        }
    }

    pub(super) fn tape(&mut self, woke_ns: u64, residual: f64) {
        let TissueState {
            pose,
            loads,
            held,
            response,
            ..
        } = self.state;
        if self.left_room.is_some()
            && let Some(tape) = self.ports.flight.tape()
        {
            tape.take_left_room(&mut self.left_room);
        }
        self.give_probe_room();
        self.tape_probe();
        if let Some(tape) = self.ports.flight.tape() {
            tape.left_loads(&self.left_loads);
            tape.ticks.push(TissueEntry {
                woke_ns,
                pose,
                loads,
                held,
                residual,
                response,
            });
        }
    }

    fn give_probe_room(&mut self) {
        if self.probe_room.is_some()
            && let Some(tape) = self.ports.flight.tape()
        {
            tape.take_probe_room(&mut self.probe_room);
        }
    }

    fn tape_probe(&mut self) {
        if let (Some(pressed), Some(pose)) = (&self.pressed, self.state.probe_pose)
            && let Some(tape) = self.ports.flight.tape()
        {
            let wrench = pressed.response().wrench.0;
            tape.probe(ProbeEntry { pose, wrench });
        }
    }

    pub(super) fn hand_over_tape(&mut self) {
        self.with_tape(|this, tape| {
            if let Some(memory) = tape.end() {
                this.copy_memory(memory);
            }
        });
        self.ports.flight.hand_over();
    }

    /// Writes to the tape from this loop's own memory; the tape is taken out meanwhile.
    fn with_tape(&mut self, write: impl FnOnce(&Self, &mut TissueTape)) {
        if let Some(mut tape) = self.ports.flight.take() {
            write(self, &mut tape);
            self.ports.flight.put(tape);
        }
    }
}
