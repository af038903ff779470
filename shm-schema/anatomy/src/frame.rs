//! Placement of the patient in the scene.

use nalgebra::{IsometryMatrix3, Matrix3, Point3, Rotation3, Translation3, Vector3};

/// Largest deviation of the rows' products from a rotation's (Frobenius norm).
const NO_ROTATION: f64 = 1e-3;

/// The rigid transform between the frame of a scene and the patient's: right, anterior, superior (RAS), in m.
///
/// Its rotation is a matrix, not a quaternion, so that positions keep every bit through files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatientFrame {
    patient_from_scene: IsometryMatrix3<f64>,
}

impl Default for PatientFrame {
    /// Aligns the scene's axes with the patient's.
    fn default() -> Self {
        Self::new(Matrix3::identity(), Vector3::zeros())
    }
}

impl PatientFrame {
    /// Builds a frame from a rotation (or a reflected one, which is kept) and a translation in m.
    pub fn new(rotation: Matrix3<f64>, translation_m: Vector3<f64>) -> Self {
        Self {
            patient_from_scene: IsometryMatrix3::from_parts(
                Translation3::from(translation_m),
                Rotation3::from_matrix_unchecked(rotation),
            ),
        }
    }

    /// Reads the form in records: row-major rotation, then translation in m. An invalid rotation gives the identity
    /// frame.
    pub fn of_wire(wire: &[f64; 12]) -> Self {
        let rotation = Matrix3::from_row_slice(&wire[..9]);
        let is_rotation = (rotation * rotation.transpose() - Matrix3::identity()).norm() < NO_ROTATION;
        let rotation = if is_rotation { rotation } else { Matrix3::identity() };
        Self::new(rotation, Vector3::from_column_slice(&wire[9..]))
    }

    /// Returns the form in records, see [`PatientFrame::of_wire`].
    pub fn to_wire(&self) -> [f64; 12] {
        let mut wire = [0.0; 12];
        wire[..9].copy_from_slice(self.rotation().transpose().as_slice());
        wire[9..].copy_from_slice(self.translation_m().as_slice());
        wire
    }

    /// Rotation from scene axes to patient axes; its transpose reverses it.
    pub fn rotation(&self) -> &Matrix3<f64> {
        self.patient_from_scene.rotation.matrix()
    }

    /// Origin of the scene in the patient, in m.
    pub fn translation_m(&self) -> &Vector3<f64> {
        &self.patient_from_scene.translation.vector
    }

    /// Converts a position in the scene (m) to the patient (RAS, m).
    pub fn patient_from_scene(&self, in_scene_m: [f64; 3]) -> [f64; 3] {
        self.patient_from_scene
            .transform_point(&Point3::from(in_scene_m))
            .into()
    }

    /// Converts a position in the patient (RAS, m) to the scene (m).
    pub fn scene_from_patient(&self, in_patient_m: [f64; 3]) -> [f64; 3] {
        self.patient_from_scene
            .inverse_transform_point(&Point3::from(in_patient_m))
            .into()
    }

    /// Converts a direction in the scene to the patient.
    pub fn patient_from_scene_direction(&self, in_scene: [f64; 3]) -> [f64; 3] {
        self.patient_from_scene
            .transform_vector(&Vector3::from(in_scene))
            .into()
    }

    /// Converts a direction in the patient to the scene.
    pub fn scene_from_patient_direction(&self, in_patient: [f64; 3]) -> [f64; 3] {
        self.patient_from_scene
            .inverse_transform_vector(&Vector3::from(in_patient))
            .into()
    }
}

/// Converts LPS to RAS, and RAS to LPS: the first two axes are reversed.
pub fn ras_from_lps(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-v.x, -v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oblique() -> PatientFrame {
        let rotation = Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        PatientFrame::new(*rotation.matrix(), Vector3::new(0.01, -0.2, 0.05))
    }

    #[test]
    fn a_place_comes_back() {
        let (frame, place) = (oblique(), [0.03, -0.04, 0.11]);
        let back = frame.scene_from_patient(frame.patient_from_scene(place));
        assert!((0..3).all(|a| (back[a] - place[a]).abs() < 1e-15), "{back:?}");
        let back = frame.scene_from_patient_direction(frame.patient_from_scene_direction(place));
        assert!((0..3).all(|a| (back[a] - place[a]).abs() < 1e-15), "{back:?}");
    }

    /// The arithmetic formerly in the plan, the report and the image readers.
    #[test]
    fn every_bit_is_that_of_rows_and_columns_by_hand() {
        let frame = oblique();
        let wire = frame.to_wire();
        let rotation = Matrix3::from_row_slice(&wire[..9]);
        let origin = Vector3::from_column_slice(&wire[9..]);
        let place = Vector3::new(0.0371, -0.0402, 0.11);
        let patient: [f64; 3] = (rotation * place + origin).into();
        assert_eq!(frame.patient_from_scene(place.into()), patient);
        let scene: [f64; 3] = (rotation.transpose() * (place - origin)).into();
        assert_eq!(frame.scene_from_patient(place.into()), scene);
        let turned: [f64; 3] = (rotation.transpose() * place).into();
        assert_eq!(frame.scene_from_patient_direction(place.into()), turned);
    }

    #[test]
    fn the_wire_keeps_every_bit_and_what_is_no_rotation_is_none() {
        let wire = oblique().to_wire();
        assert_eq!(PatientFrame::of_wire(&wire).to_wire(), wire);
        let mut twice = wire.map(|v| 2.0 * v);
        assert_eq!(PatientFrame::of_wire(&twice).rotation(), &Matrix3::identity());
        twice[0] = f64::NAN;
        assert_eq!(PatientFrame::of_wire(&twice).rotation(), &Matrix3::identity());
        assert_eq!(PatientFrame::of_wire(&[0.0; 12]), PatientFrame::default());
    }

    #[test]
    fn lps_is_its_own_inverse() {
        let v = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(ras_from_lps(v), Vector3::new(-1.0, -2.0, 3.0));
        assert_eq!(ras_from_lps(ras_from_lps(v)), v);
    }
}
