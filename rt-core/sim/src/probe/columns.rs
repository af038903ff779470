//! The body's answer to a newton along x, y and z on each pad, eight at once, in slices of bounded work.

use super::between::PointCompliance;
use super::onto::ElementMap;
use super::shape::ProbeShape;
use super::wall::{NoWall, Wall};
use crate::scene::Lattice;
use crate::tissue::fem::batch::{BatchModel, BatchState, LOADS, NodeWeight};
use crate::tissue::{ElementField, PackedField};
use serde::{Deserialize, Serialize};

/// Residual over load down to which columns are solved.
const TOLERANCE: f64 = 1e-2;
const MOST_ITERATIONS: u32 = 60;

/// Wall that a probe can press, with the body's answers: made outside the loops, never changed.
#[derive(Clone, Debug)]
pub struct ReadyProbe {
    /// The probe.
    pub shape: ProbeShape,
    /// Wall that it can press.
    pub wall: Wall,
    /// The element behind the middle of each place that loads the body.
    pub elements: Vec<u32>,
    /// Solution for that wall.
    pub solved: SolvedProbe,
}

/// The answers of a body to a probe: what takes long, and can be kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedProbe {
    /// Displacement of the body's elements, m/N; one place that loads it after another, along x, y, z.
    pub columns: Vec<PackedField>,
    /// Loads of the pads by a newton on each point along x, y, z: row after row; nothing where the points load the body
    /// themselves.
    pub(super) shares: Vec<f32>,
    /// Displacement of all points along x, y, z by a newton on each along each of these, m/N: row after row.
    pub(super) between: Vec<f32>,
    /// Residual over load of the worst column.
    pub residual: f64,
    /// Edge of the elements that were solved in, m: as large as those that are displaced, or smaller.
    pub edge_m: f64,
}

impl SolvedProbe {
    /// Returns whether they belong to that wall in a body of so many elements, and every number is finite.
    fn is_of(&self, wall: &Wall, elements: usize) -> bool {
        let (rows, points) = (3 * wall.loads(), 3 * wall.points.len());
        let shares = if wall.is_loaded_at_points { 0 } else { points * rows };
        let is_field = |field: &PackedField| field.elements() == elements && field.is_sound();
        self.columns.len() == rows
            && self.columns.iter().all(is_field)
            && [self.shares.len(), self.between.len()] == [shares, points * points]
            && self.shares.iter().chain(&self.between).all(|c| c.is_finite())
            && self.edge_m.is_finite()
    }
}

impl ReadyProbe {
    /// Makes a probe from kept answers: of that wall, in a body with those elements. `None` where they belong to
    /// another, or are not finite.
    pub fn of_solved(solved: SolvedProbe, elements: &Lattice, wall: Wall, shape: ProbeShape) -> Option<Self> {
        solved.is_of(&wall, elements.element_count()).then(|| ReadyProbe {
            shape,
            elements: wall.elements_behind(elements),
            wall,
            solved,
        })
    }

    /// Returns the number of rows: three for each place that loads the body.
    pub fn rows(&self) -> usize {
        3 * self.wall.loads()
    }

    /// Returns the displacement of all points along x, y, z, point after point, by a newton on point `n` along x; along
    /// y; along z, m/N.
    #[inline]
    pub(super) fn between(&self, n: usize) -> [&[f32]; 3] {
        let all = 3 * self.wall.points.len();
        [0, 1, 2].map(|r| {
            self.solved
                .between
                .get((3 * n + r) * all..(3 * n + r + 1) * all)
                .unwrap_or(&[])
        })
    }

    /// Loads of the pads' rows by a newton on point `n` along each direction; and how it moves where they do.
    #[inline]
    pub(super) fn shares(&self, n: usize) -> impl Iterator<Item = &[f32]> {
        let rows = self.rows();
        self.solved
            .shares
            .get(3 * n * rows..3 * (n + 1) * rows)
            .unwrap_or(&[])
            .chunks_exact(rows.max(1))
    }

    /// Returns the size of the columns, and that of the tables between points and pads, in bytes.
    pub fn bytes(&self) -> [usize; 2] {
        [
            self.solved.columns.iter().map(PackedField::bytes).sum(),
            size_of_val(&*self.solved.between) + size_of_val(&*self.solved.shares),
        ]
    }
}

/// Columns of a probe that are to be solved for, eight in each batch; batches may be solved for by several threads.
pub struct ProbeQueue {
    shape: ProbeShape,
    wall: Wall,
    elements: Vec<u32>,
    edge_m: f64,
    /// Loads of each row, and of the points where others load the body.
    loads: Vec<Vec<NodeWeight>>,
    read: Vec<Vec<NodeWeight>>,
    onto: ElementMap,
}

/// Work space for the solution of a batch.
pub struct BatchRoom {
    state: BatchState<f32>,
    solved: ElementField,
    onto: ElementField,
}

/// Answers to newtons on the rows of one batch.
pub struct BatchAnswers {
    batch: usize,
    residual: f64,
    answers: Vec<Answer>,
}

