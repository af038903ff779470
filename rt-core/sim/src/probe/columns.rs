//! The body's answer to a newton along x, y and z on each pad, eight at once, in slices of bounded work.

use super::shape::ProbeShape;
use super::wall::{NoWall, Wall};
use crate::tissue::fem::batch::{BatchModel, BatchState, LOADS, NodeWeight};
use crate::tissue::{ElementField, PackedField};

/// Residual over load down to which columns are solved.
const TOLERANCE: f64 = 1e-2;
const MOST_ITERATIONS: u32 = 60;
/// Iterations of eight loads between two looks at whether the probe is still wanted.
const TOGETHER: usize = 1;

/// What a probe can press, and what the body answers: made beside the loops, never changed.
#[derive(Clone, Debug)]
pub struct ReadyProbe {
    /// The probe.
    pub shape: ProbeShape,
    /// What it can press.
    pub wall: Wall,
    /// Displacement of the element centres of the body that was solved for, m/N; pad after pad, along x, y, z.
    pub columns: Vec<PackedField>,
    /// Displacement of pads along x, y, z with a newton on each, m/N: row after row, symmetric.
    pub(super) compliance: Vec<f64>,
    /// The element of that body behind the middle of each pad.
    pub elements: Vec<u32>,
    /// Residual over load of the worst column.
    pub residual: f64,
}

impl ReadyProbe {
    /// Rows of the compliance: three for each pad.
    pub fn rows(&self) -> usize {
        3 * self.wall.pads.len()
    }

    /// How row `a` moves with a newton at row `b`, m/N.
    pub fn at(&self, a: usize, b: usize) -> f64 {
        self.compliance.get(a * self.rows() + b).copied().unwrap_or(0.0)
    }

    /// Bytes of the columns, and of the compliance.
    pub fn bytes(&self) -> [usize; 2] {
        [
            self.columns.iter().map(PackedField::bytes).sum(),
            8 * self.compliance.len(),
        ]
    }
}

/// Columns of a probe, ready ones first.
pub struct ProbeQueue {
    ready: ReadyProbe,
    /// Of each pad.
    weights: Vec<Vec<(u32, f64)>>,
    state: BatchState<f32>,
    unpacked: ElementField,
    next: usize,
    is_begun: bool,
}

impl ProbeQueue {
    /// For the wall of a scene in the body that is solved for.
    pub fn new(body: &BatchModel<f32>, wall: Wall, shape: ProbeShape) -> Result<Self, NoWall> {
        let weights = wall.pads.iter().map(|pad| pad.weights(body));
        let weights: Vec<_> = weights.collect::<Option<_>>().ok_or(NoWall::NotInBody)?;
        let elements = wall.pads.iter().map(|pad| {
            let nearest = |f: &&super::wall::Face| (0..3).map(|c| (f.place_m[c] - pad.place_m[c]).powi(2)).sum::<f64>();
            let face = pad.faces.iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
            face.and_then(|f| body.element_at(f.inside_m)).unwrap_or(0)
        });
        let rows = 3 * wall.pads.len();
        Ok(ProbeQueue {
            ready: ReadyProbe {
                shape,
                elements: elements.collect(),
                wall,
                columns: Vec::with_capacity(rows),
                compliance: vec![0.0; rows * rows],
                residual: 0.0,
            },
            weights,
            state: BatchState::new(body),
            unpacked: ElementField::zeros(body.element_count()),
            next: 0,
            is_begun: false,
        })
    }

    /// Columns that are ready, and all.
    pub fn progress(&self) -> [usize; 2] {
        [self.next, self.ready.rows()]
    }

    /// Solves for all of them; `goes_on` is asked between slices of work.
    pub fn prepare(
        mut self,
        body: &BatchModel<f32>,
        goes_on: &mut dyn FnMut([usize; 2]) -> bool,
    ) -> Result<ReadyProbe, NoWall> {
        while self.next < self.ready.rows() {
            if !goes_on(self.progress()) {
                return Err(NoWall::Stopped);
            }
            self.slice(body);
        }
        let rows = self.ready.rows();
        for a in 0..rows {
            for b in 0..a {
                let mean = 0.5 * (self.ready.at(a, b) + self.ready.at(b, a));
                self.ready.compliance[a * rows + b] = mean;
                self.ready.compliance[b * rows + a] = mean;
            }
        }
        Ok(self.ready)
    }

    fn slice(&mut self, body: &BatchModel<f32>) {
        let rows = self.ready.rows();
        let lanes = LOADS.min(rows - self.next);
        if !self.is_begun {
            let loads: Vec<Vec<NodeWeight>> = (self.next..self.next + lanes).map(|row| self.load(row)).collect();
            let slices: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
            self.state.begin(body, &slices);
            self.is_begun = true;
        }
        for _ in 0..TOGETHER * self.state.slices() {
            self.state.advance(body);
        }
        let progress = self.state.progress();
        if progress.residual > TOLERANCE && progress.iterations < MOST_ITERATIONS {
            return;
        }
        for lane in 0..lanes {
            for other in 0..rows {
                let load = self.load(other);
                self.ready.compliance[other * rows + self.next + lane] = self.state.sample(lane, &load);
            }
            self.state.write(body, lane, &mut self.unpacked);
            let mut column = PackedField::zeros(body.element_count());
            column.pack(&self.unpacked);
            self.ready.columns.push(column);
        }
        self.ready.residual = self.ready.residual.max(progress.residual);
        self.next += lanes;
        self.is_begun = false;
    }

    fn load(&self, row: usize) -> Vec<NodeWeight> {
        let weight = |part: f64| {
            let mut along = [0.0; 3];
            along[row % 3] = part;
            along
        };
        let of_pad = self.weights[row / 3].iter();
        of_pad
            .map(|&(node, part)| NodeWeight {
                node,
                weight: weight(part),
            })
            .collect()
    }
}
