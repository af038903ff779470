//! Needles that stay in: each is a line whose place along itself is held by the template, while another needle moves.
//!
//! A needle that is left keeps the forces of its shaft and tip. Friction acts as before, implicit Coulomb with anchors
//! in the tissue; its tip pushes up to the force at which it cuts, on the patch that it had when it was left. All
//! needles together are one convex problem over the stations of all lines (`docs/physics.md`, *Several needles*),
//! solved once a tick of the force loop in [`solve`]. A needle alone does not use this module.

mod assemble;
mod by_sets;
mod draw;
mod moved;
mod needle;
mod onward;
mod record;
mod solve;

use super::contact::sets::Scratch;
use super::contact::{LineInput, limit_n};
use super::model::MAX_STATIONS;
use super::ready::{HandLine, LayerForces};
use super::rows::Rows;
use super::state::LineOutput;
use crate::simd::{LANES, Simd};
pub use record::LeftRecord;
use stylet_settings::MAX_LEFT_NEEDLES;

/// Needles that stay in at most.
pub const MAX_LEFT: usize = MAX_LEFT_NEEDLES;
/// Loads of one of them at most: its shaft's, and the tip's at the stations around it.
pub const MAX_LEFT_LOADS: usize = MAX_STATIONS + 28;
/// Shaft of each station, and one tip.
const MAX_ELEMENTS: usize = MAX_LEFT * (MAX_STATIONS + 1);
/// Blocks for all needles that stay in, and for the line of the one that moves.
const ALL_BLOCKS: usize = (MAX_ELEMENTS + MAX_STATIONS).div_ceil(LANES);

/// One needle that stays in.
#[derive(Clone, Debug)]
pub struct LeftNeedle {
    line: Box<HandLine>,
    /// Its first element, and how many stations its shaft touches; the tip follows them.
    first: usize,
    stations: usize,
    /// Position of its tip along the line in the world.
    held_m: f64,
    /// Distance that it has been drawn back since it was left, and its speed, m/s; below zero while it is held on its
    /// way.
    drawn_m: f64,
    drawing_m_per_s: f64,
}

/// Share of one needle in the tissue's displacement.
#[derive(Clone, Copy, Debug)]
pub struct LeftShare<'a> {
    /// Number of its line.
    pub generation: u64,
    /// Stations of its line.
    pub stations: usize,
    /// Force of each shaft station that it touches.
    pub shaft_n: &'a [f64],
    /// First station of the tip's load, and its share at each.
    pub tip: (usize, &'a [f64]),
    /// Force of the tip.
    pub tip_n: f64,
}

/// All needles that stay in. Made with room for the longest lines, and allocates nothing after that.
#[derive(Clone, Debug)]
pub struct LeftNeedles {
    needles: Vec<LeftNeedle>,
    simd: Simd,
    /// Elements of all needles, and from one row of `own` to the next.
    count: usize,
    stride: usize,
    own: Vec<f64>,
    /// The inverse of `own`: with it, forces of the elements are found in a few products as long as most of them stick.
    inverse: Rows,
    /// Work space for the inversion.
    pivot: Vec<f64>,
    force_n: Vec<f64>,
    /// Displacement along its own needle at which the element has no force, and its present one.
    rest_m: Vec<f64>,
    u_m: Vec<f64>,
    /// Displacement of the tissue by the probe at the element, along its own needle: taken from `rest_m`.
    moved_m: Vec<f64>,
    low_n: Vec<f64>,
    high_n: Vec<f64>,
    /// Line of the moving needle, with the displacement of its rows by a newton at each element.
    moving: u64,
    moving_rows: usize,
    to_moving: Vec<f64>,
    /// Displacement of the elements by a newton at each row of that line, and by one at its tip.
    from_moving: Vec<f64>,
    by_tip: Vec<f64>,
    /// Force that dents take from each other where a membrane holds the moving tip; 0 where none does.
    taken_n_per_m: f64,
    /// Compliance of the body as a whole along each element and the moving line, m/N.
    whole: Vec<f64>,
    /// Displacement added to the stations of the moving line, m.
    added_m: Vec<f64>,
    /// Set while nothing has moved in the last tick.
    is_still: bool,
    /// Smallest correction of an element that sweeps make, m.
    skipped_m: f64,
    /// Compliance of all elements, then of the stations of the moving line, against each; their forces are found in it.
    all: Rows,
    scratch: Box<Scratch<ALL_BLOCKS>>,
    without_tip: onward::WithoutTip,
}

