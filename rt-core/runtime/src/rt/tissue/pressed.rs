//! The body under the ultrasound probe: where it is in this tick, what it presses, and what else displaces the wall.

use super::TissueLoop;
use stylet_sim::probe::{BodyProbe, ProbePose, ProbeResponse};
use stylet_sim::tissue::Carry;

impl TissueLoop {
    /// The probe is there from the next tick on.
    pub fn move_probe(&mut self, pose: ProbePose) {
        self.probe_pose = Some(pose);
    }

    /// What the probe answered in the last tick; `None` in a scene without one.
    pub fn probe_response(&self) -> Option<&ProbeResponse> {
        self.pressed.as_ref().map(|pressed| pressed.response())
    }

    /// The probe of this scene.
    pub fn pressed(&self) -> Option<&BodyProbe> {
        self.pressed.as_deref()
    }

    pub(super) fn take_probe(&mut self, probe: Box<BodyProbe>) {
        self.drop_probe();
        self.pressed = Some(probe);
    }

    /// It was solved for in a body that is replaced. By the bridge: freeing has no place in a tick.
    pub(super) fn drop_probe(&mut self) {
        if let Some(old) = self.pressed.take() {
            self.last_carry.forget();
            if let Err(rtrb::PushError::Full(old)) = self.ports.old_probes.push(old) {
                std::mem::forget(old);
            }
        }
    }

    pub(super) fn reset_probe(&mut self) {
        if let Some(pressed) = &mut self.pressed {
            pressed.reset();
        }
    }

    /// The contact of this tick. Needles displace the wall as well: with the loads of this tick, each by its columns.
    pub(super) fn follow_probe(&mut self) {
        let (Some(pressed), Some(pose)) = (&mut self.pressed, self.probe_pose) else {
            return;
        };
        let was_displaced = pressed.displaces();
        pressed.nothing_beside();
        if let Some(line) = self.line.as_ref().filter(|l| l.generation == self.loads.generation) {
            pressed.beside(line.answer.columns(), self.loads.loads_n());
        }
        for left in &self.left {
            pressed.beside_field(&left.line.share);
        }
        if pressed.follow(&pose) {
            self.last_carry.forget();
            let is_displaced = pressed.displaces();
            if was_displaced && !is_displaced && self.besides().is_none() {
                self.world.tissue.carry(Carry::NOT);
            }
        }
    }
}
