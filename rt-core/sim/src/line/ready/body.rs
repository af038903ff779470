//! The body's half of a line: what it answers to the needle's loads, for the tissue loop.

use crate::line::Line;
use crate::tissue::{ElementField, PackedField};

/// What the tissue loop needs: the body's answer to a newton at each station.
#[derive(Clone, Debug)]
pub struct BodyLine {
    /// That of the [`HandLine`](super::HandLine) made with it.
    pub generation: u64,
    /// Where the line is at rest.
    pub line: Line,
    /// How far a newton moves the body as a whole on its foundation, m; 0 where something holds it.
    pub whole_m_per_n: f64,
    /// For each newton: shaft of each station, then tip at each, then stations across along each direction.
    pub answer: BodyAnswer,
    /// What a needle that stays in on it does to the body, m: see [`stay`](Self::stay).
    pub share: ElementField,
}

impl BodyLine {
    /// With its room for what it does when its needle stays in.
    pub fn new(generation: u64, line: Line, whole_m_per_n: f64, answer: BodyAnswer) -> Self {
        let elements = answer.columns().first().map_or(0, PackedField::elements);
        BodyLine {
            generation,
            line,
            whole_m_per_n,
            answer,
            share: ElementField::with_room(elements),
        }
    }

    /// Its needle stays in and loads the body like that; does not allocate.
    pub fn stay(&mut self, loads_n: &[f64]) {
        self.share.load(self.answer.columns(), loads_n);
    }
}

/// What a tissue model takes of the body's answers to the loads of a line: displacement of every element, m/N.
#[derive(Clone, Debug)]
pub enum BodyAnswer {
    /// For tissue that adds them up.
    Columns(Vec<PackedField>),
    /// Of a coarser body, which carries tissue that finds the rest by itself.
    Carrying(Vec<PackedField>),
}

impl BodyAnswer {
    /// For tissue that does not add columns up: they carry it.
    pub fn carry(&mut self) {
        if let Self::Columns(columns) = self {
            *self = Self::Carrying(std::mem::take(columns));
        }
    }

    /// Displacements of every element.
    pub fn columns(&self) -> &[PackedField] {
        match self {
            Self::Columns(columns) | Self::Carrying(columns) => columns,
        }
    }
}