/// Displacement of the rows of loads, of the points, and of the body, m/N.
struct Answer {
    loads: Vec<f64>,
    points: Vec<f64>,
    field: PackedField,
}

impl ProbeQueue {
    /// Makes a queue for the wall of a scene in the body that is solved for. The elements of `displaced` are displaced,
    /// whose edge is as long or some times as long.
    pub fn new(body: &BatchModel<f32>, displaced: &Lattice, wall: Wall, shape: ProbeShape) -> Result<Self, NoWall> {
        let weights = wall.load_weights(body).ok_or(NoWall::NotInBody)?;
        let points = wall.points.iter().map(|point| point.weights(body));
        let points: Vec<_> = points.collect::<Option<_>>().ok_or(NoWall::NotInBody)?;
        let points = if wall.is_loaded_at_points { Vec::new() } else { points };
        Ok(ProbeQueue {
            shape,
            elements: wall.elements_behind(displaced),
            wall,
            edge_m: body.spacing_m(),
            loads: rows_of(&weights),
            read: rows_of(&points),
            onto: ElementMap::new(body.lattice(), displaced),
        })
    }

    /// Returns the number of batches.
    pub fn batches(&self) -> usize {
        self.loads.len().div_ceil(LOADS)
    }

    /// Makes the work space for one batch after the other.
    pub fn room(&self, body: &BatchModel<f32>) -> BatchRoom {
        BatchRoom {
            state: BatchState::new(body),
            solved: ElementField::zeros(body.element_count()),
            onto: ElementField::zeros(self.onto.elements()),
        }
    }

    /// Solves for one batch; `None` when `goes_on`, called between slices of work, returned false.
    pub fn solve(
        &self,
        body: &BatchModel<f32>,
        batch: usize,
        room: &mut BatchRoom,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<BatchAnswers> {
        let loads = self.loads.chunks(LOADS).nth(batch).unwrap_or_default();
        let slices: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
        room.state.begin(body, &slices);
        let residual = loop {
            if !goes_on() {
                return None;
            }
            for _ in 0..room.state.slices() {
                room.state.advance(body);
            }
            let progress = room.state.progress();
            if progress.residual <= TOLERANCE || progress.iterations >= MOST_ITERATIONS {
                break progress.residual;
            }
        };
        let answer = |lane: usize| {
            let moved = |rows: &[Vec<NodeWeight>]| rows.iter().map(|row| room.state.sample(lane, row)).collect();
            let (loads, points) = (moved(&self.loads), moved(&self.read));
            room.state.write(body, lane, &mut room.solved);
            let mut field = PackedField::zeros(self.onto.elements());
            field.pack(self.onto.mean(&room.solved, &mut room.onto));
            Answer { loads, points, field }
        };
        Some(BatchAnswers {
            batch,
            residual,
            answers: (0..loads.len()).map(answer).collect(),
        })
    }

    /// Makes the probe from the answers of all batches in any order.
    pub fn finish(self, mut solved: Vec<BatchAnswers>) -> Result<ReadyProbe, NoWall> {
        solved.sort_unstable_by_key(|of| of.batch);
        let residual = solved.iter().map(|of| of.residual).fold(0.0, f64::max);
        let rows = self.loads.len();
        let answers: Vec<Answer> = solved.into_iter().flat_map(|of| of.answers).collect();
        if answers.len() != rows {
            return Err(NoWall::Stopped);
        }
        let moved = |row: usize, column: usize| answers[column].loads[row];
        let compliance = (0..rows * rows).map(|n| 0.5 * (moved(n / rows, n % rows) + moved(n % rows, n / rows)));
        let compliance: Vec<f64> = compliance.collect();
        let between = if self.wall.is_loaded_at_points {
            PointCompliance {
                shares: Vec::new(),
                rows: compliance.iter().map(|moved| *moved as f32).collect(),
            }
        } else {
            let points = (0..self.read.len() * rows).map(|n| answers[n % rows].points[n / rows]);
            PointCompliance::of(&points.collect::<Vec<f64>>(), &compliance, rows)
        };
        Ok(ReadyProbe {
            shape: self.shape,
            wall: self.wall,
            elements: self.elements,
            solved: SolvedProbe {
                columns: answers.into_iter().map(|answer| answer.field).collect(),
                shares: between.shares,
                between: between.rows,
                residual,
                edge_m: self.edge_m,
            },
        })
    }

    /// Solves for all of them in this thread. `goes_on` is given how many columns are ready, and of how many, between
    /// slices of work.
    pub fn prepare(
        self,
        body: &BatchModel<f32>,
        goes_on: &mut dyn FnMut([usize; 2]) -> bool,
    ) -> Result<ReadyProbe, NoWall> {
        let mut room = self.room(body);
        let rows = self.loads.len();
        let solved = (0..self.batches()).map(|batch| {
            let mut goes_on = || goes_on([batch * LOADS, rows]);
            self.solve(body, batch, &mut room, &mut goes_on).ok_or(NoWall::Stopped)
        });
        let solved = solved.collect::<Result<Vec<_>, _>>()?;
        self.finish(solved)
    }
}

/// Returns the loads along x, y and z of each place.
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
