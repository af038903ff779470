//! A line ready for use: the hand's half for the force loop, the body's half for the tissue loop.
//!
//! Made ahead of the needle on a thread of normal priority ([`ReadyLine::prepare`]); neither half allocates after that.

use super::columns::{ColumnQueue, QueueProgress, TOLERANCE};
use super::compliance::Compliance;
use super::contact::{LineInput, Scratch, step_in};
use super::cross::{Cross, LineStations};
use super::model::{LineModel, LineProblem, LineSettings, MAX_STATIONS};
use super::prony::PronyTerm;
use super::state::{LineOutput, LineState};
use super::stations::{Line, StationSettings, Stations};
use crate::needle::{LayerKind, Layers};
use crate::scene::Lattice;
use crate::tissue::fem::batch::BatchModel;
use nalgebra::Vector3;
use std::sync::Arc;
use stylet_settings::ProblemList;

mod bend;
mod body;
mod source;
mod track;
mod way;

use bend::Bending;
pub use bend::NeedleBending;
pub use body::{BodyAnswer, BodyLine};
pub use source::LineSource;
pub use track::Track;
use way::{LineLayers, layer};

/// Largest distance of a line's entry from the needle, and angle between both, at which the needle is on the line.
const BESIDE_M: f64 = 1e-3;
const TILT_RAD: f64 = 0.02;
/// Largest stiffness of a stuck shaft on the hand: by trial with every hand of the envelope, links up to three ticks
/// late, tissue up to 1.7 MPa (docs/stability.md, 19). The paper's gland has 0.42 N/mm.
const STIFFEST_N_PER_M: f64 = 1000.0;
/// Stiffness of bone: the stiffest that every hand of the envelope holds over a slow link.
const BONE_N_PER_M: f64 = STIFFEST_N_PER_M;
/// Slices of work between two looks at whether the line is still wanted.
const SLICES: usize = 8;

/// Both halves of a line, one for each loop.
#[derive(Clone, Debug)]
pub struct ReadyLine {
    /// Half for the force loop.
    pub hand: Box<HandLine>,
    /// Half for the tissue loop.
    pub body: Box<BodyLine>,
    /// Stations at which it loads the body: lines that are prepared later are read there.
    pub stations: Arc<LineStations>,
}

/// Half of a line for the force loop: compliance of the stations, and their state.
#[derive(Clone, Debug)]
pub struct HandLine {
    /// Number of the line; rises with each line of a run, from 1.
    pub generation: u64,
    line: Line,
    way: LineLayers,
    pub(super) model: LineModel,
    pub(super) state: LineState,
    /// Work space of its ticks.
    scratch: Box<Scratch>,
    /// Coupling with the lines that were there when it was solved for.
    pub(super) beside: Vec<Cross>,
    /// Bending, where the body was solved for forces across the line as well.
    bending: Option<Box<Bending>>,
}

/// Resistance of the layers on the way: what a line takes of the settings of the force law
/// (`ChainParameters::layer_forces`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerForces {
    /// Membrane, cutting and friction of each kind.
    pub layers: Layers,
    /// Scales the force at which membranes give way; 0 leaves them out. Their depth stays.
    pub membrane_gain: f64,
    /// Scales cutting.
    pub cutting_gain: f64,
    /// Scales friction.
    pub shaft_gain: f64,
    /// Creep of all of the tissue.
    pub creep: [PronyTerm; 2],
    /// Bending of the needle.
    pub bending: NeedleBending,
}

impl Default for LayerForces {
    fn default() -> Self {
        LayerForces {
            layers: Layers::default(),
            membrane_gain: 1.0,
            cutting_gain: 1.0,
            shaft_gain: 1.0,
            creep: [PronyTerm::default(); 2],
            bending: NeedleBending::default(),
        }
    }
}

/// Why a line could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// No tissue on the way.
    #[error("the needle's line does not pass through tissue that gives way")]
    NoTissue,
    /// Work that is no longer wanted.
    #[error("the needle's line was given up before it was ready")]
    Stopped,
    /// Settings that no line can have.
    #[error("the needle's line cannot be used: {0}")]
    Unusable(ProblemList<LineProblem>),
    /// Answers of other lines that do not fit this one.
    #[error("the needle's line cannot be used: what it knows of other lines is not whole")]
    OtherLines,
    /// A compliance with missing rows, or for too many stations.
    #[error("the needle's line cannot be used: its compliance is not whole")]
    Compliance,
}

