//! A probe in the tissue loop: the wall that it presses, its state, and its share of the body's displacement.

use super::beside::LinesBeside;
use super::columns::ReadyProbe;
use super::contact::{ContactReport, ProbeState, step};
use super::memory::ProbeMemory;
use super::response::ProbeResponse;
use super::shape::ProbePose;
use crate::tissue::{ElementField, PackedField};

/// Probe in a body, made outside the loops; nothing is allocated after that.
#[derive(Clone, Debug)]
pub struct BodyProbe {
    ready: ReadyProbe,
    pub(super) state: ProbeState,
    response: ProbeResponse,
    /// Needle lines in the same body, and how far they displace each pad, along x, y, z, m.
    lines: LinesBeside,
    pub(super) beside_m: Vec<f64>,
    share: ElementField,
    /// Loads that the share was made from.
    shared_n: Vec<f64>,
    /// Loads that the next displacement is made from, and how many of its parts are ready.
    coming_n: Vec<f64>,
    made: usize,
    parts: usize,
}

/// Elements of the body that are added up in each tick, where that takes no more ticks than the next constant: the
/// picture is late by them, the force is not.
const ELEMENTS_A_TICK: usize = 2_048;
const MOST_PARTS: usize = 14;

impl BodyProbe {
    /// Makes the probe out of the body.
    pub fn new(ready: ReadyProbe) -> Self {
        let rows = ready.rows();
        let elements = ready.solved.columns.first().map_or(0, PackedField::elements);
        BodyProbe {
            share: ElementField::with_room(elements),
            coming_n: vec![0.0; rows],
            made: 0,
            parts: elements.div_ceil(ELEMENTS_A_TICK).clamp(1, MOST_PARTS),
            state: ProbeState::new(&ready),
            response: ProbeResponse::default(),
            lines: LinesBeside::with_room(rows),
            beside_m: vec![0.0; rows],
            shared_n: vec![0.0; rows],
            ready,
        }
    }

    /// Returns the wall and columns that it presses.
    pub fn ready(&self) -> &ReadyProbe {
        &self.ready
    }

    /// Returns the last answer.
    pub fn response(&self) -> &ProbeResponse {
        &self.response
    }

    /// Returns the report of the last tick.
    pub fn report(&self) -> ContactReport {
        self.state.report()
    }

    /// Returns the displacement of the body by the probe, m.
    pub fn share(&self) -> &ElementField {
        &self.share
    }

    /// Returns whether it presses the wall, or did in the tick before.
    pub fn displaces(&self) -> bool {
        self.shared_n.iter().any(|n| *n != 0.0)
    }

    /// Removes every other load from the wall, and forgets lines that are not kept.
    pub fn nothing_beside(&mut self, is_kept: impl Fn(u64) -> bool) {
        self.lines.keep(is_kept);
        self.beside_m.fill(0.0);
    }

    /// Displaces the wall by the loads on a line: by its columns, of the same body; those of another do not count.
    /// Reads these columns where the line is new.
    pub fn beside(&mut self, generation: u64, columns: &[PackedField], loads_n: &[f64]) {
        let own = self.ready.solved.columns.first().map(PackedField::elements);
        self.lines.join(generation, columns, &self.ready.elements, own);
        self.lines.displace_pads(generation, loads_n, &mut self.beside_m);
    }

    /// Computes the displacement of the rows of a line by the probe, in the order of its columns, along it, m; returns
    /// the number of rows.
    pub fn displace_line(&self, generation: u64, rows_m: &mut [f64]) -> usize {
        self.lines.displace_line(generation, self.state.loads_n(), rows_m)
    }

    /// Keeps what this tick leaves to the next. Allocates nothing where the room is of this probe; else there is no
    /// probe in it.
    pub fn save(&self, to: &mut ProbeMemory) {
        let rows = self.shared_n.len();
        let fits =
            to.pressed.len() == self.ready.wall.points.len() && [to.shared_n.len(), to.coming_n.len()] == [rows; 2];
        to.is_there = fits;
        if fits {
            to.edge_m = self.ready.solved.edge_m;
            to.pose = self.state.pose();
            for (slot, pressed) in to.pressed.iter_mut().zip(self.state.pressed()) {
                *slot = pressed;
            }
            to.shared_n.copy_from_slice(&self.shared_n);
            to.coming_n.copy_from_slice(&self.coming_n);
            to.made = self.made as u64;
        }
    }

    /// Continues from the state of another probe on the same wall; returns false, and changes nothing, where the wall
    /// differs.
    pub fn load(&mut self, from: &ProbeMemory) -> bool {
        let rows = self.shared_n.len();
        let fits = from.pressed.len() == self.ready.wall.points.len()
            && [from.shared_n.len(), from.coming_n.len()] == [rows; 2]
            && from.made < self.parts as u64;
        if !fits {
            return false;
        }
        self.reset();
        self.state.take_up(&self.ready, from.pose, &from.pressed);
        self.shared_n.copy_from_slice(&from.shared_n);
        self.coming_n.copy_from_slice(&from.coming_n);
        self.made = from.made as usize;
        let columns = &self.ready.solved.columns;
        for part in 0..self.parts {
            self.share.load_part(columns, &self.shared_n, [part, self.parts]);
        }
        for part in 0..self.made {
            self.state.share.load_part(columns, &self.coming_n, [part, self.parts]);
        }
        true
    }

    /// Moves the probe to this pose. Returns whether it displaces the body otherwise than before.
    pub fn follow(&mut self, pose: &ProbePose) -> bool {
        self.response = step(&self.ready, &mut self.state, pose, &self.beside_m);
        if self.made == 0 {
            if self.shared_n == self.state.loads_n() {
                return false;
            }
            self.coming_n.copy_from_slice(self.state.loads_n());
        }
        let making = &mut self.state.share;
        making.load_part(&self.ready.solved.columns, &self.coming_n, [self.made, self.parts]);
        self.made += 1;
        let is_whole = self.made == self.parts;
        if is_whole {
            std::mem::swap(&mut self.share, making);
            self.shared_n.copy_from_slice(&self.coming_n);
            self.made = 0;
        }
        is_whole
    }

    /// Brings the tissue to rest.
    pub fn reset(&mut self) {
        self.state.reset();
        for values in [&mut self.shared_n, &mut self.coming_n, &mut self.beside_m] {
            values.fill(0.0);
        }
        self.made = 0;
        self.share.0.iter_mut().for_each(|axis| axis.fill(0.0));
        self.response = ProbeResponse::nothing(self.response.pose);
    }
}
