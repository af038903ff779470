//! A window beside the picture of it that is kept.

use egui_kittest::{SnapshotError, SnapshotOptions, try_image_snapshot_options};
use image::RgbaImage;
use std::path::Path;
use std::time::{Duration, Instant};

/// What moves is drawn coarser, and a busy machine comes late to the picture at rest.
const PATIENCE: Duration = Duration::from_secs(6);
/// Pixels.
const TILE: u32 = 40;

/// Looks until it sees the picture that is kept, and says where it differs if it never does.
pub fn assert_like_kept(name: &str, options: &SnapshotOptions, mut look: impl FnMut() -> RgbaImage) {
    let begun = Instant::now();
    loop {
        let seen = with_fewer_greys(&look(), 51);
        match try_image_snapshot_options(&seen, name, options) {
            Ok(()) => return,
            Err(SnapshotError::Diff { .. }) if begun.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(200));
            }
            Err(error) => panic!("{error}\n{}", where_differing(name, &seen).unwrap_or_default()),
        }
    }
}

/// The tiles with most pixels that differ, for whoever has this output alone.
fn where_differing(name: &str, seen: &RgbaImage) -> Option<String> {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/snapshots/{name}.png"));
    let kept = image::open(place).ok()?.to_rgba8();
    let mut tiles = std::collections::BTreeMap::new();
    for (x, y, pixel) in seen.enumerate_pixels() {
        if kept.get_pixel_checked(x, y).is_none_or(|other| other != pixel) {
            *tiles.entry([x / TILE * TILE, y / TILE * TILE]).or_insert(0_u32) += 1;
        }
    }
    let mut worst: Vec<_> = tiles.into_iter().collect();
    worst.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let words = |&([x, y], count): &([u32; 2], u32)| format!("{count} at {x}, {y}");
    let listed: Vec<_> = worst.iter().take(24).map(words).collect();
    Some(format!(
        "{} tiles of {TILE} by {TILE} differ, pixels in each: {}",
        worst.len(),
        listed.join("; ")
    ))
}

/// Another version of the software driver may round a few edges otherwise; a moved or missing widget is thousands of pixels.
pub fn tolerant() -> SnapshotOptions {
    SnapshotOptions::new().max_failed_pixels(500)
}

/// Grain does not compress: with fewer levels of grey a picture is a third as large and looks the same.
pub fn with_fewer_greys(picture: &RgbaImage, step: u16) -> RgbaImage {
    let mut fewer = picture.clone();
    for pixel in fewer.pixels_mut() {
        let [r, g, b, _] = pixel.0;
        if r.max(g).max(b) - r.min(g).min(b) <= 8 {
            let level = ((u16::from(g) + step / 2) / step * step).min(255) as u8;
            pixel.0[..3].fill(level);
        }
    }
    fewer
}
