//! State of a line from tick to tick, and the output of a tick.

use super::beam::BeamState;
use super::model::LineModel;
use super::outside::ExternalDisplacement;
use super::prony::Memory;
use super::rows::dot;
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

mod kept;
mod moved;

/// The tip in the material of the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TipState {
    /// Force on the tissue, inwards.
    pub force_n: f64,
    /// Its place at rest; negative outside.
    pub material_m: f64,
    /// End of the track that was cut.
    pub track_m: f64,
    /// One bit for each layer whose membrane has given way.
    pub opened: u32,
    /// Layer whose membrane holds it, from 1; 0: none does.
    pub held_by: u32,
    /// Displacement of the tissue there when the tip met that membrane.
    pub met_u_m: f64,
    /// The same, less what the body as a whole was, and without the next.
    pub met_dent_m: f64,
    /// Dent of the tip that is narrower than its patch, from when it met that membrane: the tip is so far ahead of the
    /// membrane's tissue until it draws back through it.
    pub ahead_m: f64,
}

/// Forces of one tick, N.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LineOutput {
    /// Force on the hand along the line, positive inwards: a negative force pushes the needle out.
    pub force_on_hand_n: f64,
    /// Force of the tip on the tissue.
    pub tip_n: f64,
    /// Force of the shaft on the tissue.
    pub shaft_n: f64,
    /// Place at rest of the material that the tip is in; a seed dropped now belongs there.
    pub tip_material_m: f64,
    /// Layer whose membrane gave way in this tick.
    pub punctured: Option<usize>,
    /// Layer whose membrane holds the tip.
    pub held_by: Option<usize>,
    /// Least length of a stretch of the line between two stations, over that at rest; below 0 the linear answer is
    /// folded.
    pub least_stretch: f64,
    /// Sweeps of the solver, all passes together; or products with the compliance.
    pub sweeps: u32,
    /// Largest correction that is left.
    pub residual_m: f64,
    /// Set where the input was not finite: the output before it is repeated.
    pub is_refused: bool,
}

/// Forces, anchors and the track: everything that the line remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineState {
    /// Force of each station of the shaft on the tissue.
    pub(super) shaft_n: Vec<f64>,
    /// Place on the needle where each station sticks: the tip's place in the world less the displacement of the
    /// station.
    pub(super) anchor_m: Vec<f64>,
    /// Displacement of the stations in contact, and of the material at the tip.
    pub(super) u_m: Vec<f64>,
    pub(super) tip_u_m: f64,
    pub(super) tip: TipState,
    /// Stations that the shaft touches: the first so many.
    pub(super) in_contact: usize,
    pub(super) tip_range: std::ops::Range<usize>,
    #[serde(with = "BigArray")]
    pub(super) tip_weights: [f64; 64],
    /// Displacement of each station in contact, and of the tip, by the tip's force.
    pub(super) tip_column: Vec<f64>,
    pub(super) tip_own: f64,
    /// Displacement that the dent under the membrane adds to the tip's, m.
    pub(super) tip_offset_m: f64,
    /// Stiffness of the membrane that holds the tip, beyond that of the tissue under it, N/m.
    pub(super) membrane_n_per_m: f64,
    /// Part of the tip's force that the membrane passes on to the body as a whole, N.
    pub(super) whole_n: f64,
    pub(super) memory: Memory,
    /// Forces and track across the line, of a needle that bends.
    pub(super) beam: BeamState,
    /// Displacement of the body as a whole along the line by the other needles, m.
    pub(super) beside_whole_m: f64,
    /// Set after a tick with other needles: their displacement is in the memory's offset.
    pub(super) is_beside: bool,
    /// Displacement of the tissue past the needle by the probe.
    pub(super) outside: ExternalDisplacement,
    /// Distance of the tip ahead of the hand's, after a needle was taken up again, m.
    pub(super) grip_m: f64,
    /// End of a track that an earlier needle cut where this line lies, and the layers that it opened.
    pub(super) open_m: f64,
    pub(super) open_layers: u32,
    pub(super) loads_n: Vec<f64>,
    pub(super) last: LineOutput,
}

impl LineState {
    /// Makes the state of tissue at rest that no needle has touched.
    pub fn new(model: &LineModel) -> Self {
        Self::filled(model.compliance.stations, 0.0)
    }

    /// Makes the state outside; every vector but the memory's is filled with that value.
    fn filled(stations: usize, value: f64) -> Self {
        let each = || vec![value; stations];
        LineState {
            shaft_n: each(),
            anchor_m: each(),
            u_m: each(),
            tip_u_m: 0.0,
            tip: TipState {
                material_m: f64::NEG_INFINITY,
                ..TipState::default()
            },
            in_contact: 0,
            tip_range: 0..0,
            tip_weights: [0.0; 64],
            tip_column: each(),
            tip_own: 0.0,
            tip_offset_m: 0.0,
            membrane_n_per_m: 0.0,
            whole_n: 0.0,
            memory: Memory::new(2 * stations),
            beam: BeamState::default(),
            beside_whole_m: 0.0,
            is_beside: false,
            outside: ExternalDisplacement::new(stations, value),
            grip_m: 0.0,
            open_m: 0.0,
            open_layers: 0,
            loads_n: vec![value; 2 * stations],
            last: LineOutput::default(),
        }
    }

