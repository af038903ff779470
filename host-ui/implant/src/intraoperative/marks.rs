//! Visible seeds, paired one to one with those in the tissue.

use crate::registration::least_cost;
use nalgebra::Vector3;

/// Distance from every seed beyond which a mark has none, m: the pitch of a strand.
const FAR_M: f64 = 10e-3;

/// Pairs of marks and seeds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// Mark of each seed, and its distance from the seed, m.
    pub of_seeds: Vec<Option<(usize, f64)>>,
    /// Marks without a seed.
    pub without_seed: Vec<usize>,
}

impl Marks {
    /// Returns the pairs of least total square; never pairs farther apart than 10 mm.
    pub fn of(seeds_m: &[[f64; 3]], marks_m: &[[f64; 3]]) -> Self {
        let off_m = |seed: usize, mark: usize| (Vector3::from(seeds_m[seed]) - Vector3::from(marks_m[mark])).norm();
        let cost = |seed: usize, mark: usize| off_m(seed, mark).min(FAR_M).powi(2);
        let pairs = least_cost(seeds_m.len(), marks_m.len(), &cost);
        let near = |(seed, mark): (usize, Option<usize>)| {
            let mark = mark?;
            Some((mark, off_m(seed, mark))).filter(|(_, off_m)| *off_m < FAR_M)
        };
        let of_seeds: Vec<Option<(usize, f64)>> = pairs.into_iter().enumerate().map(near).collect();
        let is_free = |mark: &usize| of_seeds.iter().flatten().all(|(of, _)| of != mark);
        Self {
            without_seed: (0..marks_m.len()).filter(is_free).collect(),
            of_seeds,
        }
    }

    /// Returns the number of seeds without a mark.
    pub fn without_mark(&self) -> usize {
        self.of_seeds.iter().filter(|mark| mark.is_none()).count()
    }

    /// Returns mean and largest distance of a mark from its seed, m; `None` without a pair.
    pub fn residuals_m(&self) -> Option<[f64; 2]> {
        let off = || self.of_seeds.iter().flatten().map(|(_, off_m)| *off_m);
        let most = off().reduce(f64::max)?;
        Some([off().sum::<f64>() / off().count() as f64, most])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_find_their_seeds() {
        let seeds: Vec<[f64; 3]> = (0..4).map(|n| [0.01 * f64::from(n), 0.0, 0.05]).collect();
        // In reverse, 2 mm off; the third seed is invisible, and a calcification is mistaken for
        // one.
        let mut marks: Vec<[f64; 3]> = seeds.iter().rev().map(|p| [p[0], p[1] + 2e-3, p[2]]).collect();
        marks.remove(1);
        marks.push([0.01, 0.04, 0.05]);
        let found = Marks::of(&seeds, &marks);
        let of: Vec<Option<usize>> = found.of_seeds.iter().map(|mark| mark.map(|(n, _)| n)).collect();
        assert_eq!(of, [Some(2), Some(1), None, Some(0)]);
        assert_eq!((found.without_mark(), found.without_seed.as_slice()), (1, &[3][..]));
        let [mean, worst] = found.residuals_m().expect("three pairs");
        assert!((mean - 2e-3).abs() < 1e-12 && (worst - 2e-3).abs() < 1e-12);
        let none = Marks::of(&seeds, &[]);
        assert_eq!((none.without_mark(), none.residuals_m()), (4, None));
    }

    /// Guards against nearest pairs first, which would give a mark between two seeds to the nearer
    /// one and leave a seed without.
    #[test]
    fn one_mark_does_not_take_the_seed_of_another() {
        let along = |mm: f64| [0.0, 0.0, mm * 1e-3];
        let found = Marks::of(&[along(0.0), along(10.0)], &[along(5.1), along(15.5)]);
        assert_eq!(
            found.of_seeds.iter().flatten().map(|(n, _)| *n).collect::<Vec<_>>(),
            [0, 1]
        );
    }
}
