//! The body's answer to a newton along x, y and z on each pad, eight at once, in slices of bounded work.

use super::between::Between;
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
    /// Loads of the pads by a newton on each point along x, y, z: row after row.
    shares: Vec<f32>,
    /// How all points move along x, y, z with a newton on each along each of these, m/N: row after row.
    between: Vec<f32>,
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

    /// How all points move along x, y, z, point after point, with a newton on point `n` along x; along y; along z, m/N.
    #[inline]
    pub(super) fn between(&self, n: usize) -> [&[f32]; 3] {
        let all = 3 * self.wall.points.len();
        [0, 1, 2].map(|r| {
            self.between
                .get((3 * n + r) * all..(3 * n + r + 1) * all)
                .unwrap_or(&[])
        })
    }

    /// Loads of the pads' rows by a newton on point `n` along each direction; and how it moves where they do.
    #[inline]
    pub(super) fn shares(&self, n: usize) -> impl Iterator<Item = &[f32]> {
        let rows = self.rows();
        self.shares
            .get(3 * n * rows..3 * (n + 1) * rows)
            .unwrap_or(&[])
            .chunks_exact(rows.max(1))
    }

    /// Bytes of the columns, and of the compliance.
    pub fn bytes(&self) -> [usize; 2] {
        [
            self.columns.iter().map(PackedField::bytes).sum(),
            8 * self.compliance.len() + size_of_val(&*self.between) + size_of_val(&*self.shares),
        ]
    }
}

/// Columns of a probe, ready ones first.
pub struct ProbeQueue {
    ready: ReadyProbe,
    /// Loads of each row of the pads, and of the points.
    loads: Vec<Vec<NodeWeight>>,
    read: Vec<Vec<NodeWeight>>,
    /// How each row of the points moves with a newton on each of the pads', m/N.
    answers: Vec<f64>,
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
        let points = wall.points.iter().map(|point| point.weights(body));
        let points: Vec<_> = points.collect::<Option<_>>().ok_or(NoWall::NotInBody)?;
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
                shares: Vec::new(),
                between: Vec::new(),
                residual: 0.0,
            },
            answers: vec![0.0; 3 * points.len() * rows],
            loads: rows_of(&weights),
            read: rows_of(&points),
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
        let joined = Between::of(&self.answers, &self.ready.compliance, rows);
        (self.ready.shares, self.ready.between) = (joined.shares, joined.rows);
        Ok(self.ready)
    }

    fn slice(&mut self, body: &BatchModel<f32>) {
        let rows = self.ready.rows();
        let lanes = LOADS.min(rows - self.next);
        if !self.is_begun {
            let loads = &self.loads[self.next..self.next + lanes];
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
            let column = self.next + lane;
            for (values, read) in [
                (&mut self.ready.compliance, &self.loads),
                (&mut self.answers, &self.read),
            ] {
                for (row, load) in values.chunks_exact_mut(rows).zip(read) {
                    row[column] = self.state.sample(lane, load);
                }
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
}

/// Along x, y and z of each.
fn rows_of(places: &[Vec<(u32, f64)>]) -> Vec<Vec<NodeWeight>> {
    let row = |n: usize| {
        let of_place = places[n / 3].iter();
        of_place.map(move |&(node, part)| {
            let mut weight = [0.0; 3];
            weight[n % 3] = part;
            NodeWeight { node, weight }
        })
    };
    (0..3 * places.len()).map(|n| row(n).collect()).collect()
}
