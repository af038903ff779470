//! The body's half of a line, for the tissue loop: the answer to the needle's loads.

use crate::line::Line;
use crate::tissue::fem::batch::Part;
use crate::tissue::{ElementField, PackedField};

/// Half of a line for the tissue loop: the body's answer to a newton at each station.
#[derive(Clone, Debug)]
pub struct BodyLine {
    /// Number of the [`HandLine`](super::HandLine) made with it.
    pub generation: u64,
    /// Line at rest.
    pub line: Line,
    /// Part of the body that the line enters.
    pub part: Part,
    /// Answer to each newton: shaft of each station, then tip at each, then stations across along each direction.
    pub answer: BodyAnswer,
    /// Displacement of the body by a needle that stays in on it, m: see [`stay`](Self::stay).
    pub share: ElementField,
}

impl BodyLine {
    /// Makes the tissue loop's half, with room for the displacement by a needle that stays in.
    pub fn new(generation: u64, line: Line, part: Part, answer: BodyAnswer) -> Self {
        let elements = answer.columns().first().map_or(0, PackedField::elements);
        BodyLine {
            generation,
            line,
            part,
            answer,
            share: ElementField::with_room(elements),
        }
    }

    /// Its needle stays in and loads the body like that; does not allocate.
    pub fn stay(&mut self, loads_n: &[f64]) {
        self.share.load(self.answer.columns(), loads_n);
    }
}

/// Answer of the body to the loads of a line, in the form that a tissue model takes: displacement of every element,
/// m/N.
#[derive(Clone, Debug)]
pub enum BodyAnswer {
    /// Columns for tissue that adds them up.
    Columns(Vec<PackedField>),
    /// Answer of a coarser body, which carries tissue that finds the rest by itself.
    Carrying(Vec<PackedField>),
}

impl BodyAnswer {
    /// Turns the answer into one that carries the tissue, where a model does not add columns up.
    pub fn carry(&mut self) {
        if let Self::Columns(columns) = self {
            *self = Self::Carrying(std::mem::take(columns));
        }
    }

    /// Returns the displacements of every element.
    pub fn columns(&self) -> &[PackedField] {
        match self {
            Self::Columns(columns) | Self::Carrying(columns) => columns,
        }
    }
}
