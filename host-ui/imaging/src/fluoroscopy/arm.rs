//! Geometry of a C-arm: source, detector, and projection.

use nalgebra::{Matrix3, Vector2, Vector3};

/// C-arm about its isocentre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CArm {
    /// Centre of rotation, scene frame, m.
    pub isocentre_m: Vector3<f64>,
    /// Columns: the patient's right, anterior and superior in the scene.
    pub scene_from_patient: Matrix3<f64>,
    /// From source to isocentre, m.
    pub source_to_isocentre_m: f64,
    /// From source to detector, m.
    pub source_to_detector_m: f64,
    /// Edge of the detector, m.
    pub detector_m: f64,
    /// Number of pixels to the right and down.
    pub pixels: [u32; 2],
    /// Orbital angle, rad: from the detector before the patient (0) towards the patient's left.
    pub orbital: f64,
    /// Cranial angle, rad: the detector towards the head.
    pub cranial: f64,
}

impl CArm {
    /// Creates a mobile C-arm with a flat detector of 21 cm, its isocentre in a place; the sizes
    /// are assumed.
    pub fn about(isocentre_m: Vector3<f64>, scene_from_patient: Matrix3<f64>) -> Self {
        Self {
            isocentre_m,
            scene_from_patient,
            source_to_isocentre_m: 0.65,
            source_to_detector_m: 1.0,
            detector_m: 0.21,
            pixels: [512, 512],
            orbital: 0.0,
            cranial: 0.0,
        }
    }

    /// Returns the unit vector from source to detector.
    pub fn beam(&self) -> Vector3<f64> {
        let (sin, cos) = self.orbital.sin_cos();
        let (up, flat) = self.cranial.sin_cos();
        self.scene_from_patient * Vector3::new(-sin * flat, cos * flat, up)
    }

    /// Returns the unit vectors to the right and up of the picture, facing the patient: the
    /// patient's right is on the left.
    pub fn right_up(&self) -> [Vector3<f64>; 2] {
        let (sin, cos) = self.orbital.sin_cos();
        let right = self.scene_from_patient * Vector3::new(-cos, -sin, 0.0);
        [right, right.cross(&self.beam()) * self.handedness()]
    }

    /// Returns 1 if the patient's frame is mirrored in the scene, else -1: the patient's left,
    /// anterior and superior are a left hand.
    fn handedness(&self) -> f64 {
        -self.scene_from_patient.determinant().signum()
    }

    /// Returns the place of the source, scene frame, m.
    pub fn source_m(&self) -> Vector3<f64> {
        self.isocentre_m - self.beam() * self.source_to_isocentre_m
    }

    /// Returns the centre of the detector, scene frame, m.
    pub fn detector_m(&self) -> Vector3<f64> {
        self.source_m() + self.beam() * self.source_to_detector_m
    }

    /// Returns the edge of a pixel, m.
    pub fn pixel_m(&self) -> f64 {
        self.detector_m / f64::from(self.pixels[0].max(self.pixels[1]))
    }

    /// Projects a place of the scene to pixels from the left and upper edge of the picture.
    pub fn pixel_of(&self, place_m: Vector3<f64>) -> Vector2<f64> {
        let from = place_m - self.source_m();
        let on_detector = from * (self.source_to_detector_m / from.dot(&self.beam())) / self.pixel_m();
        let [right, up] = self.right_up();
        let [wide, high] = self.pixels.map(f64::from);
        Vector2::new(0.5 * wide + on_detector.dot(&right), 0.5 * high - on_detector.dot(&up))
    }

    /// Returns the place on the detector of the centre of a pixel, scene frame, m.
    pub fn place_of(&self, column: u32, row: u32) -> Vector3<f64> {
        let [right, up] = self.right_up();
        let on = |n: u32, count: u32| (f64::from(n) + 0.5 - 0.5 * f64::from(count)) * self.pixel_m();
        self.detector_m() + right * on(column, self.pixels[0]) - up * on(row, self.pixels[1])
    }
}
