//! Depth below the probe's surface, at the edge of its picture, as on the machine's screen.

use super::picture::ProbePicture;
use crate::theme::IMAGE;
use egui::{Align2, FontId, Pos2, Rect, Stroke, Vec2};

/// Distance between ticks, mm; every second one is long, every fourth has its number.
const TICK_MM: u32 = 5;
/// Distance from the edge of the picture, points.
const ASIDE: f32 = 6.0;

/// Returns height in the window and depth (mm) of each tick.
fn ticks(picture: &ProbePicture) -> impl Iterator<Item = (f32, u32)> {
    let (plane, count) = (picture.plane, (picture.plane.depth_m * 1e3 + 1e-6) as u32 / TICK_MM);
    (0..=count).map(move |n| {
        let depth_mm = n * TICK_MM;
        let from_axis_m = plane.probe.radius_m + f64::from(depth_mm) * 1e-3;
        (
            picture.at(plane.pose.middle_m + plane.pose.up * from_axis_m).y,
            depth_mm,
        )
    })
}

/// Draws the scale within `free`, the uncovered part of the picture.
pub(super) fn draw(painter: &egui::Painter, picture: &ProbePicture, free: Rect) {
    let right = picture.rect.right() - ASIDE;
    let color = IMAGE.text.gamma_multiply(0.75);
    for (y, depth_mm) in ticks(picture).filter(|(y, _)| free.y_range().shrink(1.0).contains(*y)) {
        let is_long = depth_mm.is_multiple_of(2 * TICK_MM);
        let left = Pos2::new(right - if is_long { 8.0 } else { 4.0 }, y);
        let ends = [left, Pos2::new(right, y)];
        // A dark outline, because tissue behind it may be as bright.
        painter.line_segment(ends, Stroke::new(3.0, IMAGE.background.gamma_multiply(0.6)));
        painter.line_segment(ends, Stroke::new(1.0, color));
        // A number at the end of the picture would leave it.
        let is_within = free.y_range().shrink(7.0).contains(y);
        if is_within && depth_mm > 0 && depth_mm.is_multiple_of(4 * TICK_MM) {
            let text = match depth_mm == 4 * TICK_MM {
                true => format!("{depth_mm} mm"),
                false => depth_mm.to_string(),
            };
            painter.text(
                left - Vec2::new(3.0, 0.0),
                Align2::RIGHT_CENTER,
                text,
                FontId::proportional(11.0),
                color,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use stylet_imaging::ultrasound::{Plane, Pose, Probe, View};

    #[test]
    fn the_scale_s_ticks_are_at_their_depths() {
        for view in View::ALL {
            let probe = Probe::default();
            let plane = Plane {
                pose: Pose::of_tool(Vector3::zeros(), &UnitQuaternion::identity(), &probe),
                view,
                probe,
                depth_m: 62e-3,
                pixels: [660, 720],
            };
            let rect = Rect::from_min_size(Pos2::new(10.0, 70.0), Vec2::new(330.0, 360.0));
            let is_live = true;
            let picture = ProbePicture { plane, rect, is_live };
            let all: Vec<_> = ticks(&picture).collect();
            assert_eq!(all.len(), 13);
            for (y, depth_mm) in all {
                let found = picture
                    .place_m(Pos2::new(rect.center().x, y + 1e-3))
                    .map(|at| plane.in_beams(at));
                let depth_m = found.map_or(f64::NAN, |at| at.depth_m);
                assert!(
                    depth_mm == 0 || (depth_m - f64::from(depth_mm) * 1e-3).abs() < 1e-5,
                    "{view:?} {depth_mm} {depth_m}"
                );
            }
        }
    }
}
