//! Layers and bone along a line.

use super::LayerForces;
use crate::line::Line;
use crate::line::model::{LineLayer, MAX_LAYERS, MAX_STATIONS};
use crate::line::stations::NEEDLE_RADIUS_M;
use crate::needle::LayerKind;
use crate::scene::Lattice;
use serde::{Deserialize, Serialize};

/// Samples for each element on the way.
const STEPS: usize = 8;

/// Beginning of each layer, and the place where bone stops the needle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct LineLayers {
    /// Layers in order of depth, up to [`MAX_LAYERS`]; the rest counts as the last. Only the first layer of a kind has
    /// its membrane.
    pub kinds: Vec<(f64, LayerKind, bool)>,
    /// Depth of the first element that no needle enters.
    pub bone_m: Option<f64>,
}

impl LineLayers {
    /// Follows the line from the entry on through `lattice`; elements that `layer_of` does not know are bone.
    pub fn along(line: &Line, lattice: &Lattice, layer_of: &dyn Fn(u32) -> Option<LayerKind>) -> Self {
        let mut way = LineLayers {
            kinds: Vec::new(),
            bone_m: None,
        };
        let step_m = lattice.spacing_m / STEPS as f64;
        let longest = lattice.dims.iter().sum::<usize>().max(MAX_STATIONS) * STEPS;
        for n in 0..longest {
            let cell = line
                .point_m((n as f64 + 0.5) * step_m, [0.0; 2])
                .map(|c| c / lattice.spacing_m);
            if !cell.iter().all(|&c| c >= 0.0) {
                continue;
            }
            let [i, j, k] = cell.map(|c| c as usize);
            let Some(element) = lattice.element_of_cell(i, j, k) else {
                continue;
            };
            let Some(kind) = layer_of(element) else {
                way.bone_m = Some(n as f64 * step_m);
                break;
            };
            way.meet(n as f64 * step_m, kind);
        }
        if let Some(first) = way.kinds.first_mut() {
            first.0 = 0.0;
        }
        way
    }

    fn meet(&mut self, from_m: f64, kind: LayerKind) {
        let is_new = self.kinds.last().is_none_or(|(_, last, _)| *last != kind);
        if is_new && self.kinds.len() < MAX_LAYERS {
            let has_membrane = !self.kinds.iter().any(|(_, met, _)| *met == kind);
            self.kinds.push((from_m, kind, has_membrane));
        }
    }

    pub fn layers(&self, forces: &LayerForces) -> Vec<LineLayer> {
        self.kinds.iter().map(|kind| layer(forces, kind)).collect()
    }
}

/// Returns the resistance of a layer of the way.
pub(super) fn layer(forces: &LayerForces, &(from_m, kind, has_membrane): &(f64, LayerKind, bool)) -> LineLayer {
    let layer = forces.layers.of(kind);
    let is_closed = has_membrane && layer.has_membrane() && forces.membrane_gain > 0.0;
    LineLayer {
        from_m,
        puncture_force_n: if is_closed {
            forces.membrane_gain * layer.puncture_force_n
        } else {
            0.0
        },
        puncture_depth_m: if is_closed {
            layer.puncture_depth_m
        } else {
            f64::INFINITY
        },
        cutting_force_n: forces.cutting_gain * 2.0 * NEEDLE_RADIUS_M * layer.toughness_j_per_m2,
        shaft_friction_n_per_m: forces.shaft_gain * layer.shaft_friction_n_per_m,
    }
}
