//! Path of the shaft: the layers that it is in, from the place of contact inwards.

use super::layers::{Layer, LayerKind, Layers};
use serde::{Deserialize, Serialize};

/// Largest number of membranes and tissues that one path can pass. More count as part of the last.
pub const MAX_SECTIONS: usize = 8;

/// A stretch of the path in one layer.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Section {
    /// Kind of the layer.
    pub kind: LayerKind,
    /// Number under which the tissue loop announced it.
    pub number: u64,
    /// Place where it was met, along the path from the place of contact.
    pub entry_m: f64,
    /// Its membrane is open, or it has none.
    pub open: bool,
}

/// The sections that the tip has met and not left, outermost first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct NeedlePath {
    sections: [Section; MAX_SECTIONS],
    count: usize,
    /// The largest number met, left again or not.
    seen: u64,
}

/// The membrane that the tip pushes against, or the last one that it went through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Front {
    /// Counted from where that membrane was met: `u_tip` of eq. 6.
    pub depth_m: f64,
    /// Layer behind the membrane, or without one the outermost.
    pub membrane: Layer,
    /// The layer that the tip cuts.
    pub tissue: Layer,
    /// Set while the innermost membrane is open, or where there is none.
    pub open: bool,
}

impl NeedlePath {
    /// Leaves all sections; numbers announced before stay known.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Sections met and not left, outermost first.
    pub fn sections(&self) -> &[Section] {
        self.sections.get(..self.count).unwrap_or(&[])
    }

    /// Returns the number of the innermost section; 0 outside.
    pub fn innermost(&self) -> u64 {
        self.sections().last().map_or(0, |s| s.number)
    }

    /// Returns the largest number met, left again or not.
    pub fn seen(&self) -> u64 {
        self.seen
    }

    /// Enters `kind`, which the tip has met at `entry_m`. Numbers rise; an old one changes nothing. Returns whether the
    /// number is new.
    pub fn meet(&mut self, layers: &Layers, kind: LayerKind, number: u64, entry_m: f64) -> bool {
        if number <= self.seen || !entry_m.is_finite() {
            return false;
        }
        self.seen = number;
        if let Some(slot) = self.sections.get_mut(self.count) {
            let open = !layers.of(kind).has_membrane();
            *slot = Section {
                kind,
                number,
                entry_m,
                open,
            };
            self.count += 1;
        }
        true
    }

    /// Forgets the inner sections that the tip has come out of: an open membrane by the hysteresis, since it
    /// closes behind the tip. Gives whether any was.
    pub fn leave(&mut self, along_m: f64, hysteresis_m: f64) -> bool {
        let before = self.count;
        while let [_, .., inner] = self.sections() {
            let edge_m = inner.entry_m - if inner.open { hysteresis_m } else { 0.0 };
            // NaN leaves nothing.
            if along_m > edge_m || along_m.is_nan() {
                break;
            }
            self.count -= 1;
        }
        self.count < before
    }

    /// Opens the membrane in front.
    pub fn open(&mut self) {
        if let Some(section) = self.count.checked_sub(1).and_then(|last| self.sections.get_mut(last)) {
            section.open = true;
        }
    }

    /// Returns the membrane in front of a tip `along_m` from the place of contact. `None` outside.
    pub fn front(&self, layers: &Layers, along_m: f64) -> Option<Front> {
        let innermost = self.sections().last()?;
        let with_membrane = |s: &&Section| layers.of(s.kind).has_membrane();
        let membrane = self
            .sections()
            .iter()
            .rev()
            .find(with_membrane)
            .or(self.sections().first())?;
        Some(Front {
            depth_m: along_m - membrane.entry_m,
            membrane: layers.of(membrane.kind),
            tissue: layers.of(innermost.kind),
            open: innermost.open,
        })
    }

    /// Returns the friction that the shaft can have at `along_m`: the sum of `K_f` times length over the layers. A
    /// layer whose membrane is whole does not touch the shaft.
    pub fn shaft_friction_n(&self, layers: &Layers, along_m: f64) -> f64 {
        let ends = self.sections().iter().skip(1).map(|s| s.entry_m).chain([along_m]);
        let friction = |(section, end_m): (&Section, f64)| {
            let length_m = (end_m - section.entry_m).max(0.0);
            if section.open {
                layers.of(section.kind).shaft_friction_n_per_m * length_m
            } else {
                0.0
            }
        };
        self.sections().iter().zip(ends).map(friction).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a path through perineum at 0, fat at 30 mm, gland at 50 mm.
    fn through() -> (Layers, NeedlePath) {
        let layers = Layers::default();
        let mut path = NeedlePath::default();
        path.meet(&layers, LayerKind::Perineum, 1, 0.0);
        path.open();
        path.meet(&layers, LayerKind::Surroundings, 2, 0.03);
        path.meet(&layers, LayerKind::Gland, 3, 0.05);
        (layers, path)
    }

    #[test]
    fn depth_restarts_at_each_membrane_only() {
        let (layers, mut path) = through();
        let front = path.front(&layers, 0.053).unwrap();
        assert!((front.depth_m - 0.003).abs() < 1e-15 && !front.open);
        assert_eq!(front.membrane, layers.of(LayerKind::Gland));
        path.leave(0.049, 5e-4);
        let front = path.front(&layers, 0.049).unwrap();
        // Fat has no membrane: the depth is still that behind the skin.
        assert!((front.depth_m - 0.049).abs() < 1e-15 && front.open);
        assert_eq!(front.membrane, layers.of(LayerKind::Perineum));
        assert_eq!(front.tissue, layers.of(LayerKind::Surroundings));
    }

    #[test]
    fn friction_is_the_sum_over_the_layers_that_the_shaft_is_in() {
        let (layers, mut path) = through();
        let outer = 40.0 * 0.03 + 15.0 * 0.02;
        assert!((path.shaft_friction_n(&layers, 0.055) - outer).abs() < 1e-12);
        path.open();
        assert!((path.shaft_friction_n(&layers, 0.06) - outer - 80.0 * 0.01).abs() < 1e-12);
        assert!((path.shaft_friction_n(&layers, 0.055) - outer - 80.0 * 0.005).abs() < 1e-12);
    }

    #[test]
    fn an_open_membrane_closes_only_behind_the_hysteresis() {
        let (layers, mut path) = through();
        path.open();
        assert!(!path.leave(0.0496, 5e-4) && path.innermost() == 3);
        path.meet(&layers, LayerKind::Wall, 3, 0.055);
        assert_eq!(path.sections().len(), 3);
        assert!(path.leave(0.0494, 5e-4) && path.innermost() == 2);
        assert!(!path.meet(&layers, LayerKind::Gland, 3, 0.05), "left already");
        assert!(path.leave(-1.0, 5e-4));
        assert_eq!(path.sections().len(), 1, "the outermost ends with the contact");
        assert!(!path.leave(f64::NAN, 5e-4));
        for number in 10..100 {
            path.meet(&layers, LayerKind::Wall, number, 0.06);
        }
        assert_eq!(path.sections().len(), MAX_SECTIONS);
    }
}
