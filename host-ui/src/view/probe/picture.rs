//! Coordinates of a picture of the probe, for drawings and clicks over it.

use egui::{Pos2, Rect, Vec2};
use nalgebra::{Vector2, Vector3};
use stylet_imaging::ultrasound::Plane;

/// Picture of the probe in the window, which maps places of the window to places of the scene and
/// back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbePicture {
    /// Plane of the visible picture, not of one that is still being computed; scene frame.
    pub plane: Plane,
    /// Place of the picture, points of the window.
    pub rect: Rect,
    /// True if it shows probe, tissue and metal of this frame; otherwise it is from an earlier one.
    pub is_live: bool,
}

impl ProbePicture {
    /// Returns the place in the plane under a place of the window, scene frame, m; `None` outside
    /// the picture and beyond its beams.
    pub fn place_m(&self, at: Pos2) -> Option<Vector3<f64>> {
        let off = at - self.rect.min;
        let per_point = self.pixels_per_point();
        let pixel = Vector2::new(f64::from(off.x) * per_point.x, f64::from(off.y) * per_point.y);
        let place_m = self.plane.place_of(pixel);
        (self.rect.contains(at) && self.sees(place_m)).then_some(place_m)
    }

    /// Returns the place of a scene point, projected onto the plane, in the window; it may be
    /// outside the picture.
    pub fn at(&self, place_m: Vector3<f64>) -> Pos2 {
        let (pixel, per_point) = (self.plane.pixel_of(place_m), self.pixels_per_point());
        self.rect.min + Vec2::new((pixel.x / per_point.x) as f32, (pixel.y / per_point.y) as f32)
    }

    /// Returns the distance of a scene point from the plane, m: positive along the plane's normal.
    pub fn distance_m(&self, place_m: Vector3<f64>) -> f64 {
        self.plane.in_beams(place_m).off_plane_m
    }

    /// Returns whether the beams reach a scene point, projected onto the plane.
    pub fn sees(&self, place_m: Vector3<f64>) -> bool {
        let at = self.plane.in_beams(place_m);
        (0.0..=self.plane.depth_m).contains(&at.depth_m) && at.across.abs() <= self.plane.probe.half(self.plane.view)
    }

    fn pixels_per_point(&self) -> Vector2<f64> {
        let [wide, high] = self.plane.pixels.map(f64::from);
        let size = self.rect.size();
        Vector2::new(wide / f64::from(size.x.max(1.0)), high / f64::from(size.y.max(1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use stylet_imaging::ultrasound::{Pose, Probe, View};

    fn picture(view: View) -> ProbePicture {
        let probe = Probe::default();
        let turn = UnitQuaternion::from_euler_angles(0.2, -0.1, 0.4);
        let plane = Plane {
            pose: Pose::of_tool(Vector3::new(5e-3, -20e-3, 60e-3), &turn, &probe),
            view,
            probe,
            depth_m: 60e-3,
            pixels: [660, 720],
        };
        // One and a half pixels to a point.
        let rect = Rect::from_min_size(Pos2::new(286.0, 70.0), Vec2::new(440.0, 480.0));
        let is_live = true;
        ProbePicture { plane, rect, is_live }
    }

    #[test]
    fn a_click_maps_to_the_place_under_it() {
        for view in View::ALL {
            let picture = picture(view);
            let mut seen = 0;
            for at in [[506.0, 300.0], [450.0, 350.0], [560.0, 250.0]] {
                let at = Pos2::from(at);
                let Some(place_m) = picture.place_m(at) else { continue };
                seen += 1;
                assert!((picture.at(place_m) - at).length() < 1e-3, "{view:?} {at}");
                assert!(picture.distance_m(place_m).abs() < 1e-12);
            }
            assert!(seen > 1, "{view:?}");
            assert_eq!(picture.place_m(Pos2::new(200.0, 300.0)), None, "beside the picture");
        }
    }

    #[test]
    fn the_middle_beam_goes_up_from_the_middle_of_the_lower_edge() {
        let picture = picture(View::Transverse);
        let pose = picture.plane.pose;
        let deep = picture.at(pose.middle_m + pose.up * 40e-3);
        assert!((deep.x - picture.rect.center().x).abs() < 1e-3, "{deep}");
        assert!(picture.sees(pose.middle_m + pose.up * 40e-3));
        assert!(!picture.sees(pose.middle_m + pose.up * 5e-3), "in the probe");
        assert!(!picture.sees(pose.middle_m + pose.up * 71e-3), "too deep");
        let before = pose.middle_m + pose.axis * 3e-3;
        assert!((picture.distance_m(before).abs() - 3e-3).abs() < 1e-12);
    }
}
