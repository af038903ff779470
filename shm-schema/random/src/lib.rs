//! Random numbers that a seed repeats: SplitMix64 (Steele, Lea and Flood 2014).
//!
//! ```
//! use stylet_random::Random;
//!
//! // The first number of the authors' program from the seed 0.
//! assert_eq!(Random(0).draw(), 0xe220_a839_7b1d_cdaf);
//! assert_eq!(Random(7).unit(), Random(7).unit());
//! ```

/// A generator; its state is the seed at first.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Draws a number of 64 bits.
    pub fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Draws a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.draw() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Draws a number in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Draws a number below `end`; 0 where that is 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.draw() >> 11) as usize % end.max(1)
    }
}
