//! A twin's answer with the tissue near the tip solved for large strain until it rests, where what ships has a few
//! steps a tick.

use crate::error::{Field, apart};
use crate::twin::Twin;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{FemTissue, MaterialPoint, Shift, TissueModel, least_corner};

/// Largest number of calls: each continues where the one before ended.
const MOST_CALLS: usize = 400;
/// Motion in a call below which an element rests, in elements.
const RESTS: f64 = 1e-4;

/// The body of a scene, as the tissue loop has it.
pub struct Unfolded {
    tissue: FemTissue,
    /// Largest movement of an element in a last call, m: how far from rest the worst tick was left.
    pub left_m: f64,
}

impl Unfolded {
    /// # Panics
    ///
    /// If the scene has no finite elements.
    pub fn new(scene: &Scene) -> Self {
        Self {
            tissue: FemTissue::new(scene).expect("materials of a scene that was built"),
            left_m: 0.0,
        }
    }

    /// Returns the displacement of every element of the body by the twin's loads of now, m.
    pub fn field(&mut self, twin: &Twin) -> Field {
        let line = twin.hand.line();
        let tip_m = twin.hand.state().tip().material_m;
        let in_tissue = twin.hand.is_in_tissue() && tip_m.is_finite();
        let place_m = in_tissue.then(|| line.point_m(tip_m.max(0.0), [0.0; 2]));
        let at_tip = place_m.and_then(|m| MaterialPoint::at_rest(&twin.body, m));
        let whole_m = line.axes[0].map(|c| c * twin.hand.whole_m());
        let linear = twin.field();
        let Some(element) = at_tip.map(|point| point.element) else {
            return linear;
        };
        let spacing_m = twin.body.spacing_m;
        let (mut last, mut farthest_m) = (linear, 0.0);
        for _ in 0..MOST_CALLS {
            self.tissue
                .displace(twin.columns(), twin.hand.state().loads_n(), Shift::of_all(whole_m));
            let least = least_corner(&self.tissue.deformed(), element);
            self.tissue.unfold(element, least);
            let body = self.tissue.deformed();
            let moved = |element: u32| body.displacement(element).map(|u| u * spacing_m);
            let now: Field = (0..last.len() as u32).map(moved).collect();
            let moved = now.iter().zip(&last).map(|(a, b)| apart(*a, *b));
            farthest_m = moved.fold(0.0, f64::max);
            last = now;
            if farthest_m < RESTS * spacing_m {
                break;
            }
        }
        self.left_m = self.left_m.max(farthest_m);
        last
    }
}
