//! A value for every parameter.

use super::{PARAMETER_COUNT, PARAMETERS, ParameterId};
use bytemuck::{Pod, Zeroable};

/// One value for every row of [`PARAMETERS`], SI.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ParameterSet {
    /// Values by the number of the parameter, SI.
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

    /// Changes a parameter to `value`, SI, without validation.
    pub fn set(&mut self, id: ParameterId, value: f64) {
        self.values[id as usize] = value;
    }
}
