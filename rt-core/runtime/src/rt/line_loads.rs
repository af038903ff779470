//! What the force loop does to the body on a prepared line: forces for the tissue loop's columns.

use serde::{Deserialize, Serialize};
use stylet_sim::line::MAX_STATIONS;

/// Forces of the newest tick on a line.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(into = "TapedLoads", from = "TapedLoads")]
pub struct LineLoads {
    /// Of the line that they are for; 0: the needle is on none.
    pub generation: u64,
    /// The tip presses on tissue or is in it.
    pub in_tissue: bool,
    /// Place at rest of the material that the tip is in, from the entry along the line, m.
    pub tip_material_m: f64,
    /// Displacement of that material along the line, m.
    pub tip_displacement_m: f64,
    /// How far the body is moved as a whole besides, along the line, m.
    pub whole_m: f64,
    /// How many of `loads_n` there are.
    pub count: usize,
    /// Shaft of each station, then tip at each.
    pub loads_n: [f64; 2 * MAX_STATIONS],
}

impl LineLoads {
    /// The forces that there are.
    pub fn loads_n(&self) -> &[f64] {
        self.loads_n.get(..self.count).unwrap_or(&[])
    }

    /// Some tissue is pushed.
    pub fn is_any(&self) -> bool {
        self.loads_n().iter().any(|load_n| *load_n != 0.0)
    }

    /// The same in every bit.
    pub fn is_same(&self, other: &Self) -> bool {
        let bits = |loads: &Self| {
            (
                loads.generation,
                loads.in_tissue,
                loads.tip_material_m.to_bits(),
                loads.tip_displacement_m.to_bits(),
                loads.whole_m.to_bits(),
                loads.count,
            )
        };
        let pairs = self.loads_n().iter().zip(other.loads_n());
        bits(self) == bits(other) && pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
    }
}

impl Default for LineLoads {
    fn default() -> Self {
        Self {
            generation: 0,
            in_tissue: false,
            tip_material_m: 0.0,
            tip_displacement_m: 0.0,
            whole_m: 0.0,
            count: 0,
            loads_n: [0.0; 2 * MAX_STATIONS],
        }
    }
}

/// Loads as a flight recording holds them: few stations are in contact.
#[derive(Serialize, Deserialize)]
struct TapedLoads {
    generation: u64,
    in_tissue: bool,
    tip_material_m: f64,
    tip_displacement_m: f64,
    whole_m: f64,
    count: usize,
    /// Those that are not zero, each with its place.
    loads_n: Vec<(u16, f64)>,
}

impl From<LineLoads> for TapedLoads {
    fn from(loads: LineLoads) -> Self {
        let numbered = (0_u16..).zip(loads.loads_n().iter().copied());
        Self {
            generation: loads.generation,
            in_tissue: loads.in_tissue,
            tip_material_m: loads.tip_material_m,
            tip_displacement_m: loads.tip_displacement_m,
            whole_m: loads.whole_m,
            count: loads.count,
            loads_n: numbered.filter(|(_, load_n)| load_n.to_bits() != 0).collect(),
        }
    }
}

impl From<TapedLoads> for LineLoads {
    /// Places that no line has are left out.
    fn from(taped: TapedLoads) -> Self {
        let mut loads = Self {
            generation: taped.generation,
            in_tissue: taped.in_tissue,
            tip_material_m: taped.tip_material_m,
            tip_displacement_m: taped.tip_displacement_m,
            whole_m: taped.whole_m,
            count: taped.count.min(2 * MAX_STATIONS),
            ..Self::default()
        };
        for (place, load_n) in taped.loads_n {
            if let Some(slot) = loads.loads_n.get_mut(usize::from(place)) {
                *slot = load_n;
            }
        }
        loads
    }
}
