//! The needle on a prepared line: changes of line, the tick on one, and its forces for the tissue loop.

use super::HapticLoop;
use crate::rt::clock::TISSUE_PERIOD_NS;
use crate::rt::line_loads::{BentTip, LineLoads};
use crate::rt::response::TissueResponse;
use stylet_hw::Sample;
use stylet_sim::force::chain::{ChainOutput, step_on_line};
use stylet_sim::line::Track;
use stylet_sim::line::beam::BeamOutput;

/// A needle up to this far behind the entry counts as outside: plans name entries on the surface, which is made of
/// cells.
const BEGINS_WITHIN_M: f64 = 1e-3;

/// A displacement by the probe is reached within one tissue tick.
const TISSUE_PERIOD_S: f64 = TISSUE_PERIOD_NS as f64 * 1e-9;

/// A needle that was taken again is released at this distance before the entry, m.
const OUT_M: f64 = 4e-3;

impl HapticLoop {
    /// Returns the track that the needle on the present line has cut.
    pub fn line_track(&self) -> Option<Track> {
        self.line.as_ref()?.track()
    }

    /// Returns the state of the present line.
    #[cfg(test)]
    pub fn line_state(&self) -> Option<&stylet_sim::line::LineState> {
        self.line.as_ref().map(|line| line.state())
    }

    /// Follows the probe's displacement of the lines in this tissue tick. Costs one comparison without a probe.
    pub(super) fn follow_outside(&mut self, tissue: &TissueResponse) {
        if tissue.outside == self.memory.outside {
            return;
        }
        self.memory.outside = tissue.outside;
        let outside = self.ports.outside.read();
        if let Some(tape) = self.ports.flight.tape() {
            if tape.lacks_outside_room()
                && let Ok(room) = self.ports.outside_rooms.pop()
            {
                tape.take_outside_room(room);
            }
            outside.lines().iter().for_each(|line| tape.outside(line));
        }
        let ticks = (TISSUE_PERIOD_S / self.device.period_s).round() as u32;
        for of_line in outside.lines() {
            let (generation, rows_m) = (of_line.generation, of_line.rows_m());
            match self.line.as_mut().filter(|line| line.generation == generation) {
                Some(line) => line.displace_from_outside(rows_m, ticks),
                None => {
                    if let Some(left) = self.left.any_mut() {
                        left.displace_from_outside(generation, rows_m, ticks);
                    }
                }
            }
        }
    }

    /// Changes the line, only while the needle is out of the tissue; the old one is returned to be freed.
    pub(super) fn take_line(&mut self) {
        let in_tissue = self.line.as_ref().is_some_and(|line| line.is_in_tissue());
        if in_tissue || self.ports.old_lines.is_full() {
            return;
        }
        if let Ok(mut next) = self.ports.lines.pop() {
            next.set_forces(&self.memory.parameters.layer_forces());
            if let Some(tape) = self.ports.flight.tape() {
                tape.line(next.generation);
            }
            if let Some(old) = self.line.replace(next) {
                if let (Some(track), Some(line)) = (old.track(), &mut self.line) {
                    line.open_track(&track);
                }
                // There is room: checked above, and only this thread fills the ring.
                let _ = self.ports.old_lines.push(old);
            }
            self.left.pair(self.line.as_deref());
        }
    }

    /// True if this tick is on the line: the needle is in tissue along it, or reaches it without any other contact. It
    /// must come from outside: a tip in tissue without a contact, as after a reset, is not felt until it has been out.
    /// A line without columns in the tissue loop does not count; a needle held by it is released.
    pub(super) fn is_on_line(&mut self, sample: &Sample, tissue: &TissueResponse) -> bool {
        let in_other_contact = tissue.contact > self.memory.pose.released_contact;
        let was_on_line = self.memory.on_line;
        if self.memory.is_hand_empty {
            return false;
        }
        let others = self.left.needles.as_deref().filter(|others| !others.is_empty());
        let moving = others.map(|others| others.moving());
        self.line.as_mut().is_some_and(|line| {
            let is_known = line.generation == tissue.line || tissue.left.contains(&line.generation);
            // A line that does not include the needles that stay in does not count either.
            if !is_known || moving.is_some_and(|moving| moving != line.generation) {
                line.reset();
                return false;
            }
            let tip = &sample.tip_in_world;
            if line.along_m(tip) < -OUT_M && !line.is_in_tissue() {
                line.let_grip_go();
            }
            let may_begin = was_on_line || (!in_other_contact && line.along_m(tip) <= BEGINS_WITHIN_M);
            line.is_in_tissue() || (may_begin && line.is_met_by(tip, &sample.direction_in_world()))
        })
    }

    /// Runs one tick on the line; `None` without one.
    pub(super) fn respond_on_line(&mut self, sample: &Sample) -> Option<ChainOutput> {
        let line = self.line.as_mut()?;
        let output = step_on_line(
            &self.memory.parameters,
            &self.device.info,
            &mut self.memory.chain,
            sample,
            line,
            self.left.any_mut(),
            self.device.period_s,
        );
        let state = line.state();
        let across = match output.bent {
            Some(_) => [line.across_loads_n(0), line.across_loads_n(1)],
            None => [&[][..]; 2],
        };
        let buffer = self.ports.loads.input_buffer_mut();
        let loads = &mut buffer.line;
        *loads = LineLoads {
            generation: line.generation,
            in_tissue: line.is_in_tissue(),
            tip_material_m: state.tip().material_m,
            tip_displacement_m: line.tip_displacement_m(),
            whole_m: line.whole_m(),
            hold: line.seed_hold(),
            bent: output.bent.as_ref().map(bent_tip),
            across: across[0].len(),
            ..LineLoads::default()
        };
        let wanted = state.loads_n().iter().chain(across[0]).chain(across[1]);
        for (slot, load) in loads.loads_n.iter_mut().zip(wanted) {
            *slot = *load;
            loads.count += 1;
        }
        self.left.show(&mut buffer.left);
        self.ports.loads.publish();
        self.memory.on_line = true;
        Some(output)
    }

    /// Takes the needle off its line.
    pub(super) fn leave_line(&mut self) {
        if std::mem::take(&mut self.memory.on_line) {
            let buffer = self.ports.loads.input_buffer_mut();
            buffer.line = LineLoads::default();
            self.left.show(&mut buffer.left);
            self.ports.loads.publish();
        }
    }
}

fn bent_tip(bent: &BeamOutput) -> BentTip {
    BentTip {
        needle: bent.needle,
        across_m: bent.tip_m,
        displacement_m: bent.displacement_m,
    }
}
