//! The beam of a line: a needle bent by hand, bevel and template.

use super::HandLine;
use crate::line::beam::{self, BeamInput, BeamModel, BeamOutput, BeamScratch};
use crate::line::{Compliance, LineOutput};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Distance from hand to tip: needles for implants are 20 cm long.
const LENGTH_M: f64 = 0.2;
/// Compliance of a hand, m/N, and against rotation, rad/(N m): 1 N/mm and 0.5 N m/rad, the stiffest that a loop at 1
/// kHz holds still over a late link (the needle close to its hub is stiffer).
const GRIP: [f64; 2] = [1e-3, 2.0];

/// A needle that bends, or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NeedleBending {
    /// E I, N m^2; 0 is a needle that does not bend.
    pub bending_stiffness_n_m2: f64,
    /// Force of the bevel across the needle, over the cutting force.
    pub bevel: f64,
    /// Play in the hole of the template, to each side, m.
    pub template_gap_m: f64,
    /// Distance from the template to the place of entry, m; 0 is none.
    pub template_distance_m: f64,
}

impl NeedleBending {
    /// Returns whether the needle bends.
    pub fn is_on(&self) -> bool {
        self.bending_stiffness_n_m2 > 0.0
    }
}

/// The half of a line across it; only where its body was solved for it.
#[derive(Clone, Debug)]
pub(super) struct Bending {
    model: BeamModel,
    scratch: BeamScratch,
    bevel: f64,
}

impl Bending {
    pub fn new(compliance: &Compliance) -> Option<Box<Self>> {
        let model = BeamModel {
            bending_stiffness_n_m2: 0.0,
            length_m: LENGTH_M,
            grip: GRIP,
            template_m: None,
            gap_m: 0.0,
            spacing_m: compliance.across_spacing_m,
            whole_m_per_n: compliance.whole_m_per_n,
            across: compliance.across.clone(),
        };
        (model.stations() > 0).then(|| {
            Box::new(Bending {
                scratch: BeamScratch::new(&model),
                model,
                bevel: 0.0,
            })
        })
    }

    pub fn take(&mut self, settings: &NeedleBending) {
        self.model.bending_stiffness_n_m2 = settings.bending_stiffness_n_m2;
        self.model.gap_m = settings.template_gap_m;
        self.model.template_m = (settings.template_distance_m > 0.0).then_some(-settings.template_distance_m);
        self.bevel = settings.bevel;
    }
}

impl HandLine {
    /// Advances the beam by one tick, after the slip: `None` for a needle that does not bend, or a line without
    /// stations across. The tip is that of a rigid needle in the same hand; the bevel leads towards +x of the tool.
    pub fn bend(
        &mut self,
        tip_in_world: &Vector3<f64>,
        world_from_tool: &UnitQuaternion<f64>,
        answer: &LineOutput,
    ) -> Option<BeamOutput> {
        let bending = self.bending.as_mut()?;
        if bending.model.bending_stiffness_n_m2 <= 0.0 {
            self.state.beam.release();
            return None;
        }
        let along_m = self.along_m(tip_in_world);
        let tip_m = along_m - self.in_bone_m(along_m);
        let [axis, first, second] = self.line.axes.map(Vector3::from);
        let sides = [first, second];
        let bending = self.bending.as_mut()?;
        self.state.bend_from_outside(bending.model.stations());
        let direction = world_from_tool * Vector3::z();
        let along = direction.dot(&axis);
        if along < 0.5 {
            return None;
        }
        let slope = sides.map(|side| direction.dot(&side) / along);
        let from_entry = tip_in_world - Vector3::from(self.line.entry_m);
        // Where a rigid needle would be at the tip of this one, and from there back to the hand.
        let place = |side: usize| from_entry.dot(&sides[side]) + slope[side] * (tip_m - along_m);
        let bevel = sides.map(|side| (world_from_tool * Vector3::x()).dot(&side));
        let size = bevel[0].hypot(bevel[1]);
        let cut_n = if answer.held_by.is_none() && size > 0.1 {
            bending.bevel * answer.tip_n / size
        } else {
            0.0
        };
        let input = BeamInput {
            tip_m,
            material_m: answer.tip_material_m,
            hand_m: [0, 1].map(|side| place(side) - slope[side] * bending.model.length_m),
            hand_slope: slope,
            tip_force_n: bevel.map(|part| part * cut_n),
        };
        let output = beam::step(&bending.model, &mut self.state.beam, &mut bending.scratch, &input);
        (!output.is_refused).then_some(output)
    }

    /// Returns whether the body was solved for forces across the line as well.
    pub fn can_bend(&self) -> bool {
        self.bending.is_some()
    }

    /// Directions across the line.
    pub fn across(&self) -> [Vector3<f64>; 2] {
        [1, 2].map(|side: usize| Vector3::from(self.line.axes[side]))
    }

    /// Returns the forces across the line on each station of the tissue, along one direction; none where the line has
    /// no stations across.
    pub fn across_loads_n(&self, side: usize) -> &[f64] {
        let count = self.bending.as_ref().map_or(0, |bending| bending.model.stations());
        self.state.beam.forces_n(side).get(..count).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests;
