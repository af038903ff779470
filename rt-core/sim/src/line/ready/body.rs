//! The body's half of a line: what it answers to the needle's loads, for the tissue loop.

use crate::line::Line;
use crate::scene::Lattice;
use crate::tissue::{BodyShift, ElementField, PackedField};

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
    /// What a needle that stays in on it does to the body: see [`stay`](Self::stay).
    pub share: BodyShare,
}

/// What a needle that stays in does to the body: displacement of every element, m, or of the body as a whole.
#[derive(Clone, Debug, Default)]
pub struct BodyShare {
    /// Where columns are added up; else empty.
    pub field: ElementField,
    /// Where the motion as a whole is all.
    pub shift: BodyShift,
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
            share: BodyShare {
                field: ElementField::with_room(elements),
                shift: BodyShift::default(),
            },
        }
    }

    /// Its needle stays in and loads the body like that; does not allocate.
    pub fn stay(&mut self, loads_n: &[f64]) {
        match &self.answer {
            BodyAnswer::Columns(columns) | BodyAnswer::Carrying(columns) => self.share.field.load(columns, loads_n),
            BodyAnswer::Shifts(shifts) => self.share.shift = BodyShift::sum(shifts, loads_n),
        }
    }
}

/// What a tissue model takes of the body's answers to the loads of a line.
#[derive(Clone, Debug)]
pub enum BodyAnswer {
    /// Displacement of every element, m/N: tissue that adds them up.
    Columns(Vec<PackedField>),
    /// The same of a coarser body, which carries tissue that finds the rest by itself and is held by something.
    Carrying(Vec<PackedField>),
    /// Motion of the body as a whole, per newton: it carries tissue that nothing holds.
    Shifts(Vec<BodyShift>),
}

impl BodyLine {
    /// As [`BodyAnswer::carry`].
    pub fn carry(&mut self, body: &Lattice, is_held: bool) {
        self.answer.carry(body, is_held);
        if let BodyAnswer::Shifts(_) = self.answer {
            self.share.field = ElementField::default();
        }
    }
}

impl BodyAnswer {
    /// For tissue that does not add columns up: they carry it, or in a body that nothing holds no more of them than the
    /// motion as a whole.
    pub fn carry(&mut self, body: &Lattice, is_held: bool) {
        let Self::Columns(columns) = self else { return };
        *self = if is_held {
            Self::Carrying(std::mem::take(columns))
        } else {
            Self::Shifts(columns.iter().map(|column| BodyShift::of_field(body, column)).collect())
        };
    }

    /// Displacements of every element; none where the motion as a whole is all.
    pub fn columns(&self) -> &[PackedField] {
        match self {
            Self::Columns(columns) | Self::Carrying(columns) => columns,
            Self::Shifts(_) => &[],
        }
    }
}