impl LeftNeedles {
    /// Makes room for needles; every page is written to, so that no tick is the first to touch one.
    pub fn with_room() -> Box<Self> {
        let each = |length: usize| {
            let mut values = vec![1.0; length];
            values.fill(0.0);
            values
        };
        let stride = MAX_ELEMENTS.next_multiple_of(8);
        Box::new(LeftNeedles {
            needles: Vec::with_capacity(MAX_LEFT),
            simd: Simd::detect(),
            count: 0,
            stride: 0,
            own: each(MAX_ELEMENTS * stride),
            inverse: Rows::with_room(MAX_ELEMENTS),
            pivot: each(MAX_ELEMENTS),
            force_n: each(MAX_ELEMENTS),
            rest_m: each(MAX_ELEMENTS),
            u_m: each(MAX_ELEMENTS),
            moved_m: each(MAX_ELEMENTS),
            low_n: each(MAX_ELEMENTS),
            high_n: each(MAX_ELEMENTS),
            moving: 0,
            moving_rows: 0,
            to_moving: each(MAX_ELEMENTS * 2 * MAX_STATIONS),
            from_moving: each(2 * MAX_STATIONS * stride),
            by_tip: each(MAX_ELEMENTS),
            taken_n_per_m: 0.0,
            whole: each(MAX_ELEMENTS),
            added_m: each(2 * MAX_STATIONS),
            is_still: true,
            skipped_m: 0.0,
            all: Rows::with_room(ALL_BLOCKS * LANES),
            scratch: Box::new(Scratch::new()),
            without_tip: onward::WithoutTip::with_room(),
        })
    }

    /// Returns the size of the room, in bytes.
    pub fn bytes(&self) -> usize {
        let all = [
            &self.own,
            &self.force_n,
            &self.rest_m,
            &self.u_m,
            &self.moved_m,
            &self.low_n,
            &self.high_n,
            &self.to_moving,
            &self.from_moving,
            &self.by_tip,
            &self.whole,
            &self.added_m,
        ];
        let values: usize = all.iter().map(|values| 8 * values.len()).sum();
        let rows = 8 * ((ALL_BLOCKS * LANES).pow(2) + MAX_ELEMENTS * MAX_ELEMENTS.next_multiple_of(LANES));
        values + rows + self.without_tip.bytes() + size_of::<Scratch<ALL_BLOCKS>>()
    }

    /// Returns the number of needles that stay in.
    pub fn len(&self) -> usize {
        self.needles.len()
    }

    /// Returns whether no needle stays in.
    pub fn is_empty(&self) -> bool {
        self.needles.is_empty()
    }

    /// Returns the needles in the order in which they were left.
    pub fn needles(&self) -> &[LeftNeedle] {
        &self.needles
    }

    /// Returns the number of the moving line beside them; 0 for none.
    pub fn moving(&self) -> u64 {
        self.moving
    }

    /// Returns whether the displacements of `line` and of every needle that stays in by each other are known.
    pub fn knows(&self, line: &HandLine) -> bool {
        self.needles
            .iter()
            .all(|needle| assemble::pair_coupling(&needle.line, line).is_some())
    }

    /// Leaves the needle of `line` in the tissue. Returns the line where there is no room, or where it does not know
    /// the others.
    ///
    /// # Errors
    ///
    /// The line.
    pub fn leave(&mut self, line: Box<HandLine>) -> Result<(), Box<HandLine>> {
        if self.needles.len() >= MAX_LEFT || !self.knows(&line) {
            return Err(line);
        }
        let (first, stations) = (self.count, line.state.in_contact);
        self.force_n[first..first + stations].copy_from_slice(&line.state.shaft_n[..stations]);
        self.force_n[first + stations] = line.state.tip.force_n;
        self.needles.push(LeftNeedle {
            first,
            stations,
            // Where the world has it, by the last tick.
            held_m: line.state.tip.material_m + line.state.tip_u_m,
            drawn_m: 0.0,
            drawing_m_per_s: 0.0,
            line,
        });
        self.assemble(None);
        self.displace(None);
        self.hold_in_place(self.needles.len() - 1);
        self.begin_moved(self.needles.len() - 1);
        Ok(())
    }

    /// Takes the needle of that line up again unchanged; no needle moves beside the others until
    /// [`beside`](Self::beside) says so.
    pub fn take(&mut self, generation: u64) -> Option<Box<HandLine>> {
        let at = self.needles.iter().position(|n| n.line.generation == generation)?;
        let needle = self.remove(at);
        Some(needle.line)
    }

    /// Takes out a needle that has been drawn out of the tissue, if any.
    pub fn drawn_out(&mut self) -> Option<Box<HandLine>> {
        let is_out = |needle: &LeftNeedle| needle.drawn_m > 0.0 && needle.depth_m() <= 0.0;
        let at = self.needles.iter().position(is_out)?;
        let mut line = self.remove(at).line;
        line.state.clear_loads();
        Some(line)
    }

    /// Takes out all of them, one at each call.
    pub fn give_up(&mut self) -> Option<Box<HandLine>> {
        let mut line = self.needles.pop()?.line;
        line.state.clear_loads();
        self.assemble(None);
        Some(line)
    }

