//! A probe as the tissue loop has it: what it can press, what it has done, and its share of the body's displacement.

use super::columns::ReadyProbe;
use super::contact::{ContactReport, ProbeState, step};
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
    share: ElementField,
    /// Loads that the share was made from.
    shared_n: Vec<f64>,
    /// Those that the next one is made from, and how many of its parts are.
    coming_n: Vec<f64>,
    made: usize,
    parts: usize,
}

/// A larger body is added up over several ticks, so many elements in each: the picture is late by so many, the force is not.
const ELEMENTS_A_TICK: usize = 16_384;

impl BodyProbe {
    /// Out of the body.
    pub fn new(ready: ReadyProbe) -> Self {
        let rows = ready.rows();
        let elements = ready.columns.first().map_or(0, PackedField::elements);
        BodyProbe {
            share: ElementField::with_room(elements),
            coming_n: vec![0.0; rows],
            made: 0,
            parts: elements.div_ceil(ELEMENTS_A_TICK).max(1),
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
        &self.share
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
        if self.made == 0 {
            if self.shared_n == self.state.loads_n() {
                return false;
            }
            self.coming_n.copy_from_slice(self.state.loads_n());
        }
        let making = &mut self.state.share;
        making.load_part(&self.ready.columns, &self.coming_n, [self.made, self.parts]);
        self.made += 1;
        let is_whole = self.made == self.parts;
        if is_whole {
            std::mem::swap(&mut self.share, making);
            self.shared_n.copy_from_slice(&self.coming_n);
            self.made = 0;
        }
        is_whole
    }

    /// Tissue at rest.
    pub fn reset(&mut self) {
        self.state.reset();
        for values in [&mut self.shared_n, &mut self.coming_n, &mut self.beside_m] {
            values.fill(0.0);
        }
        self.made = 0;
        self.share.0.iter_mut().for_each(|axis| axis.fill(0.0));
        self.response = ProbeResponse::nothing(self.response.pose);
    }
}
