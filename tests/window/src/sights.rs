//! Outlines and isodose lines of a real picture, as people with a colour blindness see them.

use crate::driven::Driven;
use crate::plan::{header, plan_through, put};
use egui::Color32;
use egui_kittest::kittest::Queryable;
use stylet_tests::{Core, scratch};

type Matrix = [[f64; 3]; 3];

/// Deuteranopia and protanopia in linear sRGB (Machado, Oliveira and Fernandes 2009, table 1 at severity 1).
const SIGHTS: [(&str, Matrix); 3] = [
    ("normal", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "deuteranopia",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    (
        "protanopia",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
];

/// Distance of a pixel from the colour of its line: most of a line is not blended with the grey below.
const OF_LINE: f64 = 6.0;
/// Height of the banners over the upper slices, which have the colours of signals.
const UNDER_BANNERS: u32 = 80;
/// Fewest pixels of a line that is in the picture.
const LEAST_PIXELS: usize = 60;
/// Largest share of a line's pixels that look like those of another line.
const MISTAKEN: f64 = 0.02;

/// Returns the color as this sight sees it, sRGB.
fn seen([r, g, b]: [u8; 3], sight: &Matrix) -> [u8; 3] {
    let linear = |c: u8| match f64::from(c) / 255.0 {
        c if c <= 0.040_45 => c / 12.92,
        c => ((c + 0.055) / 1.055).powf(2.4),
    };
    let coded = |c: f64| match c.clamp(0.0, 1.0) {
        c if c <= 0.003_130_8 => 12.92 * c,
        c => 1.055 * c.powf(1.0 / 2.4) - 0.055,
    };
    let of = [r, g, b].map(linear);
    sight.map(|row| (255.0 * coded(row.iter().zip(of).map(|(a, c)| a * c).sum())).round() as u8)
}

/// Returns L*, a*, b* (CIE 1976, D65).
fn lab(color: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = color.map(|c| match f64::from(c) / 255.0 {
        c if c <= 0.040_45 => c / 12.92,
        c => ((c + 0.055) / 1.055).powf(2.4),
    });
    let f = |t: f64| {
        if t > 0.008_856 {
            t.cbrt()
        } else {
            7.787 * t + 16.0 / 116.0
        }
    };
    let x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.950_47);
    let y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
    let z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.088_83);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn apart(a: [u8; 3], b: [u8; 3]) -> f64 {
    let (a, b) = (lab(a), lab(b));
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
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
    let begun = std::time::Instant::now();
    while driven.window.query_by_label_contains("seeds of I-125 6711").is_none() {
        assert!(begun.elapsed().as_secs() < 60, "no dose");
        driven.window.run_steps(1);
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
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
    for (sight, matrix) in &SIGHTS {
        let mut as_seen = picture.clone();
        for pixel in as_seen.pixels_mut() {
            let [r, g, b, a] = pixel.0;
            let [r, g, b] = seen([r, g, b], matrix);
            pixel.0 = [r, g, b, a];
        }
        as_seen
            .save(scratch(&format!("picture-sights-{sight}")).join("sights.png"))
            .expect("saved");
        for ((name, _), of_line) in lines.iter().zip(&pixels).filter(|(_, of)| of.len() >= LEAST_PIXELS) {
            let line = lines.iter().position(|(other, _)| other == name).expect("there");
            let mistaken = of_line
                .iter()
                .filter(|pixel| nearest(seen(**pixel, matrix), &lines, matrix).0 != line);
            let mistaken = mistaken.count();
            println!(
                "{sight}: {name}: {mistaken} of {} pixels look like another line",
                of_line.len()
            );
            assert!(
                (mistaken as f64) < MISTAKEN * of_line.len() as f64,
                "{sight}: {name}: {mistaken}"
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