    /// Sets the moving needle beside them, on `line`, or none. Returns false where it does not know one of them.
    pub fn beside(&mut self, line: Option<&HandLine>) -> bool {
        let is_known = line.is_none_or(|line| self.knows(line));
        self.assemble(line.filter(|_| is_known));
        is_known
    }

    /// Sets the layers' forces.
    pub fn set_forces(&mut self, forces: &LayerForces) {
        for needle in &mut self.needles {
            needle.line.set_forces(forces);
        }
        self.limit();
    }

    /// Advances by one tick in which no needle moves.
    pub fn step_alone(&mut self, dt_s: f64) {
        self.taken_n_per_m = 0.0;
        self.draw(dt_s);
        self.move_from_outside();
        if !self.is_still {
            self.displace(None);
            self.solve_alone();
        }
    }

    /// Advances the needle on `line` by one tick beside them; its tip goes no farther than the bone.
    pub fn step_beside(&mut self, line: &mut HandLine, tip_m: f64, dt_s: f64) -> LineOutput {
        let tip_m = tip_m - line.in_bone_m(tip_m);
        self.draw(dt_s);
        self.move_from_outside();
        solve::step_beside(self, line, &LineInput { tip_m, dt_s })
    }

    /// Iterates over the share of each needle in the tissue's displacement.
    pub fn shares(&self) -> impl Iterator<Item = LeftShare<'_>> {
        self.needles.iter().map(|needle| {
            let (first, tip) = (needle.first, needle.first + needle.stations);
            let state = &needle.line.state;
            LeftShare {
                generation: needle.line.generation,
                stations: needle.line.model.compliance.stations,
                shaft_n: &self.force_n[first..tip],
                tip: (state.tip_range.start, &state.tip_weights[..state.tip_range.len()]),
                tip_n: self.force_n[tip],
            }
        })
    }

    /// Returns the elastic energy, half of force times displacement, J. Does not allocate.
    pub fn elastic_j(&self) -> f64 {
        let each = self.force_n.iter().zip(&self.u_m).take(self.count);
        0.5 * each.map(|(f, u)| f * u).sum::<f64>()
    }

    /// Returns the forces of all elements, needle by needle: its shaft's, then its tip's.
    pub fn forces_n(&self) -> &[f64] {
        &self.force_n[..self.count]
    }

    /// Limits the friction of each station by how much of it the shaft is in; the tip pushes up to its cutting force.
    fn limit(&mut self) {
        for needle in &self.needles {
            let model = &needle.line.model;
            let (first, tip) = (needle.first, needle.first + needle.stations);
            for (n, (low, high)) in (self.low_n[first..tip].iter_mut().zip(&mut self.high_n[first..tip])).enumerate() {
                *high = limit_n(model, needle.depth_m(), n);
                *low = -*high;
            }
            let is_in = needle.depth_m() > 0.0;
            let front = model.front(&needle.line.state.tip);
            (self.low_n[tip], self.high_n[tip]) = (0.0, if is_in { front.limit_n } else { 0.0 });
        }
        self.is_still = false;
    }

    /// Lets each element of that needle hold its force at its present place.
    fn hold_in_place(&mut self, at: usize) {
        let needle = &self.needles[at];
        let elements = needle.first..=needle.first + needle.stations;
        self.rest_m[elements.clone()].copy_from_slice(&self.u_m[elements]);
        self.is_still = false;
    }

    /// Removes a needle and gives the line its state back.
    fn remove(&mut self, at: usize) -> LeftNeedle {
        let mut needle = self.needles.remove(at);
        let (first, tip) = (needle.first, needle.first + needle.stations);
        let state = &mut needle.line.state;
        // The probe displaces a needle in the hand as well; here that displacement was subtracted at rest.
        for (n, k) in (first..tip).enumerate() {
            let moved_m = state.outside.at_m(n);
            state.shaft_n[n] = self.force_n[k];
            state.u_m[n] = self.u_m[k] + moved_m;
            state.anchor_m[n] = needle.held_m - self.rest_m[k] - moved_m;
        }
        let at_tip_m = state.outside.at_tip_m;
        let reached_m = needle.held_m - self.rest_m[tip] - at_tip_m;
        state.tip_u_m = self.u_m[tip] + at_tip_m;
        state.tip.force_n = self.force_n[tip];
        state.tip.track_m = state.tip.track_m.max(reached_m);
        state.tip.material_m = reached_m.min(needle.held_m - state.tip_u_m);
        state.in_contact = needle.stations;
        // The later needles move up.
        let gap = needle.stations + 1;
        let end = self.count;
        for values in [&mut self.force_n, &mut self.rest_m, &mut self.u_m, &mut self.moved_m] {
            values.copy_within(first + gap..end, first);
        }
        for later in &mut self.needles[at..] {
            later.first -= gap;
        }
        self.assemble(None);
        needle
    }
}

#[cfg(test)]
mod tests;
