//! Classes of links: one row of limits for each pair of structures that may be neighbours.

use super::kernels::Pin;
use crate::limits::Limits;
use crate::limits::LinkLimits;
use crate::scene::Structure;

/// A link between two structures has the tighter of each limit. A fixed structure does not count: it is the
/// other end that gives.
#[derive(Clone, Debug)]
pub(crate) struct Classes {
    /// Limits along x, y, z; row `a + b * structures` for structures a and b.
    table: Vec<[LinkLimits; 3]>,
    /// Each structure's own, and whether it is fixed.
    own: Vec<(Option<[LinkLimits; 3]>, bool)>,
    any_fixed: bool,
    /// Least that any limit allows beyond the state at rest, in elements.
    least_room: f32,
}

impl Classes {
    pub fn new(structures: &[Structure], limits: &Limits) -> Self {
        let own = |s: &Structure| {
            let limits = s.material.limits.as_ref();
            (limits.map(|l| l.each_ref().map(LinkLimits::of)), s.material.fixed)
        };
        let mut classes = Classes {
            table: vec![limits.links; structures.len() * structures.len()],
            own: structures.iter().map(own).collect(),
            any_fixed: structures.iter().any(|s| s.material.fixed),
            least_room: 0.0,
        };
        classes.set_limits(limits);
        classes
    }

    /// Sets the limits without allocating.
    pub fn set_limits(&mut self, limits: &Limits) {
        let count = self.own.len();
        self.least_room = f32::INFINITY;
        for (number, row) in self.table.iter_mut().enumerate() {
            let (a, b) = (&self.own[number % count], &self.own[number / count]);
            let [of_a, of_b] = [a, b].map(|s| s.0.unwrap_or(limits.links));
            *row = match (a.1, b.1) {
                (true, false) => of_b,
                (false, true) => of_a,
                _ => [0, 1, 2].map(|axis| of_a[axis].tighter(&of_b[axis])),
            };
            for link in row {
                self.least_room = self.least_room.min(link.high).min(-link.low).min(link.tan);
            }
        }
    }

    #[cfg(test)]
    pub fn count(&self) -> usize {
        self.table.len()
    }

    pub fn limits(&self, class: u16, axis: usize) -> &LinkLimits {
        &self.table[class as usize][axis]
    }

    pub fn least_room(&self) -> f32 {
        self.least_room
    }

    /// Returns the largest stretch of a link along each axis beyond its length at rest, in elements.
    pub fn longest(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.table.iter().map(|row| row[axis].high).fold(0.0, f32::max))
    }

    pub fn is_fixed(&self, structure: u8) -> bool {
        self.own.get(structure as usize).is_some_and(|s| s.1)
    }

    pub fn any_fixed(&self) -> bool {
        self.any_fixed
    }

    /// Returns the class of a link and its fixed end; `None` between two fixed elements.
    pub fn of_link(&self, lo: u8, hi: u8) -> Option<(u16, Pin)> {
        let pin = match (self.is_fixed(lo), self.is_fixed(hi)) {
            (true, true) => return None,
            (true, false) => Pin::Lo,
            (false, true) => Pin::Hi,
            (false, false) => Pin::None,
        };
        // The smaller number first, so that a pair has one class whichever way round.
        let (a, b) = (lo.min(hi) as usize, lo.max(hi) as usize);
        Some(((a + b * self.own.len()) as u16, pin))
    }
}
