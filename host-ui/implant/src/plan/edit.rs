//! Edits of a plan: each returns a new one, so that undo is a stack of values.

use super::{Hole, ImplantPlan, Loading, Needle, PlanError, SEED_LENGTH_M, SPACER_M};

/// Largest number of steps that can be undone.
const STEPS: usize = 100;

/// Seeds of a needle, evenly spaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Number of seeds, at least 1.
    pub count: usize,
    /// Depth of the first one from the entry.
    pub deepest_m: f64,
    /// Distance from centre to centre.
    pub pitch_m: f64,
    /// True if they are joined to a strand.
    pub stranded: bool,
    /// Strength of each seed, U.
    pub strength_u: f64,
}

impl Row {
    /// Fills a piece of a needle with seeds at the usual distance, centred.
    pub fn filling([from_m, to_m]: [f64; 2], strength_u: f64) -> Self {
        let pitch_m = SEED_LENGTH_M + SPACER_M;
        let count = ((to_m - from_m) / pitch_m).max(0.0) as usize + 1;
        Self {
            count,
            deepest_m: (from_m + to_m + (count - 1) as f64 * pitch_m) / 2.0,
            pitch_m,
            stranded: count > 1,
            strength_u,
        }
    }

    /// Returns the row of a needle by its first two seeds; `None` without seeds.
    pub fn of(needle: &Needle) -> Option<Self> {
        let first = needle.seeds.first()?;
        let pitch_m = match needle.seeds.get(1) {
            Some(second) => first.along_m - second.along_m,
            None => needle.loading.pitch_m().unwrap_or(SEED_LENGTH_M + SPACER_M),
        };
        Some(Self {
            count: needle.seeds.len(),
            deepest_m: first.along_m,
            pitch_m,
            stranded: needle.loading != Loading::Loose,
            strength_u: first.strength_u,
        })
    }
}

impl ImplantPlan {
    /// Replaces all seeds of a needle.
    pub fn with_row(&self, needle: usize, row: Row) -> Result<Self, PlanError> {
        if row.count == 0 || row.pitch_m.is_nan() || row.pitch_m < SEED_LENGTH_M {
            return Err(PlanError::BadRow);
        }
        self.change(needle, |n| {
            let spacer_m = row.pitch_m - SEED_LENGTH_M;
            n.loading = match row.stranded {
                true => Loading::Stranded { spacer_m },
                false => Loading::Loose,
            };
            n.seeds = Needle::strand(row.count, row.deepest_m, spacer_m, row.strength_u);
            Ok(())
        })
    }

    /// Returns the plan with a new needle through a hole of the template, without seeds.
    pub fn with_needle(&self, hole: Hole, depth_m: f64) -> Result<Self, PlanError> {
        if self.needles.iter().any(|n| n.hole == Some(hole)) {
            return Err(PlanError::HoleTaken(hole));
        }
        let mut plan = self.clone();
        plan.needles.push(Needle {
            hole: Some(hole),
            entry_m: self.template.hole_m(hole),
            direction: self.template.inwards,
            depth_m,
            retract_to_m: 0.0,
            loading: Loading::Loose,
            seeds: Vec::new(),
        });
        Ok(plan)
    }

    /// Returns the plan without one of its needles.
    pub fn without_needle(&self, needle: usize) -> Result<Self, PlanError> {
        let mut plan = self.clone();
        if needle >= plan.needles.len() {
            return Err(PlanError::NoNeedle);
        }
        plan.needles.remove(needle);
        Ok(plan)
    }

    /// Returns the plan with a needle and its seeds moved to another hole, at the same depth.
    pub fn with_needle_at(&self, needle: usize, hole: Hole) -> Result<Self, PlanError> {
        if self
            .needles
            .iter()
            .enumerate()
            .any(|(n, other)| n != needle && other.hole == Some(hole))
        {
            return Err(PlanError::HoleTaken(hole));
        }
        let entry_m = self.template.hole_m(hole);
        self.change(needle, |n| {
            (n.hole, n.entry_m) = (Some(hole), entry_m);
            Ok(())
        })
    }

    /// Returns the plan without a seed; a strand loses seeds at its ends only.
    pub fn without_seed(&self, needle: usize, seed: usize) -> Result<Self, PlanError> {
        self.change(needle, |n| {
            if seed >= n.seeds.len() {
                return Err(PlanError::NoSeed);
            }
            if n.loading != Loading::Loose && seed > 0 && seed + 1 < n.seeds.len() {
                return Err(PlanError::InsideStrand);
            }
            n.seeds.remove(seed);
            Ok(())
        })
    }

    /// Replaces all seeds of a needle by a strand with the usual spacers.
    pub fn with_strand(
        &self,
        needle: usize,
        count: usize,
        first_along_m: f64,
        strength_u: f64,
    ) -> Result<Self, PlanError> {
        self.change(needle, |n| {
            n.loading = Loading::Stranded { spacer_m: SPACER_M };
            n.seeds = Needle::strand(count, first_along_m, SPACER_M, strength_u);
            Ok(())
        })
    }

    /// Returns the plan with this strength for every seed.
    pub fn with_strength(&self, strength_u: f64) -> Self {
        let mut plan = self.clone();
        let seeds = plan.needles.iter_mut().flat_map(|n| &mut n.seeds);
        seeds.for_each(|s| s.strength_u = strength_u);
        plan
    }

    fn change(
        &self,
        needle: usize,
        edit: impl FnOnce(&mut Needle) -> Result<(), PlanError>,
    ) -> Result<Self, PlanError> {
        let mut plan = self.clone();
        let changed = plan.needles.get_mut(needle).ok_or(PlanError::NoNeedle)?;
        edit(changed)?;
        *changed = changed.clone().in_order();
        Ok(plan)
    }
}

/// Edited value, such as a plan, with its earlier values, and those that were undone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History<T> {
    now: T,
    before: Vec<T>,
    taken_back: Vec<T>,
}

impl<T: Clone + PartialEq> History<T> {
    /// Creates a history that begins with this value.
    pub fn new(value: T) -> Self {
        Self {
            now: value,
            before: Vec::new(),
            taken_back: Vec::new(),
        }
    }

    /// Returns the present value.
    pub fn now(&self) -> &T {
        &self.now
    }

    /// Adds a value; an equal one is not a step.
    pub fn put(&mut self, value: T) {
        if value == self.now {
            return;
        }
        self.before.push(std::mem::replace(&mut self.now, value));
        self.taken_back.clear();
        if self.before.len() > STEPS {
            self.before.remove(0);
        }
    }

    /// Replaces the present value without a step, while it is being dragged.
    pub fn replace(&mut self, value: T) {
        self.now = value;
        self.taken_back.clear();
    }

    /// Returns whether there is a step to undo.
    pub fn can_undo(&self) -> bool {
        !self.before.is_empty()
    }

    /// Returns whether there is a step to redo.
    pub fn can_redo(&self) -> bool {
        !self.taken_back.is_empty()
    }

    /// Undoes a step; returns false if there is none.
    pub fn undo(&mut self) -> bool {
        let Some(value) = self.before.pop() else { return false };
        self.taken_back.push(std::mem::replace(&mut self.now, value));
        true
    }

    /// Redoes a step; returns false if there is none.
    pub fn redo(&mut self) -> bool {
        let Some(value) = self.taken_back.pop() else {
            return false;
        };
        self.before.push(std::mem::replace(&mut self.now, value));
        true
    }
}

#[cfg(test)]
mod tests;
