//! Attenuation of the body at rest, in cells.
//!
//! Cells of a segmentation show as stairs, because an edge in a radiograph is where a ray touches a
//! surface. So they are divided, and the surface between two tissues is drawn through them again
//! where the blurred tissue has the volume that it had before.

use crate::body::Body;
use nalgebra::Vector3;

/// Most parts of a cell along an axis, and most cells in all: 64 MiB on a graphics card.
const FINER: usize = 2;
const MOST: usize = 16 << 20;
/// Number of times that a tissue is blurred by the mean over a cell's width on both sides.
const BLURS: usize = 3;

/// Attenuation in equal cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Attenuation {
    /// Lower corner of the cells, scene frame, m.
    pub corner_m: Vector3<f64>,
    /// Number of cells along each axis.
    pub dims: [u32; 3],
    /// Side of a cell, m.
    pub spacing_m: f64,
    /// Attenuation in each cell, x fastest, per m.
    pub per_m: Vec<f32>,
}

impl Attenuation {
    /// Returns the cells of the body as they are.
    pub fn of_cells(body: &Body) -> Self {
        let per_m = |&label: &u8| body.tissues[usize::from(label)].xray_per_m;
        Self {
            corner_m: body.corner_m(),
            dims: body.grid.dims,
            spacing_m: body.grid.spacing_m,
            per_m: body.cells.iter().map(per_m).collect(),
        }
    }

    /// Returns finer cells with smooth surfaces, which takes a second.
    pub fn smooth(body: &Body) -> Self {
        let cells = Self::of_cells(body);
        let parts = (1..=FINER).rev().find(|parts| parts.pow(3) * cells.per_m.len() <= MOST);
        let Some(parts) = parts.filter(|&parts| parts > 1) else {
            return cells;
        };
        let mut levels = cells.per_m.clone();
        levels.sort_by(f32::total_cmp);
        levels.dedup();
        let dims = cells.dims.map(|d| d as usize * parts);
        let mut per_m = vec![levels.first().copied().unwrap_or(0.0); dims.iter().product()];
        // Each tissue and all that attenuate more, on what attenuates less.
        for pair in levels.windows(2) {
            let inside: Vec<bool> = cells.per_m.iter().map(|&own| own >= pair[1]).collect();
            let shares = smoothed(&inside, cells.dims.map(|d| d as usize), parts);
            for (sum, share) in per_m.iter_mut().zip(shares) {
                *sum += share * (pair[1] - pair[0]);
            }
        }
        Self {
            dims: dims.map(|d| d as u32),
            spacing_m: cells.spacing_m / parts as f64,
            per_m,
            ..cells
        }
    }
}

/// Returns the share of each part of a cell that lies inside of the smoothed cells.
fn smoothed(inside: &[bool], [nx, ny, nz]: [usize; 3], parts: usize) -> Vec<f32> {
    let dims = [nx * parts, ny * parts, nz * parts];
    let mut shares = Vec::with_capacity(dims.iter().product());
    for (z, y) in (0..dims[2]).flat_map(|z| (0..dims[1]).map(move |y| (z, y))) {
        let row = &inside[(z / parts * ny + y / parts) * nx..][..nx];
        shares.extend((0..dims[0]).map(|x| f32::from(u8::from(row[x / parts]))));
    }
    for axis in (0..3).cycle().take(3 * BLURS) {
        blur(&mut shares, dims, axis, parts);
    }
    let count = inside.iter().filter(|inside| **inside).count() * parts.pow(3);
    if count == 0 || count == shares.len() {
        return shares;
    }
    // The level at which as much is inside as before.
    let mut sorted = shares.clone();
    let at = shares.len() - count;
    let level = *sorted.select_nth_unstable_by(at, f32::total_cmp).1;
    let width = (2 * parts + 1) as f32;
    let deviation = (BLURS as f32 * (width * width - 1.0) / 12.0).sqrt();
    // Largest slope of a blurred edge: a part that the surface crosses is inside by a share.
    let slope = 1.0 / (deviation * (2.0 * std::f32::consts::PI).sqrt());
    let share = |value: &f32| (0.5 + (value - level) / slope).clamp(0.0, 1.0);
    shares.iter().map(share).collect()
}

