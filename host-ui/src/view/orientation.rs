//! The directions of the patient, for slices and views.

use nalgebra::{Matrix3, Vector3};
use stylet_shm_schema::SceneHeader;

/// Orientation of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// Across the body.
    Axial,
    /// From front to back.
    Sagittal,
    /// From side to side.
    Coronal,
}

impl Orientation {
    /// All orientations.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Sagittal, Self::Coronal];

    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Sagittal => "Sagittal",
            Self::Coronal => "Coronal",
        }
    }

    /// Returns the directions to the right and up on the screen, in patient axes (right, anterior,
    /// superior). Axial and coronal face the patient: the patient's right is on the left.
    pub(super) fn axes(self) -> [Vector3<f64>; 2] {
        let (right, anterior, superior) = (Vector3::x(), Vector3::y(), Vector3::z());
        match self {
            Self::Axial => [-right, anterior],
            Self::Sagittal => [superior, anterior],
            Self::Coronal => [-right, superior],
        }
    }

    /// Returns the patient axis across the slice: right, anterior, superior.
    pub(super) fn across(self) -> usize {
        match self {
            Self::Axial => 2,
            Self::Sagittal => 0,
            Self::Coronal => 1,
        }
    }

    /// Returns the letters of left, right, top and bottom.
    pub fn letters(self) -> [&'static str; 4] {
        match self {
            Self::Axial => ["R", "L", "A", "P"],
            Self::Sagittal => ["I", "S", "A", "P"],
            Self::Coronal => ["R", "L", "S", "I"],
        }
    }
}

/// Returns the rotation from patient directions to the scene; the scene's own axes if the transform
/// is not a rotation.
pub fn scene_from_patient(scene: &SceneHeader) -> Matrix3<f64> {
    scene.patient().rotation().transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_turned_patient_is_cut_in_his_own_directions() {
        let mut scene = SceneHeader::zeroed();
        // Superior is -y of the scene, anterior is z.
        scene.patient_from_scene = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0];
        let turned = scene_from_patient(&scene);
        assert!((turned * Vector3::z() + Vector3::y()).norm() < 1e-12);
        scene.patient_from_scene = [0.0; 12];
        assert_eq!(scene_from_patient(&scene), Matrix3::identity());
    }
}
