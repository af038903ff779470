//! The directions of the patient, in which bodies are cut and looked at.

use nalgebra::{Matrix3, Vector3};
use stylet_shm_schema::SceneHeader;

/// The three ways to cut a body.
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
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Sagittal, Self::Coronal];

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Sagittal => "Sagittal",
            Self::Coronal => "Coronal",
        }
    }

    /// To the right and up on the screen, in patient axes (right, anterior, superior). Axial and coronal are seen as by
    /// one who faces the patient: the patient's right is on the left.
    pub(super) fn axes(self) -> [Vector3<f64>; 2] {
        let (right, anterior, superior) = (Vector3::x(), Vector3::y(), Vector3::z());
        match self {
            Self::Axial => [-right, anterior],
            Self::Sagittal => [superior, anterior],
            Self::Coronal => [-right, superior],
        }
    }

    /// Letters of what lies left, right, above and below.
    pub fn letters(self) -> [&'static str; 4] {
        match self {
            Self::Axial => ["R", "L", "A", "P"],
            Self::Sagittal => ["I", "S", "A", "P"],
            Self::Coronal => ["R", "L", "S", "I"],
        }
    }
}

/// Scene from patient directions; the scene's own axes where the transform is no rotation.
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
