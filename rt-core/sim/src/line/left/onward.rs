//! The next solution of a tick, with the tip at another place: all forces are those of the solution before, so that
//! displacements are as well, but for what the tip's force makes of them.

use super::{LeftNeedles, MAX_ELEMENTS};
use crate::line::model::{LineModel, MAX_STATIONS};
use crate::line::rows::dot;
use crate::line::state::LineState;

/// Displacements of the solution before in the same tick, less the part by the tip's force: where the tip advances,
/// that part alone changes.
#[derive(Clone, Debug)]
pub(super) struct WithoutTip {
    /// Number of stations that the shaft touched; `None` without such a solution.
    pub stations: Option<usize>,
    elements_m: Vec<f64>,
    stations_m: Vec<f64>,
}

impl WithoutTip {
    /// Makes room for a solution; every page is written to.
    pub fn with_room() -> Self {
        let each = |length: usize| {
            let mut values = vec![1.0; length];
            values.fill(0.0);
            values
        };
        Self {
            stations: None,
            elements_m: each(MAX_ELEMENTS),
            stations_m: each(MAX_STATIONS),
        }
    }

    /// Returns the size of the room, in bytes.
    pub fn bytes(&self) -> usize {
        8 * (self.elements_m.len() + self.stations_m.len())
    }
}

impl LeftNeedles {
    /// Keeps what the solution that was just found leaves without the tip's force. Not where a membrane holds the tip:
    /// by that the column of its force changes within a tick.
    pub(super) fn keep_without_tip(&mut self, state: &LineState) {
        let kept = &mut self.without_tip;
        kept.stations = Some(state.in_contact);
        let tip_n = state.tip.force_n;
        let less = |to: &mut [f64], all: &[f64], of_tip: &[f64]| {
            for ((to, u), column) in to.iter_mut().zip(all).zip(of_tip) {
                *to = u - tip_n * column;
            }
        };
        let (elements, stations) = (self.count, state.in_contact);
        less(&mut kept.elements_m[..elements], &self.u_m, &self.by_tip);
        less(&mut kept.stations_m[..stations], &state.u_m, &state.tip_column);
    }

    /// Extrapolates the displacements of the stations; those from `before` on are new, and stick where they are.
    /// Returns false where nothing was kept.
    pub(super) fn extrapolate_stations(
        &mut self,
        model: &LineModel,
        state: &mut LineState,
        tip_m: f64,
        before: usize,
    ) -> bool {
        let now = state.in_contact;
        if self.without_tip.stations != Some(before) || now < before {
            return false;
        }
        let tip_n = state.tip.force_n;
        for n in 0..now {
            let without_m = match self.without_tip.stations_m.get(n) {
                Some(&kept_m) if n < before => kept_m,
                _ => {
                    let of_elements = &self.from_moving[n * self.stride..n * self.stride + self.count];
                    dot(&model.compliance.rows.row(n)[..before], &state.shaft_n[..before])
                        + dot(of_elements, &self.force_n[..self.count])
                }
            };
            state.u_m[n] = without_m + tip_n * state.tip_column[n];
            if n >= before {
                state.anchor_m[n] = tip_m - state.u_m[n];
            }
        }
        true
    }

    /// Extrapolates the displacements of the elements.
    pub(super) fn extrapolate_elements(&mut self, state: &LineState) {
        let (count, tip_n) = (self.count, state.tip.force_n);
        let kept = self.without_tip.elements_m[..count].iter().zip(&self.by_tip);
        for (u, (without_m, by_tip)) in self.u_m[..count].iter_mut().zip(kept) {
            *u = without_m + tip_n * by_tip;
        }
    }
}
