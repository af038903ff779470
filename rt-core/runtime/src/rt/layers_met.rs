//! Layers that the tip has met on its way in: the tissue loop's half of `needle::path`.

use crate::rt::pose::TipPose;
use serde::{Deserialize, Serialize};
use stylet_sim::needle::LayerKind;
use stylet_sim::needle::path::MAX_SECTIONS;

/// Announced layers that the haptic loop has not left, outermost first. Numbers rise over the whole run.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LayersMet {
    stack: [(LayerKind, u64); MAX_SECTIONS],
    count: usize,
    announced: u64,
    /// Layer of the tip in the last tick.
    before: Option<LayerKind>,
}

impl LayersMet {
    /// Begins contact with the outermost layer; returns its number.
    pub fn begin(&mut self, kind: LayerKind) -> u64 {
        self.end();
        self.before = Some(kind);
        self.announce(kind)
    }

    /// Ends the contact.
    pub fn end(&mut self) {
        self.count = 0;
        self.before = None;
    }

    /// Takes the tip's layer. Returns its number if the layer is newly met: the layer before it is open, the tip came
    /// inwards from another kind, and the kind is not on the path yet. Tissue met twice on one path is felt as the
    /// layer between.
    pub fn enter(&mut self, kind: LayerKind, inwards: bool, pose: &TipPose) -> Option<u64> {
        self.forget_what_was_left(pose);
        let came_from_elsewhere = self.before.replace(kind).is_some_and(|before| before != kind);
        let on_path = self.stack.iter().take(self.count).any(|(met, _)| *met == kind);
        (came_from_elsewhere && inwards && pose.punctured && !on_path).then(|| self.announce(kind))
    }

    fn announce(&mut self, kind: LayerKind) -> u64 {
        self.announced += 1;
        if let Some(slot) = self.stack.get_mut(self.count) {
            *slot = (kind, self.announced);
            self.count += 1;
        }
        self.announced
    }

    fn forget_what_was_left(&mut self, pose: &TipPose) {
        while let Some((_, number)) = self.count.checked_sub(1).and_then(|last| self.stack.get(last)) {
            let left = *number <= pose.seen_layer && *number > pose.innermost_layer;
            if !left {
                break;
            }
            self.count -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use LayerKind::{Gland, Perineum, Surroundings};

    fn pose(punctured: bool, innermost_layer: u64, seen_layer: u64) -> TipPose {
        TipPose {
            punctured,
            innermost_layer,
            seen_layer,
            ..TipPose::default()
        }
    }

    #[test]
    fn each_layer_is_announced_once_and_only_behind_an_open_membrane() {
        let mut met = LayersMet::default();
        assert_eq!(met.begin(Perineum), 1);
        assert_eq!(met.enter(Surroundings, true, &pose(false, 1, 1)), None, "skin is whole");
        met.enter(Perineum, true, &pose(true, 1, 1));
        assert_eq!(met.enter(Surroundings, true, &pose(true, 1, 1)), Some(2));
        assert_eq!(met.enter(Gland, true, &pose(true, 2, 2)), Some(3));
        // The boundary flickers as the tissue moves.
        assert_eq!(met.enter(Surroundings, true, &pose(true, 3, 3)), None);
        assert_eq!(met.enter(Gland, true, &pose(true, 3, 3)), None);
    }

    #[test]
    fn a_layer_that_was_left_is_met_again_from_outside_only() {
        let mut met = LayersMet::default();
        met.begin(Surroundings);
        assert_eq!(met.enter(Gland, true, &pose(true, 1, 1)), Some(2));
        assert_eq!(met.enter(Gland, true, &pose(true, 1, 2)), None, "still inside");
        assert_eq!(met.enter(Surroundings, false, &pose(true, 1, 2)), None);
        assert_eq!(met.enter(Gland, true, &pose(true, 1, 2)), Some(3));
    }
}
