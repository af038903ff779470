//! Needles that stay in: leaves them, takes them again, draws them out, and ticks those left.

use super::HapticLoop;
use crate::rt::left_loads::LeftLoads;
use crate::rt::line_loads::LineLoads;
use crate::rt::motion_lease::Promise;
use crate::rt::response::TissueResponse;
use stylet_hw::Sample;
use stylet_shm_schema::RefusalCode;
use stylet_sim::line::{HandLine, LeftNeedles};

/// Largest distance along the needle at which the hand is at its tip, m.
const AT_NEEDLE_M: f64 = 2e-3;
/// A hand counts as out at this distance before the entry or farther, m.
const OUT_WITHIN_M: f64 = 1e-3;

/// The force loop's state of needles that stay in.
#[derive(Default)]
pub(super) struct Left {
    /// Room for them, once the first is left.
    pub needles: Option<Box<LeftNeedles>>,
    /// The tissue loop was last shown some loads.
    pub is_shown: bool,
}

impl Left {
    pub fn count(&self) -> usize {
        self.needles.as_ref().map_or(0, |needles| needles.len())
    }

    /// Returns the needles, if any are left.
    pub fn any_mut(&mut self) -> Option<&mut LeftNeedles> {
        self.needles.as_deref_mut().filter(|needles| !needles.is_empty())
    }

    /// True if one is being drawn out or is held on its way.
    pub fn is_drawing(&self) -> bool {
        self.needles.as_ref().is_some_and(|needles| needles.is_drawing())
    }

    /// Stops the drawing of all needles where they are.
    pub fn end_drawing(&mut self) {
        if let Some(needles) = self.any_mut() {
            needles.end_drawing();
        }
    }

    /// Shows their loads on the body.
    pub fn show(&mut self, loads: &mut LeftLoads) {
        loads.clear();
        if let Some(needles) = &self.needles {
            loads.set(needles.needles().iter().zip(needles.shares()));
        }
        self.is_shown = !loads.needles().is_empty();
    }

    /// Couples them with that line, if it includes them.
    pub fn pair(&mut self, line: Option<&HandLine>) {
        if let Some(needles) = self.any_mut() {
            needles.beside(line);
        }
    }
}

impl HapticLoop {
    pub(super) fn leave_needle(&mut self) -> Result<(), RefusalCode> {
        let line = self.line.as_ref().filter(|line| line.is_in_tissue());
        let Some(line) = line.filter(|_| self.memory.on_line) else {
            let in_other_contact = self.memory.contact > self.memory.pose.released_contact;
            return Err(if in_other_contact {
                RefusalCode::NeedleWithoutLine
            } else {
                RefusalCode::NoNeedleToLeave
            });
        };
        if line.is_held_by_membrane() {
            return Err(RefusalCode::TipAtMembrane);
        }
        if self.left.needles.is_none() {
            self.left.needles = self.ports.rooms.pop().ok();
        }
        let needles = self.left.needles.as_mut().ok_or(RefusalCode::NoRoomToLeave)?;
        let line = self.line.take().ok_or(RefusalCode::NoNeedleToLeave)?;
        if let Err(line) = needles.leave(line) {
            needles.beside(Some(&line));
            self.line = Some(line);
            return Err(RefusalCode::NoRoomToLeave);
        }
        self.memory.is_hand_empty = true;
        self.memory.chain.end_contact();
        self.memory.pose.released_contact = self.memory.contact;
        self.memory.on_line = false;
        Ok(())
    }

