//! The simulated ultrasound of the slices: brightness of each cell, and the grain that moves with
//! its material.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use stylet_imaging::{OUTSIDE, brightness};
use stylet_shm_schema::SceneHeader;

/// Side of the cube of grain, which repeats.
pub const GRAINS: usize = 64;
/// Amplitude of the brightest texel; the mean is 1.
pub const LARGEST_AMPLITUDE: f32 = 4.0;
/// Edges of a texel of grain along patient right, anterior and superior: finer along the beam,
/// which starts in the rectum, as ultrasound resolves.
pub const GRAIN_M: [f32; 3] = [0.42e-3, 0.24e-3, 0.42e-3];

/// Returns the number of empty cells around the labels, which fill their grid from face to face.
/// The graphics card repeats the outermost cell to the edge of the picture, so it must not shine
/// for an edge within the labels.
pub fn border_cells(spacing_m: f64) -> usize {
    // Labels finer than any image would need more; a number from shared memory must not request all
    // of the card.
    (REACH_M / spacing_m).ceil().min(64.0) as usize + 1
}

/// Returns the brightness of every cell of a scene's labels, with an empty border, as bytes; and
/// its size.
pub fn brightness_volume(scene: &SceneHeader, labels: &[u8]) -> ([usize; 3], Vec<u8>) {
    let byte = |value: f32| (value * 255.0).round() as u8;
    let mut of_label = [byte(OUTSIDE); 256];
    for (slot, structure) in of_label[1..].iter_mut().zip(scene.structures()) {
        *slot = byte(brightness(structure));
    }
    let inner = scene.labels.dims.map(|d| d as usize);
    let border = border_cells(scene.labels.spacing_m);
    let dims = inner.map(|d| d + 2 * border);
    let mut volume = vec![of_label[0]; dims.iter().product()];
    for (row, cells) in labels.chunks_exact(inner[0].max(1)).enumerate() {
        let (y, z) = (row % inner[1] + border, row / inner[1] + border);
        let start = (z * dims[1] + y) * dims[0] + border;
        for (slot, &label) in volume[start..].iter_mut().zip(cells) {
            *slot = of_label[usize::from(label)];
        }
    }
    (dims, volume)
}

/// Level of the brightest texel with edges.
pub const LARGEST_LEVEL: f32 = 1.55;
/// Strength of the echo where tissue meets other tissue along the beam, as a share of their
/// difference, and its distance to both sides.
const SHINE: f32 = 0.55;
const REACH_M: f64 = 0.8e-3;

/// Returns a volume of brightness with the edges that the beam meets; `beam` is its direction, a
/// unit vector in the scene.
pub fn with_edges(volume: &[u8], dims: [usize; 3], spacing_m: f64, beam: [f64; 3]) -> Vec<u8> {
    let reach = beam.map(|c| c * REACH_M / spacing_m);
    let level = |n: usize| {
        let at = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
        let side = |sign: f64| interpolated(volume, dims, [0, 1, 2].map(|a| at[a] as f64 + sign * reach[a]));
        f32::from(volume[n]) + SHINE * (side(1.0) - side(-1.0)).abs()
    };
    (0..volume.len())
        .map(|n| (level(n) / LARGEST_LEVEL).round() as u8)
        .collect()
}

/// Interpolates between centres of cells, like the graphics card; outside, takes the nearest.
fn interpolated(volume: &[u8], dims: [usize; 3], place: [f64; 3]) -> f32 {
    let inside = [0, 1, 2].map(|a| place[a].clamp(0.0, (dims[a] - 1) as f64));
    let low = inside.map(|c| c as usize);
    let part = [0, 1, 2].map(|a| (inside[a] - low[a] as f64) as f32);
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight: f32 = (0..3)
            .map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] })
            .product();
        // Along most beams most corners have no weight.
        if weight > 0.0 {
            let [x, y, z] = [0, 1, 2].map(|a| low[a] + step[a]);
            sum += weight * f32::from(volume[(z * dims[1] + y) * dims[0] + x]);
        }
    }
    sum
}

/// Returns amplitudes of fully developed speckle (Rayleigh), each correlated with its neighbours,
/// mean 1; always the same.
pub fn grain() -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(0x5712);
    let [real, imaginary] = [(); 2].map(|()| {
        let count = GRAINS * GRAINS * GRAINS;
        let mut part: Vec<f32> = (0..count).map(|_| StandardNormal.sample(&mut random)).collect();
        (0..3).for_each(|axis| blur(&mut part, axis));
        part
    });
    let amplitudes: Vec<f32> = real.iter().zip(&imaginary).map(|(a, b)| a.hypot(*b)).collect();
    let mean = amplitudes.iter().sum::<f32>() / amplitudes.len() as f32;
    let byte = |a: &f32| (a / mean / LARGEST_AMPLITUDE * 255.0).round().min(255.0) as u8;
    amplitudes.iter().map(byte).collect()
}

