//! Outlines and isodose lines of a real picture, as people with a colour blindness see them.

use crate::driven::Driven;
use crate::plan::{header, plan_through, put};
use egui::Color32;
use egui_kittest::kittest::Queryable;
use stylet_test_kit::sight::{self, Matrix, SIGHTS};
use stylet_tests::{Core, scratch};

/// Distance of a pixel from the colour of its line: most of a line is not blended with the grey below.
const OF_LINE: f64 = 6.0;
/// Height of the banners over the upper slices, which have the colours of signals.
const UNDER_BANNERS: u32 = 80;
/// Fewest pixels of a line that is in the picture.
const LEAST_PIXELS: usize = 60;
/// Largest share of a line's pixels that look like those of another line.
const MISTAKEN: f64 = 0.02;

/// Returns the color as this sight sees it, sRGB.
fn seen(color: [u8; 3], of: &Matrix) -> [u8; 3] {
    let coded = |c: f64| match c {
        c if c <= 0.003_130_8 => 12.92 * c,
        c => 1.055 * c.powf(1.0 / 2.4) - 0.055,
    };
    sight::seen(sight::linear(color), of).map(|c| (255.0 * coded(c)).round() as u8)
}

fn apart(a: [u8; 3], b: [u8; 3]) -> f64 {
    sight::apart(sight::linear(a), sight::linear(b))
}

fn rgb(color: Color32) -> [u8; 3] {
    let [r, g, b, _] = color.to_array();
    [r, g, b]
}

/// Returns the line whose colour, as this sight sees it, is nearest to the pixel, and their distance.
fn nearest(pixel: [u8; 3], lines: &[(String, [u8; 3])], sight: &Matrix) -> (usize, f64) {
    let all = lines.iter().map(|(_, color)| apart(pixel, seen(*color, sight)));
    let (n, least) = all.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).expect("lines");
    (n, least)
}

#[test]
fn lines_of_a_picture_are_told_apart_by_every_sight() {
    let core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let mut driven = Driven::on(core, [1920.0, 1080.0]);
    driven.until("the anatomy", |app| app.planner().planning().outlines.is_some());
    driven.window.run_steps(2);
    let planned = plan_through(&header(&driven), &["F6", "H6", "F8", "H8", "G9", "E7", "I7"], 4);
    put(&mut driven, "ui-sights", &planned);
    driven.until("the dose", |app| app.planner().planning().implant.is_some());
    driven.wait_for_label("seeds of I-125 6711");
    driven.come_to_rest();
    let picture = driven.picture("sights");
    let lines = host_ui::colors_of_lines().into_iter();
    let lines: Vec<(String, [u8; 3])> = lines.map(|(name, color)| (name, rgb(color))).collect();
    let mut pixels: Vec<Vec<[u8; 3]>> = vec![Vec::new(); lines.len()];
    for slice in ["Axial slice", "Sagittal slice", "Coronal slice"] {
        let rect = driven.window.get_by_label(slice).rect();
        for y in rect.top() as u32 + UNDER_BANNERS..rect.bottom() as u32 {
            for x in rect.left() as u32..rect.right() as u32 {
                let [r, g, b, _] = picture.get_pixel(x, y).0;
                let (line, off) = nearest([r, g, b], &lines, &SIGHTS[0].1);
                if off < OF_LINE {
                    pixels[line].push([r, g, b]);
                }
            }
        }
    }
    for (of, matrix) in &SIGHTS {
        let mut as_seen = picture.clone();
        for pixel in as_seen.pixels_mut() {
            let [r, g, b, a] = pixel.0;
            let [r, g, b] = seen([r, g, b], matrix);
            pixel.0 = [r, g, b, a];
        }
        as_seen
            .save(scratch(&format!("picture-sights-{of}")).join("sights.png"))
            .expect("saved");
        for ((name, _), of_line) in lines.iter().zip(&pixels).filter(|(_, of)| of.len() >= LEAST_PIXELS) {
            let line = lines.iter().position(|(other, _)| other == name).expect("there");
            let mistaken = of_line
                .iter()
                .filter(|pixel| nearest(seen(**pixel, matrix), &lines, matrix).0 != line);
            let mistaken = mistaken.count();
            println!(
                "{of}: {name}: {mistaken} of {} pixels look like another line",
                of_line.len()
            );
            assert!(
                (mistaken as f64) < MISTAKEN * of_line.len() as f64,
                "{of}: {name}: {mistaken}"
            );
        }
    }
    let drawn = pixels.iter().filter(|of| of.len() >= LEAST_PIXELS).count();
    let counts: Vec<_> = lines
        .iter()
        .map(|(name, _)| name)
        .zip(pixels.iter().map(Vec::len))
        .collect();
    assert!(drawn >= 7, "too few lines in the picture: {counts:?}");
}
