//! How the tissue moves past a needle by what is none: the ultrasound probe displaces the stations of its line.
//!
//! It is known for every tick of the tissue, and is reached in equal parts within one, so that the force has no steps. Stations stick and slip by
//! where they are with it.

use super::beam::MAX_ACROSS;
use super::model::LineModel;
use super::state::LineState;
use serde::{Deserialize, Serialize};

/// Displacement of each row of a line: shaft of each station, then tip at each, then stations across along each direction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Outside {
    /// Now, and to be reached, m.
    now_m: Vec<f64>,
    to_m: Vec<f64>,
    /// Within so many ticks.
    ticks: u32,
    /// Some of it is not zero, or was in the last tick.
    is_on: bool,
    /// At the tip, m.
    pub at_tip_m: f64,
}

impl Outside {
    /// Of a line of so many stations, with room for any across.
    pub fn new(stations: usize, value: f64) -> Self {
        let rows = rows(stations);
        Outside {
            now_m: vec![value; rows],
            to_m: vec![value; rows],
            ..Outside::default()
        }
    }

    /// It is `to_m` after so many ticks; rows that it does not name are at rest then, and what is no number counts as no displacement.
    pub fn set(&mut self, to_m: &[f64], ticks: u32) {
        let finite = |m: f64| if m.is_finite() { m } else { 0.0 };
        let given = to_m.iter().copied().map(finite).chain(std::iter::repeat(0.0));
        for (slot, to_m) in self.to_m.iter_mut().zip(given) {
            *slot = to_m;
            self.is_on |= to_m != 0.0;
        }
        self.ticks = ticks.max(1);
    }

    /// At rest at once; does not allocate.
    pub fn reset(&mut self) {
        self.now_m.fill(0.0);
        self.to_m.fill(0.0);
        (self.ticks, self.is_on, self.at_tip_m) = (0, false, 0.0);
    }

    /// Keeps what `from` holds; does not allocate where there is room. Names every field, so that a new one is not forgotten.
    pub fn copy_from(&mut self, from: &Outside) {
        let Outside {
            now_m,
            to_m,
            ticks,
            is_on,
            at_tip_m,
        } = from;
        self.now_m.clone_from(now_m);
        self.to_m.clone_from(to_m);
        (self.ticks, self.is_on, self.at_tip_m) = (*ticks, *is_on, *at_tip_m);
    }

    /// Holds nothing, and keeps its room.
    pub fn clear(&mut self) {
        self.now_m.clear();
        self.to_m.clear();
    }

    /// Whether it is one of so many stations.
    pub fn fits(&self, stations: usize) -> bool {
        self.now_m.len() == rows(stations) && self.to_m.len() == rows(stations)
    }

    /// Something displaces the line.
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Of one row, m.
    pub fn at_m(&self, row: usize) -> f64 {
        self.now_m.get(row).copied().unwrap_or(0.0)
    }

    fn go_on(&mut self) {
        if self.ticks == 0 {
            return;
        }
        let part = 1.0 / f64::from(self.ticks);
        for (now_m, to_m) in self.now_m.iter_mut().zip(&self.to_m) {
            *now_m = if self.ticks == 1 {
                *to_m
            } else {
                *now_m + part * (to_m - *now_m)
            };
        }
        self.ticks -= 1;
        self.is_on = self.ticks > 0 || self.now_m.iter().any(|m| *m != 0.0);
    }
}

fn rows(stations: usize) -> usize {
    2 * (stations + MAX_ACROSS)
}

impl LineState {
    /// The tissue is displaced past the needle by what the probe does in this tick: beside what the past leaves. One comparison where nothing is.
    pub(super) fn move_from_outside(&mut self) {
        if !self.outside.is_on {
            return;
        }
        if !self.memory.is_on() {
            self.memory.offset_m.fill(0.0);
        }
        self.outside.go_on();
        for (offset_m, moved_m) in self.memory.offset_m.iter_mut().zip(&self.outside.now_m) {
            *offset_m += moved_m;
        }
        if !self.outside.is_on {
            (self.outside.at_tip_m, self.beside_whole_m) = (0.0, 0.0);
        }
    }

    /// The same for the membrane at the tip, once it is known where that is: it is no more stretched by it than by tissue that is moved as a whole.
    pub(super) fn move_membrane_from_outside(&mut self, model: &LineModel) {
        if !self.outside.is_on {
            return;
        }
        let first = model.compliance.stations;
        let tip = self.tip_range.clone().zip(self.tip_weights);
        let at_tip_m: f64 = tip.map(|(n, weight)| weight * self.outside.at_m(first + n)).sum();
        self.beside_whole_m += at_tip_m - self.outside.at_tip_m;
        self.outside.at_tip_m = at_tip_m;
    }

    /// A needle that is taken up again after it stayed in: places count with what the probe moves the tissue by.
    pub(super) fn come_back_moved(&mut self) {
        for n in 0..self.in_contact {
            let moved_m = self.outside.at_m(n);
            self.u_m[n] += moved_m;
            self.anchor_m[n] -= moved_m;
        }
        let at_tip_m = self.outside.at_tip_m;
        self.tip_u_m += at_tip_m;
        self.tip.material_m -= at_tip_m;
    }

    /// The same across the line, at so many stations along each direction.
    pub(super) fn bend_from_outside(&mut self, across: usize) {
        let first = 2 * self.shaft_n.len();
        let outside = &self.outside;
        if outside.is_on || self.beam.is_moved() {
            self.beam
                .move_from_outside(|side, n| outside.at_m(first + side * across + n), across);
        }
    }

    /// Work of the needle's forces over what moves the tissue from outside, J: no energy that they have stored.
    pub(super) fn outside_j(&self) -> f64 {
        if !self.outside.is_on {
            return 0.0;
        }
        let shaft = self.shaft_n.iter().enumerate().take(self.in_contact);
        shaft.map(|(n, f)| f * self.outside.at_m(n)).sum::<f64>() + self.tip.force_n * self.outside.at_tip_m
    }
}
