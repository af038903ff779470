//! A plane through the body in the patient's directions, and the mapping of its points to the
//! screen.

use crate::view::orientation::Orientation;
use egui::{Pos2, Rect, Vec2};
use nalgebra::{Matrix3, Vector3};

/// Plane of one picture: its centre, two unit vectors, and the size of a point of the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Centre of the picture, scene frame.
    pub middle_m: Vector3<f64>,
    /// Unit vector to the right of the picture.
    pub right: Vector3<f64>,
    /// Unit vector to the top of the picture.
    pub up: Vector3<f64>,
    /// Length of a point of the screen.
    pub m_per_point: f64,
    /// Place of the picture in the window.
    pub rect: Rect,
}

impl Plane {
    /// Returns the plane of this orientation through a centre (scene frame).
    pub fn new(
        orientation: Orientation,
        scene_from_patient: &Matrix3<f64>,
        middle_m: Vector3<f64>,
        m_per_point: f64,
        rect: Rect,
    ) -> Self {
        let [right, up] = orientation.axes().map(|axis| scene_from_patient * axis);
        Self {
            middle_m,
            right,
            up,
            m_per_point,
            rect,
        }
    }

    /// Returns the unit vector towards the eye.
    pub fn normal(&self) -> Vector3<f64> {
        self.right.cross(&self.up)
    }

    /// Returns the distance of a point from the plane, positive in front of it.
    pub fn distance_m(&self, point: Vector3<f64>) -> f64 {
        (point - self.middle_m).dot(&self.normal())
    }

    /// Returns the place on the screen of a scene point, projected onto the plane.
    pub fn on_screen(&self, point: Vector3<f64>) -> Pos2 {
        let from_middle = (point - self.middle_m) / self.m_per_point;
        let (x, y) = (from_middle.dot(&self.right), from_middle.dot(&self.up));
        self.rect.center() + Vec2::new(x as f32, -y as f32)
    }

    /// Returns the place in the scene under a place on the screen.
    pub fn in_scene(&self, place: Pos2) -> Vector3<f64> {
        let from_middle = place - self.rect.center();
        let (x, y) = (f64::from(from_middle.x), f64::from(-from_middle.y));
        self.middle_m + (self.right * x + self.up * y) * self.m_per_point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(orientation: Orientation) -> Plane {
        let rect = Rect::from_min_size(Pos2::new(10.0, 20.0), Vec2::new(300.0, 200.0));
        let middle = Vector3::new(0.03, 0.02, 0.05);
        Plane::new(orientation, &Matrix3::identity(), middle, 0.2e-3, rect)
    }

    #[test]
    fn a_point_goes_to_the_screen_and_back() {
        for orientation in Orientation::ALL {
            let plane = plane(orientation);
            let point = plane.middle_m + plane.right * 0.01 - plane.up * 0.004;
            let back = plane.in_scene(plane.on_screen(point));
            // A point of the screen is a single-precision number.
            assert!((back - point).norm() < 1e-7, "{orientation:?}");
            assert!(plane.distance_m(point).abs() < 1e-12);
        }
    }

    #[test]
    fn patient_right_is_on_the_left_and_up_is_anterior_or_superior() {
        let more = |axis: Vector3<f64>, orientation| {
            let p = plane(orientation);
            p.on_screen(p.middle_m + axis * 0.01) - p.rect.center()
        };
        assert!(more(Vector3::x(), Orientation::Axial).x < 0.0);
        assert!(more(Vector3::y(), Orientation::Axial).y < 0.0, "anterior is up");
        assert!(more(Vector3::z(), Orientation::Sagittal).x > 0.0);
        assert!(more(Vector3::z(), Orientation::Coronal).y < 0.0, "superior is up");
    }
}
