//! A window compared with its kept picture.

use crate::driven::is_for_docs;
use egui_kittest::{SnapshotError, SnapshotOptions, try_image_snapshot_options};
use image::RgbaImage;
use std::path::Path;
use std::time::{Duration, Instant};

/// Patience, because moving parts are drawn coarser, and a busy machine reaches the picture at rest
/// late.
const PATIENCE: Duration = Duration::from_secs(20);
/// Tile size in pixels.
const TILE: u32 = 40;

/// Looks until the window equals the kept picture; otherwise reports the differing tiles.
pub fn assert_like_kept(name: &str, options: &SnapshotOptions, mut look: impl FnMut() -> RgbaImage) {
    if is_for_docs() {
        return;
    }
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

/// Returns the tiles with the most differing pixels, for a reader who has only this output.
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

/// Returns a tolerance for another version of the software driver, which may round a few edges
/// differently. A moved or missing widget differs by thousands of pixels.
pub fn tolerant() -> SnapshotOptions {
    SnapshotOptions::new().max_failed_pixels(500)
}

/// Reduces the levels of grey, because grain does not compress: the picture is a third as large and
/// looks the same.
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
