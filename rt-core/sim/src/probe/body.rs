//! A probe as the tissue loop has it: what it can press, what it has done, and its share of the body's displacement.

use super::columns::ReadyProbe;
use super::contact::{ContactReport, ProbeState, displace, step};
use super::response::ProbeResponse;
use super::shape::ProbePose;
use crate::tissue::{ElementField, PackedField};

/// Made beside the loops; nothing is allocated after that.
#[derive(Clone, Debug)]
pub struct BodyProbe {
    ready: ReadyProbe,
    state: ProbeState,
    response: ProbeResponse,
    /// How far others displace each pad, along x, y, z, m.
    beside_m: Vec<f64>,
    /// Loads that the share was made from.
    shared_n: Vec<f64>,
}

impl BodyProbe {
    /// Out of the body.
    pub fn new(ready: ReadyProbe) -> Self {
        let rows = ready.rows();
        BodyProbe {
            state: ProbeState::new(&ready),
            response: ProbeResponse::default(),
            beside_m: vec![0.0; rows],
            shared_n: vec![0.0; rows],
            ready,
        }
    }

    /// What it can press.
    pub fn ready(&self) -> &ReadyProbe {
        &self.ready
    }

    /// What it answered last.
    pub fn response(&self) -> &ProbeResponse {
        &self.response
    }

    /// What came of the last tick.
    pub fn report(&self) -> ContactReport {
        self.state.report()
    }

    /// Displacement of the body by the probe, m.
    pub fn share(&self) -> &ElementField {
        &self.state.share
    }

    /// It presses the wall, or did in the tick before.
    pub fn displaces(&self) -> bool {
        self.shared_n.iter().any(|n| *n != 0.0)
    }

    /// No other load displaces the wall.
    pub fn nothing_beside(&mut self) {
        self.beside_m.fill(0.0);
    }

    /// Other loads displace the wall as well: `columns` of the same body with their loads. Columns of another body do not count.
    pub fn beside(&mut self, columns: &[PackedField], loads_n: &[f64]) {
        let own = self.ready.columns.first().map(PackedField::elements);
        for (column, load_n) in columns.iter().zip(loads_n).filter(|(_, n)| **n != 0.0) {
            if Some(column.elements()) == own {
                self.displace_pads(|element| column.at(element).map(|m| load_n * f64::from(m)));
            }
        }
    }

    /// The same for a displacement that is added up already.
    pub fn beside_field(&mut self, field: &ElementField) {
        if Some(field.elements()) == self.ready.columns.first().map(PackedField::elements) {
            let at = |axis: &Vec<f32>, e: u32| axis.get(e as usize).copied().map_or(0.0, f64::from);
            self.displace_pads(|element| field.0.each_ref().map(|axis| at(axis, element)));
        }
    }

    fn displace_pads(&mut self, by_m: impl Fn(u32) -> [f64; 3]) {
        for (moved_m, &element) in self.beside_m.chunks_exact_mut(3).zip(&self.ready.elements) {
            for (slot, by_m) in moved_m.iter_mut().zip(by_m(element)) {
                *slot += by_m;
            }
        }
    }

    /// The probe is at this pose. Whether it displaces the body otherwise than before.
    pub fn follow(&mut self, pose: &ProbePose) -> bool {
        self.response = step(&self.ready, &mut self.state, pose, &self.beside_m);
        let is_other = self.shared_n != self.state.loads_n();
        if is_other {
            displace(&self.ready, &mut self.state);
            self.shared_n.copy_from_slice(self.state.loads_n());
        }
        is_other
    }

    /// Tissue at rest.
    pub fn reset(&mut self) {
        self.state.reset();
        self.shared_n.fill(0.0);
        self.beside_m.fill(0.0);
        displace(&self.ready, &mut self.state);
        self.response = ProbeResponse::nothing(self.response.pose);
    }
}
