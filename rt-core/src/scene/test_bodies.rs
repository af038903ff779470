//! Small bodies that the tests of scene and tissue share.

use super::Labels;

fn labels(dims: [usize; 3], is_tissue: impl Fn([usize; 3]) -> bool) -> Labels {
    let [nx, ny, _] = dims;
    let cell = |n: usize| [n % nx, n / nx % ny, n / (nx * ny)];
    let count = dims.iter().product();
    Labels {
        dims,
        spacing_m: 1.5e-3,
        cells: (0..count).map(|n| u8::from(is_tissue(cell(n)))).collect(),
        structures: Vec::new(),
    }
}

pub fn block(dims: [usize; 3]) -> Labels {
    labels(dims, |_| true)
}

/// A block with a tunnel through it along z and a notch in its side: neither convex nor simply connected.
pub fn with_hole() -> Labels {
    labels([14, 12, 10], |[i, j, k]| {
        let tunnel = (5..9).contains(&i) && (4..8).contains(&j);
        let notch = i < 6 && (3..7).contains(&k) && j < 3;
        !tunnel && !notch
    })
}

/// A U whose arms meet only at one end: straight lines between them leave the body.
pub fn horseshoe() -> Labels {
    labels([13, 4, 15], |[i, _, k]| k < 4 || !(4..9).contains(&i))
}

pub fn two_parts() -> Labels {
    labels([15, 8, 8], |[i, _, _]| i != 7)
}

/// Cells kept at random, so that every way cubes can meet occurs.
pub fn speckle(seed: u64) -> Labels {
    let mut random = Random(seed);
    let keep: Vec<bool> = (0..9 * 9 * 9).map(|_| random.unit() < 0.6).collect();
    labels([9, 9, 9], |[i, j, k]| keep[i + 9 * j + 81 * k])
}

/// Numbers that look random and are the same on every run (splitmix64).
pub struct Random(pub u64);

impl Random {
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}
