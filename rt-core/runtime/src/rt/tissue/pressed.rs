//! The body under the ultrasound probe: its pose in this tick, its contact, and other displacements of the wall.

use super::TissueLoop;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::tissue_tape::TapedOrder;
use stylet_sim::probe::{BodyProbe, ProbePose, ProbeResponse};
use stylet_sim::tissue::Carry;

impl TissueLoop {
    /// Sets the probe's pose from the next tick on.
    pub fn move_probe(&mut self, pose: ProbePose) {
        self.state.probe_pose = Some(pose);
    }

    /// Response to the probe in the last tick; `None` in a scene without one.
    pub fn probe_response(&self) -> Option<&ProbeResponse> {
        self.pressed.as_ref().map(|pressed| pressed.response())
    }

    /// The probe of this scene.
    pub fn pressed(&self) -> Option<&BodyProbe> {
        self.pressed.as_deref()
    }

    /// Takes a probe; one of a replaced scene is returned.
    pub(super) fn take_probe(&mut self, generation: u64, probe: Box<BodyProbe>, room: Box<ProbeTape>) {
        // A tick must not free: room without a tape is kept for good.
        if let Some(unused) = self.probe_room.replace(room) {
            std::mem::forget(unused);
        }
        if generation != self.world.generation {
            return self.free_probe(probe);
        }
        self.drop_probe();
        let edge_m = probe.ready().solved.edge_m;
        self.tape_order(TapedOrder::Probe { edge_m });
        self.pressed = Some(probe);
    }

    /// Drops the probe, whose body is replaced, by way of the control thread: a tick must not free.
    pub(super) fn drop_probe(&mut self) {
        if let Some(old) = self.pressed.take() {
            self.last_carry.forget();
            self.free_probe(old);
        }
    }

    fn free_probe(&mut self, old: Box<BodyProbe>) {
        if let Err(rtrb::PushError::Full(old)) = self.ports.old_probes.push(old) {
            std::mem::forget(old);
        }
    }

    pub(super) fn reset_probe(&mut self) {
        if let Some(pressed) = &mut self.pressed {
            pressed.reset();
        }
    }

    /// Solves the contact of this tick. Needles displace the wall as well, and the probe their surroundings: one table
    /// with this tick's loads serves both.
    pub(super) fn follow_probe(&mut self) {
        let (Some(pressed), Some(pose)) = (&mut self.pressed, self.state.probe_pose) else {
            return;
        };
        let was_displaced = pressed.displaces();
        let (line, left) = (&self.line, &self.left);
        pressed.nothing_beside(|generation| {
            let moves = line.as_ref().is_some_and(|line| line.generation == generation);
            moves || left.iter().any(|left| left.line.generation == generation)
        });
        if let Some(line) = line {
            let loads = if line.generation == self.state.loads.generation {
                self.state.loads.loads_n()
            } else {
                &[]
            };
            pressed.beside(line.generation, line.answer.columns(), loads);
        }
        for left in left {
            let (line, loads_n) = (&left.line, left.used.of_columns());
            pressed.beside(line.generation, line.answer.columns(), &loads_n);
        }
        if pressed.follow(&pose) {
            self.last_carry.forget();
            let is_displaced = pressed.displaces();
            if was_displaced && !is_displaced && self.besides().is_none() {
                self.world.tissue.carry(Carry::NOT);
            }
        }
        self.show_outside();
    }

    /// Shows the probe's displacement of the lines of all needles while there is any, and once more when it ends.
    fn show_outside(&mut self) {
        let Some(pressed) = &self.pressed else { return };
        let is_pressed = pressed.response().contacts > 0;
        if is_pressed || self.state.is_outside_shown {
            let outside = self.ports.outside.input_buffer_mut();
            outside.clear();
            let moves = self.line.iter().map(|line| line.generation);
            for generation in moves.chain(self.left.iter().map(|left| left.line.generation)) {
                if let Some(line) = outside.add() {
                    line.set(generation, |rows_m| pressed.displace_line(generation, rows_m));
                }
            }
            self.ports.outside.publish();
            self.state.response.outside += 1;
            self.state.is_outside_shown = is_pressed;
        }
    }
}