    /// Returns the factors of the columns: newtons of each shaft station, then of the tip at each.
    pub fn loads_n(&self) -> &[f64] {
        &self.loads_n
    }

    /// Returns the state of the tip: membrane, cutting, track.
    pub fn tip(&self) -> &TipState {
        &self.tip
    }

    /// Returns the force of each shaft station on the tissue.
    pub fn shaft_n(&self) -> &[f64] {
        &self.shaft_n
    }

    /// Returns the elastic energy of the tissue, in joules.
    pub fn stored_j(&self, model: &LineModel) -> f64 {
        let m = model.compliance.stations;
        let rows = &model.compliance.rows;
        let mut f = vec![0.0; 2 * m];
        f[..m].copy_from_slice(&self.shaft_n);
        for (n, weight) in self.tip_range.clone().zip(self.tip_weights) {
            f[m + n] = weight * self.tip.force_n;
        }
        let at_once: f64 = f
            .iter()
            .enumerate()
            .map(|(n, force)| 0.5 * force * dot(rows.row(n), &f))
            .sum();
        let missing = model
            .compliance
            .tip_missing_m_per_n(self.tip_range.clone(), &self.tip_weights);
        let near_tip_j = (self.near_m(model) / self.memory.gain - 0.5 * missing * self.tip.force_n) * self.tip.force_n;
        let common_m_per_n = model.compliance.common_m_per_n();
        at_once + near_tip_j + self.memory.stored_j(rows, common_m_per_n, &model.settings.prony)
    }

    /// Returns the stations that the tip moves by more than the rows say.
    pub(super) fn near_stations(&self, model: &LineModel) -> std::ops::Range<usize> {
        let c = &model.compliance;
        c.near.stations(self.tip.material_m, c.spacing_m, self.in_contact)
    }

    /// Returns how far tip and shaft move the tip beyond what the rows say, m.
    pub(super) fn near_m(&self, model: &LineModel) -> f64 {
        let (c, tip_m) = (&model.compliance, self.tip.material_m);
        let missing = c.tip_missing_m_per_n(self.tip_range.clone(), &self.tip_weights);
        let of_shaft_m: f64 = self
            .near_stations(model)
            .map(|n| c.near_m_per_n(missing, tip_m, n, tip_m) * self.shaft_n[n])
            .sum();
        self.memory.gain * (missing * self.tip.force_n + of_shaft_m)
    }

    /// Returns the part of the tip's force that moves the body as a whole and is not among the loads, N.
    pub fn whole_n(&self) -> f64 {
        self.whole_n
    }

    /// Returns the displacement of the material at the tip along the line, m.
    pub fn tip_displacement_m(&self) -> f64 {
        self.tip_u_m
    }

    /// Returns whether the tip presses on tissue or is in it.
    pub fn is_in_contact(&self) -> bool {
        self.in_contact > 0 || self.tip.force_n > 0.0
    }

    /// Brings the tissue to rest, with the tracks that were open before the line was taken up; does not allocate.
    pub fn reset(&mut self) {
        for field in [
            &mut self.shaft_n,
            &mut self.anchor_m,
            &mut self.u_m,
            &mut self.tip_column,
            &mut self.loads_n,
        ] {
            field.fill(0.0);
        }
        self.tip = TipState {
            material_m: f64::NEG_INFINITY,
            track_m: self.open_m,
            opened: self.open_layers,
            ..TipState::default()
        };
        self.tip_u_m = 0.0;
        self.in_contact = 0;
        self.tip_range = 0..0;
        self.tip_weights.fill(0.0);
        self.tip_own = 0.0;
        (self.tip_offset_m, self.membrane_n_per_m, self.whole_n) = (0.0, 0.0, 0.0);
        self.memory.reset();
        self.outside.reset();
        self.beam = BeamState::default();
        (self.beside_whole_m, self.is_beside, self.grip_m) = (0.0, false, 0.0);
        self.last = LineOutput::default();
    }

    /// Clears the forces of the needle; its track stays.
    pub(super) fn clear_loads(&mut self) {
        self.shaft_n.fill(0.0);
        self.loads_n.fill(0.0);
        self.in_contact = 0;
        self.tip.force_n = 0.0;
        self.tip.material_m = self.tip.material_m.min(0.0);
    }

    /// Forgets the other needles.
    pub(super) fn forget_others(&mut self) {
        if std::mem::take(&mut self.is_beside) {
            self.memory.offset_m.fill(0.0);
            self.beside_whole_m = self.outside.at_tip_m;
        }
    }

    pub(super) fn fits(&self, model: &LineModel) -> bool {
        self.shaft_n.len() == model.compliance.stations
    }
}