/// Takes the mean over `reach` values on both sides along an axis; beyond the ends the last value
/// continues.
fn blur(values: &mut [f32], dims: [usize; 3], axis: usize, reach: usize) {
    let stride: usize = dims[..axis].iter().product();
    let length = dims[axis];
    let mut line = vec![0.0_f64; length];
    let lines = (0..values.len()).step_by(stride * length);
    for start in lines.flat_map(|first| first..first + stride) {
        for (n, value) in line.iter_mut().enumerate() {
            *value = f64::from(values[start + n * stride]);
        }
        let at = |n: usize| line[n.clamp(reach, length - 1 + reach) - reach];
        let mut sum: f64 = (0..=2 * reach).map(at).sum();
        for n in 0..length {
            values[start + n * stride] = (sum / (2 * reach + 1) as f64) as f32;
            sum += at(n + 2 * reach + 1) - at(n);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tissue;
    use stylet_shm_schema::GridInfo;

    const SIDE: usize = 24;
    const SPACING_M: f64 = 2e-3;

    /// Returns a block of soft tissue (1) up to the faces of the grid, with an oblique rod (2) in it.
    fn body(is_rod: impl Fn(Vector3<f64>) -> bool) -> Body {
        let grid = GridInfo {
            dims: [SIDE as u32; 3],
            reserved: 0,
            origin_m: [0.5 * SPACING_M; 3],
            spacing_m: SPACING_M,
        };
        let middle =
            |n: usize| Vector3::new(n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE).map(|c| (c as f64 + 0.5) * SPACING_M);
        let label = |n| 1 + u8::from(is_rod(middle(n)));
        let mut tissues = [Tissue::COUPLING; 256];
        (tissues[1].xray_per_m, tissues[2].xray_per_m) = (20.0, 100.0);
        Body::new(grid, (0..SIDE.pow(3)).map(label).collect(), tissues).expect("cells of the grid")
    }

    /// Returns whether a place lies in a rod of 5 mm radius.
    fn is_rod(p: Vector3<f64>) -> bool {
        let off = p - Vector3::repeat(0.024);
        let axis = Vector3::new(0.25, 0.4, 1.0).normalize();
        (off - axis * off.dot(&axis)).norm() < 5e-3
    }

    #[test]
    fn a_rod_keeps_its_volume_and_loses_its_stairs() {
        let body = body(is_rod);
        let (cells, smooth) = (Attenuation::of_cells(&body), Attenuation::smooth(&body));
        let wide = FINER * SIDE;
        assert_eq!(smooth.dims, [wide as u32; 3]);
        assert_eq!(
            (smooth.corner_m, smooth.spacing_m),
            (cells.corner_m, SPACING_M / FINER as f64)
        );
        let bone =
            |a: &Attenuation| a.per_m.iter().map(|v| f64::from(v - 20.0) / 80.0).sum::<f64>() * a.spacing_m.powi(3);
        let kept = bone(&smooth) / bone(&cells);
        // Volume at the wrong place, in parts of cells.
        let wrong = |share: &dyn Fn([usize; 3]) -> f64| -> f64 {
            let at = |n: usize| [n % wide, n / wide % wide, n / wide / wide];
            let exact = |at: [usize; 3]| {
                let within = |n: usize| Vector3::new(n % 3, n / 3 % 3, n / 9).map(|c| (c as f64 + 0.5) / 3.0);
                let place = |n| (Vector3::from(at).map(|c| c as f64) + within(n)) * smooth.spacing_m;
                (0..27).filter(|&n| is_rod(place(n))).count() as f64 / 27.0
            };
            let off = |at| (share(at) - exact(at)).abs();
            (0..wide.pow(3)).map(|n| off(at(n))).sum()
        };
        let number = |[x, y, z]: [usize; 3], side: usize| (z * side + y) * side + x;
        let stairs = wrong(&|at| f64::from(cells.per_m[number(at.map(|c| c / FINER), SIDE)] - 20.0) / 80.0);
        let left = wrong(&|at| f64::from(smooth.per_m[number(at, wide)] - 20.0) / 80.0);
        println!("{kept:.4} of the volume; {left:.0} parts at the wrong place, {stairs:.0} before");
        assert!((kept - 1.0).abs() < 0.01, "{kept}");
        assert!(left < 0.3 * stairs, "{left} of {stairs}");
    }

    #[test]
    fn one_tissue_up_to_the_faces_stays_as_it_is() {
        let smooth = Attenuation::smooth(&body(|_| false));
        assert!(smooth.per_m.iter().all(|v| *v == 20.0));
    }
}
