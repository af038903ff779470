//! Detects folded tissue near the tip: after the response is out, for the next one.

use super::TissueLoop;
use stylet_sim::tissue::{Carried, MaterialPoint, least_corner};

impl TissueLoop {
    /// Checks for folds. Limits keep ChainMail's cells open; only a linear answer, of the body or of its carrier, is
    /// checked.
    pub(super) fn look_for_folds(&mut self) {
        if !self.world.looks_near_tip {
            return;
        }
        let body = self.world.tissue.deformed();
        let is_linear = self.world.spec.adds_columns || !matches!(body.carried, Carried::Not);
        let at_tip = if is_linear { self.element_at_tip() } else { None };
        let Some(element) = at_tip else {
            (self.state.response.least_corner, self.state.response.folded_from_m) = (1.0, 0.0);
            return;
        };
        let mut least = least_corner(&body, element);
        // Off the line the model keeps its sums; on it each tick sums again.
        if self.state.in_by_line && self.world.tissue.unfold(element, least) {
            least = least_corner(&self.world.tissue.deformed(), element);
        }
        let body = self.world.tissue.deformed();
        let displacement = body.displacement(element).iter().map(|u| u * u).sum::<f64>().sqrt();
        let spacing_m = body.lattice.spacing_m;
        self.state.response.least_corner = least;
        if least <= 0.0 && self.state.response.folded_from_m == 0.0 {
            self.state.response.folded_from_m = displacement * spacing_m;
        }
    }

    /// Returns the element that the tip is in or presses on, from the line or the contact.
    fn element_at_tip(&self) -> Option<u32> {
        if let Some(held) = self.state.held {
            return Some(held.element);
        }
        let line = self
            .line
            .as_ref()
            .filter(|line| line.generation == self.state.loads.generation)?;
        let along_m = self.state.loads.tip_material_m;
        if !self.state.loads.in_tissue || !along_m.is_finite() {
            return None;
        }
        let place_m = line.line.point_m(along_m.max(0.0), [0.0; 2]);
        MaterialPoint::at_rest(&self.world.scene.body, place_m).map(|point| point.element)
    }
}
