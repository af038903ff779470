//! The inner loops of the kernel, compiled for each width of vector unit and selected at run time.
//!
//! Products and sums are not fused, so every machine gives the same bits.

use super::table::{CM2_PER_M2, Table};
use super::{BLOCK, Block};
use multiversion::multiversion;

/// One seed, relative to the same place as the points.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub position_m: [f32; 3],
    pub axis: [f32; 3],
    pub strength_u: f32,
}

/// Constant that rounds: adding and subtracting 3 * 2^-8 rounds a number below 2^-8 to 2^-30, its
/// own last place, and larger ones to a multiple of that.
const ROUNDER_GY: f32 = 3.0 / 256.0;
/// Constant that extracts the whole part: added to a number above 0.5, it leaves that part in the
/// last bits. The remaining share is 1 where it might be 0.
const WHOLE: f32 = TWO_TO_23 - 0.5;
const TWO_TO_23: f32 = 8_388_608.0;
const MANTISSA: u32 = 0x007f_ffff;

/// Computes the dose of a seed at the points of a block (Gy). Returns whether some of them lie
/// outside the table, whose values are then wrong.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.2",
    "aarch64+neon"
))]
pub fn doses(table: &Table, seed: &Line, points: &Block, gy: &mut [f32; BLOCK]) -> bool {
    let (p, axis) = (seed.position_m, seed.axis);
    let (entries, columns, share_bits) = (table.entries(), table.columns as u32, table.share_bits);
    let most = table.last_key - table.first_key - 1;
    assert!(columns >= 2 && entries.len() == ((most >> share_bits) as usize + 2) * table.columns);
    let last_column = TWO_TO_23 + (columns - 2) as f32;
    let half_turn = table.half_turn.unwrap_or(0.0);
    let mut cell = [0_u32; BLOCK];
    let (mut down, mut along_row, mut scale) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK], [0.0_f32; BLOCK]);
    let mut outside = 0;
    for i in 0..BLOCK {
        let (x, y, z) = (points.x_m[i] - p[0], points.y_m[i] - p[1], points.z_m[i] - p[2]);
        let square = x * x + y * y + z * z;
        let along = x * axis[0] + y * axis[1] + z * axis[2];
        // Not from r² and `along`, which would lose all digits near the axis.
        let (cx, cy, cz) = (
            y * axis[2] - z * axis[1],
            z * axis[0] - x * axis[2],
            x * axis[1] - y * axis[0],
        );
        let inverse = 1.0 / square.sqrt();
        let sine = (cx * cx + cy * cy + cz * cz).sqrt() * inverse;
        let at = angle(along.abs() * inverse, sine) * table.columns_per_rad;
        let at = if table.half_turn.is_some() && along < 0.0 {
            half_turn - at
        } else {
            at
        };
        let column = lower(higher(at + WHOLE, TWO_TO_23), last_column);
        along_row[i] = at - (column - TWO_TO_23);

        let past = (square * CM2_PER_M2).to_bits().wrapping_sub(table.first_key) as i32;
        let key = past.max(0).min(most as i32);
        outside |= past ^ key;
        let key = key as u32;
        // As the digits of a number from 1 to 2.
        let share = ((key << (23 - share_bits)) & MANTISSA) | 1.0_f32.to_bits();
        down[i] = f32::from_bits(share) - 1.0;
        cell[i] = (key >> share_bits) * columns + (column.to_bits() & MANTISSA);
        scale[i] = seed.strength_u * (inverse * inverse);
    }
    for i in 0..BLOCK {
        let first = cell[i] as usize;
        // SAFETY: `key` lies in a row before the last and `column` before the last one, for any
        // input. So the cell and its neighbours to the right, below and below to the right are
        // entries, whose number is checked above.
        let pair = |at: usize| unsafe { entries.as_ptr().add(at).cast::<u64>().read_unaligned() };
        let [left, right] = halves(pair(first));
        let near = left + along_row[i] * (right - left);
        let [left, right] = halves(pair(first + columns as usize));
        let far = left + along_row[i] * (right - left);
        gy[i] = (near + down[i] * (far - near)) * scale[i];
    }
    outside != 0
}

/// Adds doses, rounded.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.2",
    "aarch64+neon"
))]
pub fn add_rounded(gy: &[f32; BLOCK], sum_gy: &mut [f64; BLOCK]) {
    for (sum, gy) in sum_gy.iter_mut().zip(gy) {
        *sum += f64::from((gy + ROUNDER_GY) - ROUNDER_GY);
    }
}

/// Splits two entries that were loaded as one number.
#[inline(always)]
fn halves(pair: u64) -> [f32; 2] {
    bytemuck::cast(pair)
}

/// Returns the larger number as one instruction, unlike `f32::max`; the second if the first is NaN.
#[inline(always)]
fn higher(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn lower(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns the angle (rad, 0 to a quarter turn) from its cosine and sine: acos(c) / sqrt(1 - c²) as
/// a polynomial, with an error of 2.4e-6 rad at most.
#[inline(always)]
fn angle(cosine: f32, sine: f32) -> f32 {
    const TERMS: [f32; 7] = [
        0.049_507_12,
        -0.214_407_23,
        0.440_749,
        -0.626_952_2,
        0.780_058,
        -0.999_724_4,
        1.570_794,
    ];
    let mut polynomial = 0.0;
    for term in TERMS {
        polynomial = polynomial * cosine + term;
    }
    sine * polynomial
}
