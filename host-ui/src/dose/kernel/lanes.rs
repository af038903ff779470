//! The inner loops of the kernel, compiled for each width of vector unit and chosen when the program runs.
//!
//! No product and sum are fused, so every machine gives the same bits.

use super::{BLOCK, Block};
use multiversion::multiversion;

/// How the table is laid out.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    pub rows_per_m: f32,
    pub first_row: f32,
    pub rows: usize,
    pub columns: usize,
    /// Squares of the distances (m²) from and below which the table is used.
    pub squares_m2: [f32; 2],
}

/// One seed, from the same place as the points.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub position_m: [f32; 3],
    pub axis: [f32; 3],
    pub strength_u: f32,
}

const TWO_TO_23: f32 = 8_388_608.0;
const MANTISSA: u32 = 0x007f_ffff;

/// Dose of a seed at the points of a block (Gy); whether some of them lie outside the table and have got a wrong one.
#[multiversion(targets = "simd")]
pub fn doses(table: &[f32], layout: &Layout, seed: &Line, points: &Block, gy: &mut [f32; BLOCK]) -> bool {
    assert!(layout.rows >= 2 && layout.columns >= 2 && table.len() == layout.rows * layout.columns);
    let (p, axis) = (seed.position_m, seed.axis);
    let [nearest, farthest] = layout.squares_m2;
    let (last_row, last_column) = ((layout.rows - 2) as f32, (layout.columns - 2) as f32);
    let two_ends = layout.columns > 91;
    let columns = layout.columns as u32;
    let mut cell = [0_u32; BLOCK];
    let (mut down, mut along_row, mut scale) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK], [0.0_f32; BLOCK]);
    let mut outside = 0_u32;
    for i in 0..BLOCK {
        let (x, y, z) = (points.x_m[i] - p[0], points.y_m[i] - p[1], points.z_m[i] - p[2]);
        let square = x * x + y * y + z * z;
        let along = x * axis[0] + y * axis[1] + z * axis[2];
        // Not from r² and `along`, which leave no digits near the axis.
        let (cx, cy, cz) = (
            y * axis[2] - z * axis[1],
            z * axis[0] - x * axis[2],
            x * axis[1] - y * axis[0],
        );
        let across_square = cx * cx + cy * cy + cz * cz;
        outside |= u32::from(square < nearest) | u32::from(square >= farthest);
        let square = lower(higher(square, nearest), farthest);
        let inverse = 1.0 / square;
        let r = square.sqrt();
        let cosine = lower(along.abs() * (r * inverse), 1.0);
        let deg = angle_deg(cosine, lower(across_square * inverse, 1.0));
        let deg = if two_ends && along < 0.0 { 180.0 - deg } else { deg };
        let row_at = r * layout.rows_per_m - layout.first_row;
        let (row, column) = (whole(row_at, last_row), whole(deg, last_column));
        down[i] = row_at - (row - TWO_TO_23);
        along_row[i] = deg - (column - TWO_TO_23);
        cell[i] = (row.to_bits() & MANTISSA) * columns + (column.to_bits() & MANTISSA);
        scale[i] = seed.strength_u * inverse;
    }
    for i in 0..BLOCK {
        let first = cell[i] as usize;
        // SAFETY: `whole` bounds the row by rows - 2 and the column by columns - 2, whatever number it gets, so the cell and its
        // neighbours to the right, below and below to the right lie in the table, whose length is checked above.
        let at = |offset: usize| unsafe { *table.get_unchecked(first + offset) };
        let near = at(0) + along_row[i] * (at(1) - at(0));
        let (below, below_right) = (at(layout.columns), at(layout.columns + 1));
        let far = below + along_row[i] * (below_right - below);
        gy[i] = (near + down[i] * (far - near)) * scale[i];
    }
    outside != 0
}

/// As one instruction, unlike `f32::max`; the second where the first is not a number.
#[inline(always)]
fn higher(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn lower(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The whole part of a number from 0, at most `most`, plus 2^23: then it stands in the last bits.
///
/// A whole number itself may come out one less; the share that is left is 1 then, which means the same place.
#[inline(always)]
fn whole(value: f32, most: f32) -> f32 {
    lower(higher((value - 0.5) + TWO_TO_23, TWO_TO_23), TWO_TO_23 + most)
}

/// From the cosine (0 to 1) and the square of the sine; Abramowitz and Stegun 4.4.46, wrong by 2e-8 rad at most.
#[inline(always)]
fn angle_deg(cosine: f32, sine_square: f32) -> f32 {
    const TERMS: [f32; 8] = [
        -0.001_262_491_1,
        0.006_670_09,
        -0.017_088_126,
        0.030_891_88,
        -0.050_174_305,
        0.088_978_99,
        -0.214_598_8,
        std::f32::consts::FRAC_PI_2,
    ];
    let mut polynomial = 0.0;
    for term in TERMS {
        polynomial = polynomial * cosine + term;
    }
    // The root of 1 - cosine, with its digits.
    (sine_square / (1.0 + cosine)).sqrt() * polynomial * (180.0 / std::f32::consts::PI)
}
