//! Handles that only tests have on the loops of a rehearsal.

use super::Rig;
use crate::rt::exchange::{HapticOrder, TissueOrder, TissueStep};
use crate::rt::probe_tape::ProbeTape;
use crate::rt::response::TissueResponse;
use crate::rt::tissue::TissueLoop;
use stylet_sim::probe::BodyProbe;

impl Rig {
    pub fn reset(&mut self) {
        let _ = self.loops.control.haptic_orders.push((0, HapticOrder::Reset));
        let _ = self
            .loops
            .control
            .tissue_orders
            .push(TissueOrder::Step(0, TissueStep::Reset));
    }

    pub fn draw_needle(&mut self, number: u64) {
        let order = HapticOrder::DrawNeedle {
            number,
            speed_m_per_s: 0.05,
            promise: None,
        };
        let _ = self.loops.control.haptic_orders.push((0, order));
    }

    pub fn forget_carry(&mut self) {
        self.loops.tissue.forget_carry();
    }

    pub fn tissue(&mut self) -> &mut TissueLoop {
        &mut self.loops.tissue
    }

    pub fn take_probe(&mut self, probe: Box<BodyProbe>) {
        let _ = self.loops.control.tissue_orders.push(TissueOrder::Probe {
            generation: 1,
            room: ProbeTape::new(&probe),
            probe,
        });
    }

    pub fn line_state(&self) -> Option<&stylet_sim::line::LineState> {
        self.loops.haptic.line_state()
    }

    pub fn response(&self) -> &TissueResponse {
        self.loops.tissue.response()
    }
}
