//! Clicks on the edge of the gland in transverse planes, as plain values: each edit returns a new
//! one.

use super::outline::Outline;
use nalgebra::{Vector2, Vector3};

/// Distance below which two planes are one, m.
const SAME_PLANE_M: f64 = 0.5e-3;

/// Directions of transverse planes, which are all perpendicular to one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transverse {
    /// Origin on the axis, scene frame, m.
    pub origin_m: Vector3<f64>,
    /// Unit vector to the right in the planes.
    pub right: Vector3<f64>,
    /// Unit vector up in the planes.
    pub up: Vector3<f64>,
    /// Unit vector across the planes, along the axis.
    pub along: Vector3<f64>,
}

impl Transverse {
    /// Converts a scene point to its offset to the right and up in its plane, and the place of the
    /// plane along the axis, m.
    pub fn in_plane_m(&self, place_m: Vector3<f64>) -> (Vector2<f64>, f64) {
        let off = place_m - self.origin_m;
        let across = Vector2::new(off.dot(&self.right), off.dot(&self.up));
        (across, off.dot(&self.along))
    }

    /// Converts back to a scene point, m.
    pub fn place_m(&self, across_m: Vector2<f64>, at_m: f64) -> Vector3<f64> {
        self.origin_m + self.right * across_m.x + self.up * across_m.y + self.along * at_m
    }
}

/// Clicks in one plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Clicks {
    /// Place of the plane along the axis, m.
    pub at_m: f64,
    /// Points to the right and up in the plane, m.
    pub points_m: Vec<[f64; 2]>,
}

/// Clicks in all planes, each of which has at least one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contour {
    planes: Vec<Clicks>,
}

impl Contour {
    /// Returns the planes in their order along the axis.
    pub fn planes(&self) -> &[Clicks] {
        &self.planes
    }

    /// Returns the number of clicks in all planes.
    pub fn points(&self) -> usize {
        self.planes.iter().map(|plane| plane.points_m.len()).sum()
    }

    /// Returns the clicks in the plane at this place.
    pub fn at(&self, at_m: f64) -> Option<&Clicks> {
        self.planes.iter().find(|plane| is_same(plane, at_m))
    }

    /// Returns the contour with one more click.
    #[must_use]
    pub fn with(&self, at_m: f64, point_m: [f64; 2]) -> Self {
        self.with_all(at_m, &[point_m])
    }

    /// Returns the contour with more clicks in one plane.
    #[must_use]
    pub fn with_all(&self, at_m: f64, points_m: &[[f64; 2]]) -> Self {
        let mut contour = self.clone();
        match contour.planes.iter_mut().find(|plane| is_same(plane, at_m)) {
            Some(plane) => plane.points_m.extend(points_m),
            None => {
                let after = contour.planes.partition_point(|plane| plane.at_m < at_m);
                let points_m = points_m.to_vec();
                contour.planes.insert(after, Clicks { at_m, points_m });
            }
        }
        contour
    }

    /// Returns the contour with a click of the plane at this place moved, by its number; unchanged
    /// if there is none.
    #[must_use]
    pub fn with_moved(&self, at_m: f64, number: usize, to_m: [f64; 2]) -> Self {
        let mut contour = self.clone();
        let plane = contour.planes.iter_mut().find(|plane| is_same(plane, at_m));
        if let Some(point) = plane.and_then(|plane| plane.points_m.get_mut(number)) {
            *point = to_m;
        }
        contour
    }

    /// Returns the contour without a click of the plane at this place.
    #[must_use]
    pub fn without(&self, at_m: f64, number: usize) -> Self {
        let mut contour = self.clone();
        if let Some(plane) = contour.planes.iter_mut().find(|plane| is_same(plane, at_m))
            && number < plane.points_m.len()
        {
            plane.points_m.remove(number);
        }
        contour.planes.retain(|plane| !plane.points_m.is_empty());
        contour
    }

    /// Returns the outline of each plane that has one, with its place along the axis.
    pub fn outlines(&self) -> Vec<(f64, Outline)> {
        let outline = |plane: &Clicks| Some((plane.at_m, Outline::through(&plane.points_m)?));
        self.planes.iter().filter_map(outline).collect()
    }
}

fn is_same(plane: &Clicks, at_m: f64) -> bool {
    (plane.at_m - at_m).abs() < SAME_PLANE_M
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clicks_keep_to_their_planes_and_a_plane_without_clicks_is_none() {
        let contour = Contour::default()
            .with(5e-3, [0.01, 0.0])
            .with(-5e-3, [0.0, 0.01])
            .with(5.1e-3, [0.0, 0.02]);
        let places: Vec<(f64, usize)> = contour.planes().iter().map(|p| (p.at_m, p.points_m.len())).collect();
        assert_eq!(places, [(-5e-3, 1), (5e-3, 2)]);
        let moved = contour.with_moved(5e-3, 1, [0.03, 0.03]);
        assert_eq!(moved.at(5e-3).expect("clicked").points_m[1], [0.03, 0.03]);
        assert_eq!(contour.with_moved(0.0, 0, [1.0; 2]), contour);
        assert_eq!(contour.without(-5e-3, 0).planes().len(), 1);
        assert_eq!(contour.without(-5e-3, 7), contour);
        assert_eq!(contour.points(), 3);
    }

    #[test]
    fn a_place_is_found_again_from_its_plane() {
        let turned = nalgebra::Rotation3::from_euler_angles(0.3, -0.4, 1.1);
        let frame = Transverse {
            origin_m: Vector3::new(0.01, 0.02, 0.03),
            right: turned * Vector3::x(),
            up: turned * Vector3::y(),
            along: turned * Vector3::z(),
        };
        let place_m = Vector3::new(0.05, -0.01, 0.08);
        let (across_m, at_m) = frame.in_plane_m(place_m);
        assert!((frame.place_m(across_m, at_m) - place_m).norm() < 1e-15);
    }
}