impl ReadyLine {
    /// Solves for a line of needle at rest; some seconds for a body of 20,000 elements. `layer_of` tells what an
    /// element of `lattice` is to a needle, and nothing of what no needle enters. `others` are the lines that the
    /// needle may come close to. `report` is called between slices of work and ends it by returning false.
    #[expect(
        clippy::too_many_arguments,
        reason = "each says one thing of the line that is wanted"
    )]
    pub fn prepare(
        generation: u64,
        body: &BatchModel<f32>,
        lattice: &Lattice,
        layer_of: &dyn Fn(u32) -> Option<LayerKind>,
        line: Line,
        bends: bool,
        others: &[Arc<LineStations>],
        report: &mut dyn FnMut(QueueProgress) -> bool,
    ) -> Result<ReadyLine, LineError> {
        let settings = StationSettings::of_lattice(body.spacing_m());
        let way = LineLayers::along(&line, lattice, layer_of);
        let before_bone = way
            .bone_m
            .map_or(MAX_STATIONS, |bone_m| (bone_m / settings.spacing_m).round() as usize);
        let stations = Stations::along(body, line, settings, MAX_STATIONS.min(before_bone));
        if stations.count() == 0 {
            return Err(LineError::NoTissue);
        }
        let mut queue = ColumnQueue::new(body, &stations, bends, TOLERANCE).read_beside(others);
        while !queue.prepare(body, SLICES).is_done() {
            if !report(queue.progress()) {
                return Err(LineError::Stopped);
            }
        }
        let compliance = Compliance::of_columns(body, &stations, queue.columns()).ok_or(LineError::NoTissue)?;
        let compliance = compliance.behind_needle(STIFFEST_N_PER_M);
        let part = stations.part(body);
        let axial = queue.columns().get(..2 * stations.count()).unwrap_or(&[]);
        let beside = Cross::of_columns(axial, line.axes[0], (body, &stations), others);
        Ok(ReadyLine {
            stations: Arc::new(LineStations::of(generation, &stations)),
            hand: Box::new(HandLine {
                beside,
                ..HandLine::new(generation, line, way, compliance)?
            }),
            body: Box::new(BodyLine::new(
                generation,
                line,
                part,
                BodyAnswer::Columns(queue.into_fields()),
            )),
        })
    }
}

impl HandLine {
    fn new(generation: u64, line: Line, way: LineLayers, compliance: Compliance) -> Result<Self, LineError> {
        let layers = way.layers(&LayerForces::default());
        let bending = Bending::new(&compliance);
        let model = LineModel::new(compliance, &layers, LineSettings::default())
            .map_err(|problems| LineError::Unusable(ProblemList(problems)))?;
        Ok(Self {
            generation,
            line,
            way,
            state: LineState::new(&model),
            scratch: Box::new(Scratch::new()),
            model,
            bending,
            beside: Vec::new(),
        })
    }

    /// Returns the straight line at rest.
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// Sets the layers' forces, the creep of the tissue and the bending of the needle; does not allocate.
    pub fn set_forces(&mut self, forces: &LayerForces) {
        let kinds = &self.way.kinds;
        self.model.set_layers(|n| kinds.get(n).map(|kind| layer(forces, kind)));
        self.model.set_prony(forces.creep);
        if let Some(bending) = &mut self.bending {
            bending.take(&forces.bending);
        }
    }

    /// Returns whether a needle held like this goes in on this line.
    pub fn is_met_by(&self, tip_m: &Vector3<f64>, direction: &Vector3<f64>) -> bool {
        self.line.is_met_by(tip_m, direction, BESIDE_M, TILT_RAD)
    }

    /// Returns the distance of the tip along the line from the entry at rest, m.
    pub fn along_m(&self, tip_m: &Vector3<f64>) -> f64 {
        (tip_m - Vector3::from(self.line.entry_m)).dot(&Vector3::from(self.line.axes[0])) + self.state.grip_m
    }

    /// Advances by one tick of the needle, whose tip goes no farther than the bone.
    pub fn step(&mut self, tip_m: f64, dt_s: f64) -> LineOutput {
        let tip_m = tip_m - self.in_bone_m(tip_m);
        let input = LineInput { tip_m, dt_s };
        step_in(&self.model, &mut self.state, &input, &mut self.scratch)
    }

    /// Returns how far a hand wants the tip to be in bone, m; a value that is not finite is passed through.
    pub fn in_bone_m(&self, tip_m: f64) -> f64 {
        match self.way.bone_m {
            Some(bone_m) if tip_m > bone_m => tip_m - bone_m,
            _ => 0.0,
        }
    }

    /// Returns the force of bone on a tip that is held so far in it, on the hand and against the line, N, and its
    /// energy, J.
    pub fn bone(&self, tip_m: f64) -> (f64, f64) {
        let in_bone_m = self.in_bone_m(tip_m);
        (BONE_N_PER_M * in_bone_m, 0.5 * BONE_N_PER_M * in_bone_m * in_bone_m)
    }

    /// Displaces the tissue past the needle, row by row, in the order of [`BodyLine::answer`], m, within so many ticks.
    /// Does not allocate.
    pub fn displace_from_outside(&mut self, rows_m: &[f64], ticks: u32) {
        self.state.outside.set(rows_m, ticks);
    }

    /// Returns the state of the line.
    pub fn state(&self) -> &LineState {
        &self.state
    }

    /// Returns the elastic energy of needle and tissue, J.
    pub fn elastic_j(&self) -> f64 {
        self.state.elastic_j(&self.model)
    }

