//! A copy of the state in use: kept in flight recordings, and restored when one is repeated.

use super::LineState;
use crate::line::model::{LineModel, MAX_STATIONS};

impl LineState {
    /// Makes room for the state of any line. Every page is written to, so that no tick is the first to touch one.
    pub fn with_room() -> Self {
        let mut state = LineState::filled(MAX_STATIONS, 1.0);
        state.memory.vectors_mut().into_iter().for_each(|v| v.fill(1.0));
        state.clear();
        state
    }

    /// Holds no state, and keeps its room.
    pub fn clear(&mut self) {
        let Self {
            shaft_n,
            anchor_m,
            u_m,
            tip_column,
            loads_n,
            memory,
            outside,
            ..
        } = self;
        let own = [shaft_n, anchor_m, u_m, tip_column, loads_n];
        outside.clear();
        own.into_iter().chain(memory.vectors_mut()).for_each(Vec::clear);
    }

    /// Copies all of `from`; names every field, so that a new one is not forgotten. Does not allocate where there is
    /// room for as many stations.
    pub fn copy_from(&mut self, from: &LineState) {
        let LineState {
            shaft_n,
            anchor_m,
            u_m,
            tip_u_m,
            tip,
            in_contact,
            tip_range,
            tip_weights,
            tip_column,
            tip_own,
            tip_offset_m,
            membrane_n_per_m,
            whole_n,
            memory,
            outside,
            beam,
            beside_whole_m,
            is_beside,
            grip_m,
            open_m,
            open_layers,
            loads_n,
            last,
        } = from;
        self.shaft_n.clone_from(shaft_n);
        self.anchor_m.clone_from(anchor_m);
        self.u_m.clone_from(u_m);
        self.tip_u_m = *tip_u_m;
        self.tip = *tip;
        self.in_contact = *in_contact;
        self.tip_range = tip_range.clone();
        self.tip_weights = *tip_weights;
        self.tip_column.clone_from(tip_column);
        self.tip_own = *tip_own;
        self.tip_offset_m = *tip_offset_m;
        self.membrane_n_per_m = *membrane_n_per_m;
        self.whole_n = *whole_n;
        self.memory.copy_from(memory);
        self.outside.copy_from(outside);
        self.beam = *beam;
        (self.beside_whole_m, self.is_beside, self.grip_m) = (*beside_whole_m, *is_beside, *grip_m);
        (self.open_m, self.open_layers) = (*open_m, *open_layers);
        self.loads_n.clone_from(loads_n);
        self.last = *last;
    }

    /// Returns whether it fits `model` in all of its parts: a state read from a file may not.
    pub(in crate::line) fn is_of(&self, model: &LineModel) -> bool {
        let m = model.compliance.stations;
        let each = [&self.shaft_n, &self.anchor_m, &self.u_m, &self.tip_column];
        let tip = &self.tip_range;
        each.iter().all(|v| v.len() == m)
            && self.loads_n.len() == 2 * m
            && self.memory.fits(2 * m)
            && self.outside.fits(m)
            && self.beam.is_whole()
            && self.in_contact <= m
            && tip.start <= tip.end
            && tip.end <= m
            && tip.end - tip.start <= self.tip_weights.len()
    }
}
