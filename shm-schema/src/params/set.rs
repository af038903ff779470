//! A value for every parameter, and the set in force as the core announces it.

use super::{PARAMETER_COUNT, PARAMETERS, ParameterId};
use bytemuck::{Pod, Zeroable};

/// One value for every row of [`PARAMETERS`], SI.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ParameterSet {
    /// By the number of the parameter, SI.
    pub values: [f64; PARAMETER_COUNT],
}

impl Default for ParameterSet {
    fn default() -> Self {
        Self {
            values: PARAMETERS.map(|p| p.default),
        }
    }
}

impl ParameterSet {
    /// Value of a parameter, SI.
    pub fn get(&self, id: ParameterId) -> f64 {
        self.values[id as usize]
    }

    /// Changes a parameter to `value`, SI; nothing is verified.
    pub fn set(&mut self, id: ParameterId, value: f64) {
        self.values[id as usize] = value;
    }
}

/// The parameters in force, written by the bridge after each change.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ParametersInForce {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each change that took effect.
    pub generation: u64,
    /// First tick of the force loop that ran with them; the limits of the tissue hold from the next tick of the tissue
    /// loop on.
    pub effective_tick: u64,
    /// All values.
    pub set: ParameterSet,
}
