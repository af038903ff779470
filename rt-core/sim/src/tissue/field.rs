//! A displacement of every element, as a model answers a force with.

/// Displacement of every element's centre, along x, y, z: per newton, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementField(pub [Vec<f32>; 3]);

impl ElementField {
    /// Zeros for that many elements.
    pub fn zeros(elements: usize) -> Self {
        ElementField(std::array::from_fn(|_| vec![0.0; elements]))
    }

    /// Bytes of the displacements.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|c| c.len() * size_of::<f32>()).sum()
    }
}
