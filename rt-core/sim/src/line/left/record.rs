//! State of the needles that stay in, for flight recordings.

use super::{LeftNeedle, LeftNeedles, MAX_LEFT};
use crate::line::model::MAX_STATIONS;
use crate::line::outside::ExternalRecord;
use crate::line::ready::HandLine;
use crate::line::state::TipState;
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct NeedleRecord {
    generation: u64,
    stations: u32,
    held_m: f64,
    drawn_m: f64,
    drawing_m_per_s: f64,
    tip: TipState,
    tip_u_m: f64,
    tip_first: u32,
    tip_count: u32,
    #[serde(with = "BigArray")]
    tip_weights: [f64; 64],
    #[serde(with = "BigArray")]
    force_n: [f64; MAX_STATIONS + 1],
    #[serde(with = "BigArray")]
    rest_m: [f64; MAX_STATIONS + 1],
    #[serde(with = "BigArray")]
    u_m: [f64; MAX_STATIONS + 1],
    outside: ExternalRecord,
}

/// All of them at one tick; copied without allocating.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftRecord {
    needles: Vec<NeedleRecord>,
    moving: u64,
    is_still: bool,
}

impl Default for LeftRecord {
    /// Makes an empty record, with room for all needles.
    fn default() -> Self {
        LeftRecord {
            needles: Vec::with_capacity(MAX_LEFT),
            moving: 0,
            is_still: true,
        }
    }
}

impl LeftRecord {
    /// Makes an empty record; every page of the room is written to.
    pub fn with_room() -> Self {
        let blank = NeedleRecord {
            generation: 1,
            stations: 1,
            held_m: 1.0,
            drawn_m: 1.0,
            drawing_m_per_s: 1.0,
            tip: TipState::default(),
            tip_u_m: 1.0,
            tip_first: 0,
            tip_count: 0,
            tip_weights: [1.0; 64],
            force_n: [1.0; MAX_STATIONS + 1],
            rest_m: [1.0; MAX_STATIONS + 1],
            u_m: [1.0; MAX_STATIONS + 1],
            outside: ExternalRecord::BLANK,
        };
        let mut record = LeftRecord::default();
        record.needles.resize(MAX_LEFT, blank);
        record.needles.clear();
        record
    }

    /// Removes every needle.
    pub fn clear(&mut self) {
        self.needles.clear();
        self.moving = 0;
    }

    /// Copies the state of `left`.
    pub fn copy_from(&mut self, left: &LeftNeedles) {
        self.clear();
        self.moving = left.moving;
        self.is_still = left.is_still;
        // At most as many as there is room for.
        self.needles.extend(left.needles.iter().map(|needle| {
            let state = &needle.line.state;
            let (first, count) = (needle.first, needle.stations + 1);
            let mut record = NeedleRecord {
                generation: needle.line.generation,
                stations: needle.stations as u32,
                held_m: needle.held_m,
                drawn_m: needle.drawn_m,
                drawing_m_per_s: needle.drawing_m_per_s,
                tip: state.tip,
                tip_u_m: state.tip_u_m,
                tip_first: state.tip_range.start as u32,
                tip_count: state.tip_range.len() as u32,
                tip_weights: state.tip_weights,
                force_n: [0.0; MAX_STATIONS + 1],
                rest_m: [0.0; MAX_STATIONS + 1],
                u_m: [0.0; MAX_STATIONS + 1],
                outside: ExternalRecord::of(&state.outside),
            };
            record.force_n[..count].copy_from_slice(&left.force_n[first..first + count]);
            record.rest_m[..count].copy_from_slice(&left.rest_m[first..first + count]);
            record.u_m[..count].copy_from_slice(&left.u_m[first..first + count]);
            record
        }));
    }

    /// Returns the numbers of their lines.
    pub fn line_numbers(&self) -> impl Iterator<Item = u64> {
        self.needles.iter().map(|needle| needle.generation)
    }
}

impl LeftNeedles {
    /// Continues from `record` with the lines that it names, and `moving` beside them. False, and none is left in,
    /// where a line is missing or of another size: a record that was read from a file may not fit.
    pub fn take_record(
        &mut self,
        record: &LeftRecord,
        mut line: impl FnMut(u64) -> Option<Box<HandLine>>,
        moving: Option<&HandLine>,
    ) -> bool {
        self.needles.clear();
        self.count = 0;
        for kept in record.needles.iter().take(MAX_LEFT) {
            let stations = kept.stations as usize;
            let tip = kept.tip_first as usize..(kept.tip_first.saturating_add(kept.tip_count)) as usize;
            let found = line(kept.generation).filter(|line| {
                let m = line.model.compliance.stations;
                stations <= m && tip.end <= m && tip.len() <= kept.tip_weights.len()
            });
            let Some(mut line) = found else {
                self.needles.clear();
                self.assemble(None);
                return false;
            };
            line.state.tip = kept.tip;
            line.state.tip_u_m = kept.tip_u_m;
            line.state.tip_range = tip;
            line.state.tip_weights = kept.tip_weights;
            line.state.in_contact = stations;
            line.state.outside.take_record(&kept.outside);
            let (first, count) = (self.count, stations + 1);
            self.force_n[first..first + count].copy_from_slice(&kept.force_n[..count]);
            self.rest_m[first..first + count].copy_from_slice(&kept.rest_m[..count]);
            self.u_m[first..first + count].copy_from_slice(&kept.u_m[..count]);
            self.needles.push(LeftNeedle {
                line,
                first,
                stations,
                held_m: kept.held_m,
                drawn_m: kept.drawn_m,
                drawing_m_per_s: kept.drawing_m_per_s,
            });
            self.begin_moved(self.needles.len() - 1);
            self.count = first + count;
        }
        self.assemble(moving.filter(|line| line.generation == record.moving));
        self.is_still = record.is_still;
        true
    }
}
