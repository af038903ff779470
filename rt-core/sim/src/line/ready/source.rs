//! Source from which the force loop's half of a line can be made again: kept in a recording.

use super::way::LineLayers;
use super::{HandLine, LineError, STIFFEST_N_PER_M};
use crate::line::beam::MAX_ACROSS;
use crate::line::{Compliance, Cross, Line, LineState, MAX_STATIONS, Rows};
use crate::needle::LayerKind;
use serde::{Deserialize, Serialize};

/// Line, compliance of its stations, and layers on the way: all of a [`HandLine`] that does not change while it is in
/// use, except the layers' forces, which are parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineSource {
    /// Number of the [`HandLine`].
    pub generation: u64,
    /// Line at rest.
    pub line: Line,
    way: LineLayers,
    compliance: Compliance,
    beside: Vec<Cross>,
    /// End of the track that was open there, and the layers that it opened.
    open: (f64, u32),
    /// Young's modulus of the tissue over that of the scene.
    stiffness: f64,
}

impl LineSource {
    /// Returns whether the body was solved for forces across the line as well.
    pub fn bends(&self) -> bool {
        self.compliance.across[0].size() > 0
    }

    /// Returns Young's modulus of the tissue that it was solved in, over that of the scene.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// Returns the source for tissue so many times as stiff as that of the scene.
    pub fn in_tissue_as_stiff(self, stiffness: f64) -> LineSource {
        LineSource { stiffness, ..self }
    }

    /// Returns the number of stations of the line.
    pub fn stations(&self) -> usize {
        self.compliance.stations
    }

    #[cfg(test)]
    pub(super) fn compliance_mut(&mut self) -> &mut Compliance {
        &mut self.compliance
    }

    /// Returns whether two lines agree in every bit, apart from their number in the run and their coupling with others.
    pub fn is_identical(&self, other: &LineSource) -> bool {
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let place = |s: &LineSource| [bits(&s.line.entry_m), bits(s.line.axes.as_flattened())];
        let kinds = |s: &LineSource| {
            s.way
                .kinds
                .iter()
                .map(|k| (k.0.to_bits(), k.1, k.2))
                .collect::<Vec<_>>()
        };
        let bone = |s: &LineSource| s.way.bone_m.map(f64::to_bits);
        let sizes = |s: &LineSource| bits(&[s.compliance.spacing_m, s.compliance.tip_length_m]);
        let row = |s: &LineSource, n| bits(s.compliance.rows.row(n));
        let tip = |s: &LineSource| [bits(&s.compliance.tip_missing_m_per_n), bits(&s.compliance.wedge_n)];
        let across = |s: &LineSource| {
            let each = s.compliance.across.iter();
            let rows = |rows: &Rows| (0..rows.size()).map(|n| bits(rows.row(n))).collect::<Vec<_>>();
            (
                s.compliance.across_spacing_m.to_bits(),
                each.map(rows).collect::<Vec<_>>(),
            )
        };
        self.stations() == other.stations()
            && place(self) == place(other)
            && kinds(self) == kinds(other)
            && bone(self) == bone(other)
            && sizes(self) == sizes(other)
            && tip(self) == tip(other)
            && across(self) == across(other)
            && (0..2 * self.stations()).all(|n| row(self, n) == row(other, n))
    }
}

impl HandLine {
    /// Returns the source that it can be made from again. Allocates: for the thread that prepares lines.
    pub fn source(&self) -> LineSource {
        LineSource {
            generation: self.generation,
            line: self.line,
            way: self.way.clone(),
            compliance: self.model.compliance.clone(),
            beside: self.beside.clone(),
            open: (self.state.open_m, self.state.open_layers),
            stiffness: 1.0,
        }
    }

    /// Makes a line of stations whose forces do not move each other, for tests and examples: 1 mm apart, 1 mm/N.
    ///
    /// # Errors
    ///
    /// [`LineError::Unusable`]: too many stations.
    pub fn uniform(generation: u64, line: Line, stations: usize) -> Result<Self, LineError> {
        let way = LineLayers {
            kinds: vec![(0.0, LayerKind::Gland, true)],
            bone_m: None,
        };
        Self::new(generation, line, way, Compliance::diagonal(stations, 1e-3, 1e-3))
    }

    /// Returns the same way through a body that was solved otherwise, at rest: the reference of a measurement.
    ///
    /// # Errors
    ///
    /// [`LineError::Unusable`]: numbers that are no line's.
    pub fn in_other_body(&self, compliance: Compliance) -> Result<Self, LineError> {
        let compliance = compliance.behind_needle(STIFFEST_N_PER_M);
        Self::new(self.generation, self.line, self.way.clone(), compliance)
    }

    /// Makes a line of a made-up body, for tests.
    #[cfg(test)]
    pub(in crate::line) fn made_up(generation: u64, line: Line, compliance: Compliance, beside: Vec<Cross>) -> Self {
        let way = LineLayers {
            kinds: vec![(0.0, LayerKind::Gland, true)],
            bone_m: None,
        };
        Self {
            beside,
            ..Self::new(generation, line, way, compliance).expect("valid")
        }
    }

    /// Makes the line in tissue at rest, with the default forces of its layers.
    ///
    /// # Errors
    ///
    /// Numbers that are no line's.
    pub fn of_source(source: LineSource) -> Result<Self, LineError> {
        let LineSource {
            generation,
            line,
            way,
            compliance,
            beside,
            open,
            stiffness: _,
        } = source;
        if !beside.iter().all(|cross| cross.is_whole(2 * compliance.stations)) {
            return Err(LineError::OtherLines);
        }
        let [first, second] = &compliance.across;
        let across = first.size();
        let is_whole = compliance.rows.is_whole(2 * compliance.stations)
            && (across == 0
                || (first.is_whole(across) && second.is_whole(across) && compliance.across_spacing_m > 0.0));
        if compliance.stations > MAX_STATIONS || across > MAX_ACROSS || !is_whole || !compliance.has_whole_tip() {
            return Err(LineError::Compliance);
        }
        let mut line = Self {
            beside,
            ..Self::new(generation, line, way, compliance)?
        };
        (line.state.open_m, line.state.open_layers) = open;
        line.state.reset();
        Ok(line)
    }

    /// Continues from that state; returns false, and changes nothing, where it belongs to another line.
    pub fn take_state(&mut self, state: &LineState) -> bool {
        let is_own = state.is_of(&self.model);
        if is_own {
            self.state.copy_from(state);
        }
        is_own
    }
}
