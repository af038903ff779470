//! The body under needles that stay in: their columns in this loop, and their part in each tick.

use super::TissueLoop;
use crate::rt::left_loads::{LeftLoads, NeedleLoads};
use bytemuck::Zeroable;
use stylet_sim::line::{BodyAnswer, BodyLine, MAX_LEFT};
use stylet_sim::tissue::{Carry, ElementField, Shift, StepReport};

/// A needle that stays in: its columns, and the loads behind its share of the body's displacement.
pub(super) struct LeftBody {
    pub line: Box<BodyLine>,
    pub used: NeedleLoads,
}

/// Treatment of displacements not caused by the moving needle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Besides {
    /// The displacements are added.
    Added,
    /// The displacements carry the body.
    Carrying,
}

impl LeftBody {
    /// Recomputes the share of the body's displacement.
    pub fn stay(&mut self, loads: &NeedleLoads) {
        self.used = *loads;
        self.line.stay(&loads.of_columns());
    }

    /// Recomputes it if the loads have changed; true then.
    fn follow(&mut self, loads: &NeedleLoads) -> bool {
        let is_other = self.used.of_columns() != loads.of_columns();
        if is_other {
            self.stay(loads);
        }
        is_other
    }
}

impl TissueLoop {
    /// Follows the force loop, which decides by this tick's loads which needles stay in: a needle left keeps its
    /// columns here, and one taken again gets them back.
    pub(super) fn follow_left(&mut self) {
        let loads = self.ports.loads.read();
        self.state.loads = loads.line;
        if self.left.is_empty() && loads.left.needles().is_empty() {
            return;
        }
        let loads = *loads;
        while let Some(at) = self.left.iter().position(|left| {
            let named = loads.left.needles().iter();
            !named
                .map(|n| n.generation)
                .any(|generation| generation == left.line.generation)
        }) {
            self.take_from_left(at);
        }
        for needle in loads.left.needles() {
            self.take_to_left(needle);
        }
        // A needle that stays in moves the body little in one tick: one of them is summed in each.
        let count = self.left.len().max(1) as u64;
        let due = (self.state.response.tick % count) as usize;
        for (n, left) in self.left.iter_mut().enumerate() {
            let loads = loads
                .left
                .needles()
                .iter()
                .find(|n| n.generation == left.line.generation);
            if let Some(loads) = loads {
                left.used.tip_m = loads.tip_m;
                if n == due && left.follow(loads) {
                    self.last_carry.forget();
                }
            }
        }
        self.name_left();
        self.left_loads = loads.left;
    }

    /// Begins with needles that stay in under these loads, each with its columns. Call before the first tick.
    pub fn begin_beside(&mut self, lines: Vec<Box<BodyLine>>, loads: &LeftLoads) {
        for line in lines.into_iter().take(MAX_LEFT) {
            if let Some(of_line) = loads.needles().iter().find(|n| n.generation == line.generation) {
                let used = NeedleLoads::zeroed();
                let mut left = LeftBody { line, used };
                left.stay(of_line);
                self.left.push(left);
            }
        }
        self.name_left();
        self.left_loads = *loads;
        // The force loop gives up needles whose columns this loop does not name.
        self.ports.response.write(self.state.response);
    }

    fn take_from_left(&mut self, at: usize) {
        let LeftBody { line, .. } = self.left.remove(at);
        self.last_carry.forget();
        if line.generation == self.state.loads.generation {
            self.drop_line();
            self.state.response.line = line.generation;
            self.line = Some(line);
        } else {
            self.free(line);
        }
        if self.besides().is_none() {
            self.world.tissue.carry(Carry::NOT);
        }
    }

    fn take_to_left(&mut self, needle: &NeedleLoads) {
        let has_it = self
            .line
            .as_ref()
            .is_some_and(|line| line.generation == needle.generation);
        if !has_it || self.left.len() >= MAX_LEFT {
            return;
        }
        if let Some(line) = self.line.take() {
            self.state.response.line = 0;
            self.leave_line();
            let mut left = LeftBody {
                line,
                used: NeedleLoads::zeroed(),
            };
            left.stay(needle);
            self.left.push(left);
            self.last_carry.forget();
        }
    }

    fn name_left(&mut self) {
        self.state.response.left = [0; MAX_LEFT];
        for (slot, left) in self.state.response.left.iter_mut().zip(&self.left) {
            *slot = left.line.generation;
        }
    }

    /// Drops their columns: the tissue is new.
    pub(super) fn drop_left(&mut self) {
        while let Some(LeftBody { line, .. }) = self.left.pop() {
            self.free(line);
        }
        self.last_carry.forget();
        self.name_left();
        self.left_loads.clear();
    }

    /// Applies their displacement to a body that sums columns.
    pub(super) fn with_left<R>(&mut self, then: impl FnOnce(&mut Self, &[&ElementField]) -> R) -> R {
        // Taken out meanwhile, so that the body can be moved.
        let left = std::mem::take(&mut self.left);
        let none = ElementField::default();
        let pressed = self.pressed.take();
        let of_probe = pressed.as_ref().filter(|p| p.displaces()).map(|p| p.share());
        let mut fields = [&none; MAX_LEFT + 1];
        let shares = left.iter().map(|left| &left.line.share).chain(of_probe);
        let count = fields.iter_mut().zip(shares).map(|(slot, share)| *slot = share).count();
        let result = then(self, fields.get(..count).unwrap_or(&[]));
        self.left = left;
        self.pressed = pressed;
        result
    }

    /// Steps a tick in which no needle moves on a line.
    pub(super) fn step_off_line(&mut self) -> StepReport {
        match self.besides() {
            None => self.world.tissue.step(self.state.held, self.period_s),
            Some(Besides::Added) => self.with_left(|this, fields| {
                let tissue = &mut this.world.tissue;
                tissue.displace(&[], &[], Shift::default());
                let report = tissue.add(fields);
                report.unwrap_or_else(|| tissue.step(None, this.period_s))
            }),
            Some(Besides::Carrying) => self.with_left(|this, fields| {
                if !this.last_carry.is_again(0, &[], [0.0; 3]) {
                    this.world.tissue.carry(Carry { fields, ..Carry::NOT });
                }
                this.world.tissue.step(this.state.held, this.period_s)
            }),
        }
    }

    /// True if a needle without a line must not meet tissue: the body has no answer for one next to needles that stay
    /// in.
    pub(super) fn has_no_answer_off_line(&self) -> bool {
        self.besides() == Some(Besides::Added)
    }

    /// Returns how needles that stay in, or the probe, displace the body besides the moving needle, if they do.
    pub(super) fn besides(&self) -> Option<Besides> {
        let of_probe = self.pressed.as_ref().filter(|p| p.displaces());
        let of_probe = of_probe.map(|_| self.world.spec.adds_columns);
        let of_left = self.left.first();
        let is_added = of_left.map(|left| matches!(left.line.answer, BodyAnswer::Columns(_)));
        Some(match is_added.or(of_probe)? {
            true => Besides::Added,
            false => Besides::Carrying,
        })
    }
}