    /// Returns the displacement of the tissue around the tip along the line, m: less what the needle itself gives, and
    /// less what only tissue nearer than the tip's patch on the lattice moves.
    pub fn tip_displacement_m(&self) -> f64 {
        let load_n: f64 = self.state.loads_n().iter().sum::<f64>() + self.state.whole_n();
        let near_m = if self.state.membrane_n_per_m == 0.0 {
            self.state.near_m(&self.model)
        } else {
            self.state.tip.ahead_m
        };
        self.state.tip_displacement_m() - near_m - self.model.compliance().needle_m_per_n * load_n
    }

    /// Returns the compliance that the tip's rows lack at its present place, m/N.
    pub(super) fn tip_missing_m_per_n(&self) -> f64 {
        let (range, weights) = (self.state.tip_range.clone(), &self.state.tip_weights);
        self.model.compliance.tip_missing_m_per_n(range, weights)
    }

    /// Returns the displacement of the body as a whole by the force that a membrane passes on to it, along the line, m.
    pub fn whole_m(&self) -> f64 {
        self.state.whole_n() * self.model.compliance().whole_m_per_n
    }

    /// Returns whether the tip has tissue before or around it.
    pub fn is_in_tissue(&self) -> bool {
        self.state.is_in_contact()
    }

    /// Returns the depth at which the membrane that holds the tip gives way; 0 where none does.
    pub fn puncture_depth_m(&self, held_by: Option<usize>) -> f64 {
        let depth_m = held_by
            .and_then(|n| self.model.layers.get(n))
            .map(|l| l.puncture_depth_m);
        depth_m.filter(|d| d.is_finite()).unwrap_or(0.0)
    }

    /// Brings the tissue to rest, with the tracks that were open when the line was taken up.
    pub fn reset(&mut self) {
        self.state.reset();
    }

    /// Brings the tissue to rest, as if no needle had touched it.
    pub fn forget(&mut self) {
        (self.state.open_m, self.state.open_layers) = (0.0, 0);
        self.state.reset();
    }

    /// Returns whether the tip presses on a whole membrane.
    pub fn is_held_by_membrane(&self) -> bool {
        self.state.tip.held_by != 0 && self.state.tip.force_n > 0.0
    }

    /// Sets how far the hand holds the needle behind its tip, m.
    pub fn grip_ahead(&mut self, ahead_m: f64) {
        self.state.grip_m = ahead_m;
    }

    /// Returns a needle that was taken up again to the hand's place, once it is out.
    pub fn let_grip_go(&mut self) {
        self.state.grip_m = 0.0;
    }
}

impl Line {
    /// Returns the line on which a needle at `tip_m` goes in; `None` where there is no tissue on its way.
    pub fn into_body(lattice: &Lattice, tip_m: [f64; 3], direction: [f64; 3]) -> Option<Line> {
        let line = Line::new(tip_m, direction)?;
        let (low, high) = lattice.bounds_m();
        let size_m = (0..3).map(|a| (high[a] - low[a]).powi(2)).sum::<f64>().sqrt();
        let middle_m = (0..3)
            .map(|a| (0.5 * (low[a] + high[a]) - tip_m[a]) * line.axes[0][a])
            .sum::<f64>();
        let is_inside = |along_m: f64| {
            let cell = line.point_m(along_m, [0.0; 2]).map(|c| c / lattice.spacing_m);
            cell.iter().all(|&c| c >= 0.0)
                && lattice
                    .element_of_cell(cell[0] as usize, cell[1] as usize, cell[2] as usize)
                    .is_some()
        };
        let step_m = lattice.spacing_m / 16.0;
        let count = (size_m / step_m) as i64;
        let first = (-count..=count)
            .map(|n| middle_m + n as f64 * step_m)
            .find(|&m| is_inside(m))?;
        let (mut outside_m, mut inside_m) = (first - step_m, first);
        for _ in 0..20 {
            let between_m = 0.5 * (outside_m + inside_m);
            if is_inside(between_m) {
                inside_m = between_m;
            } else {
                outside_m = between_m;
            }
        }
        Line::new(line.point_m(inside_m, [0.0; 2]), direction)
    }

    /// Returns whether a needle held like this would go in within `beside_m` of the entry and `tilt_rad` of the
    /// direction.
    pub fn is_met_by(&self, tip_m: &Vector3<f64>, direction: &Vector3<f64>, beside_m: f64, tilt_rad: f64) -> bool {
        let axis = Vector3::from(self.axes[0]);
        let from_entry = tip_m - Vector3::from(self.entry_m);
        let along_m = from_entry.dot(&axis);
        // Where the needle's own axis passes the entry.
        let there = from_entry - direction * (along_m / direction.dot(&axis));
        direction.dot(&axis) > 0.0 && there.norm() <= beside_m && direction.cross(&axis).norm() <= tilt_rad
    }
}

#[cfg(test)]
mod tests;
