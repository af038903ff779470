//! Text over a picture of the C-arm: its technique, its age, and the dose spent.

use super::FluoroView;
use crate::theme::IMAGE;
use crate::view::free::free_of_banners;
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Vec2};
use stylet_imaging::fluoroscopy::{CArm, DoseCounter};

const SIZE: f32 = 12.5;
/// Opacity of the background of text, because the picture is white outside the body.
const BACKING: f32 = 0.8;
/// Largest angle to the side at which the patient's sides are those of the picture.
const SIDES_DEG: f64 = 60.0;

impl FluoroView {
    pub(super) fn words_over(&self, painter: &Painter, rect: Rect, square: Rect, arm: CArm) {
        let free = free_of_banners(painter.ctx(), rect);
        let (sign, color) = match &self.held {
            _ if self.is_on() => ("X-RAY ON".to_owned(), IMAGE.beam),
            Some(held) => {
                let age = age(held.at.elapsed().as_secs());
                let other = held.arm.orbital != arm.orbital || held.arm.cranial != arm.cranial;
                let from = if other {
                    format!("\nfrom {}", angles(&held.arm))
                } else {
                    String::new()
                };
                (format!("Last image held\n{age} old{from}"), IMAGE.text)
            }
            None => ("No image yet. Hold X to expose.".to_owned(), IMAGE.text),
        };
        let spent = format!("{}\n{}", angles(&arm), spent(&self.dose));
        let name = "Fluoroscopy".to_owned();
        let mut texts = vec![
            (free.left_top(), [9.0, 6.0], Align2::LEFT_TOP, name, IMAGE.text),
            (rect.right_bottom(), [-9.0, -6.0], Align2::RIGHT_BOTTOM, sign, color),
            (rect.left_bottom(), [9.0, -6.0], Align2::LEFT_BOTTOM, spent, IMAGE.text),
        ];
        let shown = self.held.as_ref().map_or(arm, |held| held.arm);
        if self.held.is_some() && shown.orbital.to_degrees().abs() <= SIDES_DEG {
            let (right, left) = ("R".to_owned(), "L".to_owned());
            texts.push((square.left_center(), [6.0, 0.0], Align2::LEFT_CENTER, right, IMAGE.text));
            texts.push((
                square.right_center(),
                [-6.0, 0.0],
                Align2::RIGHT_CENTER,
                left,
                IMAGE.text,
            ));
        }
        for (corner, by, align, words, color) in texts {
            backed(painter, corner + Vec2::from(by), align, &words, color);
        }
    }
}

fn backed(painter: &Painter, at: Pos2, align: Align2, words: &str, color: Color32) {
    let galley = painter.layout_no_wrap(words.to_owned(), FontId::proportional(SIZE), color);
    let place = align.anchor_size(at, galley.size());
    let backing = IMAGE.background.gamma_multiply(BACKING);
    painter.rect_filled(place.expand2(Vec2::new(4.0, 2.0)), 3.0, backing);
    painter.galley(place.min, galley, color);
}

fn angles(arm: &CArm) -> String {
    let degrees = |angle: f64| (angle.to_degrees().round() + 0.0) as i64;
    format!("orbital {}°\ncranial {}°", degrees(arm.orbital), degrees(arm.cranial))
}

fn age(seconds: u64) -> String {
    match seconds {
        0..60 => format!("{seconds} s"),
        _ => format!("{} min {} s", seconds / 60, seconds % 60),
    }
}

/// Formats the dose spent; one mGy is 1e-3 Gy, one Gy cm² 1e-4 Gy m².
fn spent(dose: &DoseCounter) -> String {
    format!(
        "beam {:.1} s\n{} pulses\nair kerma {:.2} mGy\nKAP {:.3} Gy cm²",
        dose.beam_s,
        dose.pulses,
        dose.air_kerma_gy * 1e3,
        dose.kerma_area_gy_m2 * 1e4
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_imaging::fluoroscopy::Exposure;

    #[test]
    fn ten_seconds_of_beam_are_shown_in_clinical_units() {
        let arm = CArm::about(nalgebra::Vector3::zeros(), nalgebra::Matrix3::identity());
        let mut dose = DoseCounter::default();
        for _ in 0..80 {
            dose.count(&Exposure::FLUOROSCOPY, &arm);
        }
        // 8.373e-9 * 80^1.983 * 0.1 * (1.016 / 0.5)^2 Gy for a pulse; 10.5 cm squared where that is counted.
        assert_eq!(
            spent(&dose),
            "beam 10.0 s\n80 pulses\nair kerma 1.64 mGy\nKAP 0.181 Gy cm²"
        );
        assert_eq!((age(59), age(61)), ("59 s".to_owned(), "1 min 1 s".to_owned()));
    }
}