    /// Takes the needle at whose tip the hand is, as it was held.
    pub(super) fn take_needle(&mut self, generation: u64) -> Result<(), RefusalCode> {
        if self.line.as_ref().is_some_and(|line| line.is_in_tissue()) {
            return Err(RefusalCode::NeedleInTissue);
        }
        let sample = self.memory.hand.sample.ok_or(RefusalCode::NotAtNeedle)?;
        let needles = self.left.any_mut().ok_or(RefusalCode::NoLeftNeedle)?;
        let needle = needles
            .needles()
            .iter()
            .find(|needle| needle.generation() == generation);
        let needle = needle
            .filter(|needle| !needle.is_drawn())
            .ok_or(RefusalCode::NoLeftNeedle)?;
        let tip = &sample.tip_in_world;
        let ahead_m = needle.held_m() - needle.line().along_m(tip);
        let is_there = needle.line().is_met_by(tip, &sample.direction_in_world()) && ahead_m.abs() <= AT_NEEDLE_M;
        if !is_there || self.ports.old_lines.is_full() {
            return Err(RefusalCode::NotAtNeedle);
        }
        let mut line = needles.take(generation).ok_or(RefusalCode::NoLeftNeedle)?;
        line.grip_ahead(ahead_m);
        if let Some(old) = self.line.replace(line) {
            // There is room: checked above.
            let _ = self.ports.old_lines.push(old);
        }
        self.left.pair(self.line.as_deref());
        self.memory.is_hand_empty = false;
        self.memory.on_line = true;
        Ok(())
    }

    pub(super) fn draw_needle(
        &mut self,
        generation: u64,
        speed_m_per_s: f64,
        promise: Option<Promise>,
    ) -> Result<(), RefusalCode> {
        let mut needles = self.left.any_mut();
        let is_there = needles
            .as_mut()
            .is_some_and(|needles| needles.draw_out(generation, speed_m_per_s));
        is_there
            .then(|| self.begin_drawing(promise))
            .ok_or(RefusalCode::NoLeftNeedle)
    }

    /// Returns needles that are out, and those whose columns the tissue loop lacks, to be freed.
    pub(super) fn look_after_left(&mut self, sample: &Sample, tissue: &TissueResponse) {
        let Some(needles) = self.left.any_mut() else {
            // A tip in tissue without a contact must come out before it meets tissue.
            self.memory.is_hand_empty = false;
            return;
        };
        let is_known = |generation: u64| tissue.line == generation || tissue.left.contains(&generation);
        let unknown = needles.needles().iter().find(|needle| !is_known(needle.generation()));
        let unknown = unknown.map(|needle| needle.generation());
        if !self.ports.old_lines.is_full() {
            let out = match unknown {
                Some(generation) => needles.take(generation),
                None => needles.drawn_out(),
            };
            if let Some(out) = out {
                if let (Some(track), Some(line)) = (out.track().filter(|_| unknown.is_none()), &mut self.line) {
                    line.open_track(&track);
                }
                let _ = self.ports.old_lines.push(out);
                self.left.pair(self.line.as_deref());
            }
        }
        self.memory.is_hand_empty = self.is_hand_empty(sample);
    }

    /// True on the way of a needle that stays in, and until the hand is out after one was left.
    fn is_hand_empty(&self, sample: &Sample) -> bool {
        if self.memory.on_line && self.line.as_ref().is_some_and(|line| line.is_in_tissue()) {
            return false;
        }
        let Some(needles) = &self.left.needles else {
            return false;
        };
        let (tip, direction) = (&sample.tip_in_world, sample.direction_in_world());
        let is_on = |line: &HandLine| line.is_met_by(tip, &direction);
        let is_in = |line: &HandLine| line.along_m(tip) > -OUT_WITHIN_M;
        needles.needles().iter().any(|needle| is_on(needle.line()))
            || (self.memory.is_hand_empty && needles.needles().iter().any(|needle| is_in(needle.line())))
    }

    /// Steps them. Their loads go out with those of the moving needle, or from here if there is none.
    pub(super) fn step_left(&mut self) {
        let period_s = self.device.period_s;
        if let Some(needles) = self.left.any_mut() {
            needles.step_alone(period_s);
        } else if !self.left.is_shown {
            return;
        }
        self.publish_left();
    }

    fn publish_left(&mut self) {
        let buffer = self.ports.loads.input_buffer_mut();
        buffer.line = LineLoads::default();
        self.left.show(&mut buffer.left);
        self.ports.loads.publish();
    }

    /// Gives up all of them because the tissue is new, as far as the return ring has room.
    pub(super) fn give_up_left(&mut self) {
        if let Some(needles) = &mut self.left.needles {
            while !needles.is_empty() && !self.ports.old_lines.is_full() {
                if let Some(mut line) = needles.give_up() {
                    line.forget();
                    let _ = self.ports.old_lines.push(line);
                }
            }
        }
        self.memory.is_hand_empty = false;
        self.left.pair(self.line.as_deref());
    }
}