/// Blurs the cube along one axis by a quarter, a half, a quarter, periodically.
fn blur(cube: &mut [f32], axis: usize) {
    let step = GRAINS.pow(axis as u32);
    let old = cube.to_vec();
    for (n, value) in cube.iter_mut().enumerate() {
        let at = n / step % GRAINS;
        let beside = |by: usize| old[n - at * step + (at + by) % GRAINS * step];
        *value = 0.5 * old[n] + 0.25 * (beside(1) + beside(GRAINS - 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::{Text, role};

    #[test]
    fn grain_is_rayleigh_and_seamless() {
        let grain: Vec<f64> = grain()
            .iter()
            .map(|&b| f64::from(b) * f64::from(LARGEST_AMPLITUDE) / 255.0)
            .collect();
        let mean = grain.iter().sum::<f64>() / grain.len() as f64;
        let square = grain.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / grain.len() as f64;
        assert!((mean - 1.0).abs() < 0.01, "{mean}");
        // Mean over standard deviation of a Rayleigh distribution is 1.91.
        assert!((mean / square.sqrt() - 1.913).abs() < 0.05, "{}", mean / square.sqrt());
        let step = |a: usize, b: usize| {
            (0..GRAINS)
                .map(|k| (grain[k * 4096 + a] - grain[k * 4096 + b]).abs())
                .sum::<f64>()
        };
        assert!(step(0, GRAINS - 1) < 2.0 * step(10, 11), "the seam is no edge");
    }

    /// Checks a step from 51 to 204 along y: its neighbours shine by 0.55 of the difference if the
    /// beam goes along y.
    #[test]
    fn tissue_shines_where_the_beam_meets_other_tissue() {
        let dims = [3, 6, 2];
        let volume: Vec<u8> = (0..36).map(|n| if n / 3 % 6 < 3 { 51 } else { 204 }).collect();
        let shines = with_edges(&volume, dims, 0.8e-3, [0.0, 1.0, 0.0]);
        let dull = with_edges(&volume, dims, 0.8e-3, [0.0, 0.0, -1.0]);
        let level = |bytes: &[u8], y: usize| f32::from(bytes[y * 3 + 1]) * LARGEST_LEVEL;
        for (y, rest) in [51.0, 51.0, 51.0, 204.0, 204.0, 204.0].into_iter().enumerate() {
            let edge = if y == 2 || y == 3 { 0.55 * 153.0 } else { 0.0 };
            assert!(
                (level(&shines, y) - rest - edge).abs() < 0.8,
                "{y}: {}",
                level(&shines, y)
            );
            assert!((level(&dull, y) - rest).abs() < 0.8, "{y}: {}", level(&dull, y));
        }
    }

    #[test]
    fn cells_keep_their_place_inside_an_empty_border() {
        let mut scene = SceneHeader::zeroed();
        (scene.labels.dims, scene.labels.spacing_m) = ([2, 1, 2], 1e-3);
        scene.structure_count = 2;
        (scene.structures[0].role, scene.structures[0].name) = (role::TARGET, Text::new("gland"));
        scene.structures[1].name = Text::new("bladder content");
        let (dims, volume) = brightness_volume(&scene, &[1, 0, 2, 1]);
        assert_eq!(dims, [6, 5, 6], "two cells where 0.8 mm reach into the next");
        let at = |x: usize, y: usize, z: usize| volume[(z * 5 + y) * 6 + x];
        let outside = at(0, 0, 0);
        assert_eq!(at(2, 2, 2), 77, "the gland's");
        assert_eq!((at(3, 2, 2), at(2, 2, 3), at(3, 2, 3)), (outside, 5, 77));
    }

    /// Guards against a bright band: a gland that touches the faces of its grid made the last cell
    /// of the volume shine, and the card repeated it to the edge of the picture.
    #[test]
    fn the_faces_of_the_volume_are_dark_for_any_beam() {
        let mut scene = SceneHeader::zeroed();
        scene.labels.dims = [9, 10, 11];
        scene.structure_count = 1;
        (scene.structures[0].role, scene.structures[0].name) = (role::TARGET, Text::new("gland"));
        let beams = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.64, 0.48]];
        for (spacing_m, beam) in [0.2e-3, 0.4e-3, 0.8e-3, 1.36e-3]
            .into_iter()
            .flat_map(|s| beams.map(|b| (s, b)))
        {
            scene.labels.spacing_m = spacing_m;
            let (dims, volume) = brightness_volume(&scene, &[1; 990]);
            let shining = with_edges(&volume, dims, spacing_m, beam);
            let outside = (f32::from(volume[0]) / LARGEST_LEVEL).round() as u8;
            let on_face = |n: usize| {
                let at = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
                (0..3).any(|a| at[a] == 0 || at[a] + 1 == dims[a])
            };
            let faces = (0..shining.len()).filter(|&n| on_face(n));
            let bright = faces.filter(|&n| shining[n] != outside).count();
            assert_eq!(bright, 0, "cells on faces, spacing {spacing_m}, beam {beam:?}");
            let brightest = |cells: &[u8]| f32::from(cells.iter().copied().max().unwrap_or(0));
            let level = brightest(&shining) * LARGEST_LEVEL;
            assert!(level > brightest(&volume) + 2.0, "the gland's edge shines");
        }
    }
}
