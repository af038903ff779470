//! The moving picture of the README: the example, moment by moment; `make animation` keeps it.

use crate::driven::options_of;
use crate::opened::{Harness, open_window};
use egui_kittest::kittest::Queryable;
use image::RgbaImage;
use std::collections::HashMap;
use std::path::Path;
use std::time::{Duration, Instant};
use stylet_shm_schema::Instance;
use stylet_tests::Alone;

/// Narrow, so that the pictures have all of the window beside the steps.
const SIZE: [f32; 2] = [1000.0, 620.0];
/// Time between two pictures, in the recording and on the screen, and that of the last one, s.
const BETWEEN_S: f64 = 0.1;
const LAST_S: u16 = 1;
/// Most frequent colours, and others that differ most from them, such as that of a seed.
const COLOURS: [usize; 2] = [160, 96];
/// Height of the words over the picture, points.
const BANNER: f32 = 36.0;

fn steps(window: &mut Harness, count: usize) {
    for _ in 0..count {
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns each picture that differs from the one before.
fn pictures() -> Vec<RgbaImage> {
    let alone = Alone(Instance::new("ui-animation").expect("a valid name"));
    let mut window = open_window(SIZE, options_of(alone.0.clone()));
    steps(&mut window, 5);
    window.key_press(egui::Key::V);
    window.get_by_label("example").click();
    let begun = Instant::now();
    while window.state().link().playback().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no recording");
        steps(&mut window, 1);
    }
    let playback = window.state().link().playback().expect("a recording").clone();
    playback.hold(true);
    let mut pictures: Vec<RgbaImage> = Vec::new();
    for moment in 0..=(playback.length_s() / BETWEEN_S) as usize {
        playback.jump(moment as f64 * BETWEEN_S);
        // Until the dose is computed, and parts that moved are drawn in full.
        steps(&mut window, 40);
        let mut rect = window.get_by_label("View of gland, needle and seeds").rect();
        rect.min.y += BANNER;
        let [x, y, width, height] = [rect.left(), rect.top(), rect.width(), rect.height()].map(|c| c.round() as u32);
        let picture = window.render().expect("a picture");
        let picture = image::imageops::crop_imm(&picture, x, y, width, height).to_image();
        if pictures.last() != Some(&picture) {
            pictures.push(picture);
        }
    }
    pictures
}

fn apart(one: [u8; 3], other: [u8; 3]) -> i32 {
    (0..3).map(|c| i32::from(one[c].abs_diff(other[c])).pow(2)).sum()
}

/// Returns the colours, of those that differ by more than rounding.
fn palette(pictures: &[RgbaImage]) -> Vec<[u8; 3]> {
    let mut counts: HashMap<[u8; 3], u32> = HashMap::new();
    for pixel in pictures.iter().flat_map(|picture| picture.pixels()) {
        let [r, g, b, _] = pixel.0;
        *counts.entry([r, g, b].map(|c| c & !3 | 2)).or_default() += 1;
    }
    let mut colours: Vec<_> = counts.into_iter().collect();
    colours.sort_by_key(|&(colour, count)| (std::cmp::Reverse(count), colour));
    let colours: Vec<[u8; 3]> = colours.into_iter().map(|(colour, _)| colour).collect();
    let (frequent, rare) = colours.split_at(COLOURS[0].min(colours.len()));
    let mut palette = frequent.to_vec();
    let mut off: Vec<i32> = rare
        .iter()
        .map(|r| palette.iter().map(|p| apart(*r, *p)).min().unwrap_or(0))
        .collect();
    for _ in 0..COLOURS[1].min(rare.len()) {
        let farthest = (0..rare.len()).max_by_key(|&n| off[n]).unwrap_or(0);
        palette.push(rare[farthest]);
        for (off, colour) in off.iter_mut().zip(rare) {
            *off = (*off).min(apart(*colour, rare[farthest]));
        }
    }
    palette
}

/// Returns the place and size of the part that differs.
fn changed(before: &[u8], now: &[u8], width: usize) -> [usize; 4] {
    let differing = || (0..now.len()).filter(|&n| before[n] != now[n]);
    let [left, right] = [
        differing().map(|n| n % width).min(),
        differing().map(|n| n % width).max(),
    ];
    let [top, bottom] = [differing().min(), differing().max()].map(|n| n.unwrap_or(0) / width);
    let (left, right) = (left.unwrap_or(0), right.unwrap_or(0));
    [left, top, right - left + 1, bottom - top + 1]
}

fn write(pictures: &[RgbaImage], file: &Path) -> Result<(), png::EncodingError> {
    let palette = palette(pictures);
    let mut nearest: HashMap<[u8; 3], u8> = HashMap::new();
    let mut index = |[r, g, b, _]: [u8; 4]| {
        let nearest_to = |&n: &usize| apart(palette[n], [r, g, b]);
        let find = || (0..palette.len()).min_by_key(nearest_to).unwrap_or(0) as u8;
        *nearest.entry([r, g, b]).or_insert_with(find)
    };
    let indexed: Vec<Vec<u8>> = pictures
        .iter()
        .map(|p| p.pixels().map(|pixel| index(pixel.0)).collect())
        .collect();
    let (width, height) = pictures[0].dimensions();
    let mut encoder = png::Encoder::new(std::fs::File::create(file)?, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(palette.concat());
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(indexed.len() as u32, 0)?;
    let mut writer = encoder.write_header()?;
    for (n, picture) in indexed.iter().enumerate() {
        let is_last = n + 1 == indexed.len();
        let (numerator, denominator) = if is_last {
            (LAST_S, 1)
        } else {
            (1, (1.0 / BETWEEN_S) as u16)
        };
        writer.set_frame_delay(numerator, denominator)?;
        let [left, top, wide, high] = match n.checked_sub(1) {
            Some(before) => changed(&indexed[before], picture, width as usize),
            None => [0, 0, width as usize, height as usize],
        };
        writer.set_frame_dimension(1, 1)?;
        writer.set_frame_position(left as u32, top as u32)?;
        writer.set_frame_dimension(wide as u32, high as u32)?;
        let rows = picture.chunks(width as usize).skip(top).take(high);
        let part: Vec<u8> = rows.flat_map(|row| &row[left..left + wide]).copied().collect();
        writer.write_image_data(&part)?;
    }
    writer.finish()
}

#[test]
#[ignore = "writes the animation of the README"]
fn the_example_is_drawn_as_an_animation() {
    let pictures = pictures();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/pictures/insertion.png");
    write(&pictures, &file).expect("written");
    let bytes = std::fs::metadata(&file).expect("a file").len();
    println!("{}: {} pictures, {bytes} bytes", file.display(), pictures.len());
    assert!(bytes < 1_500_000, "{bytes} bytes");
}
