//! Pairs of placed and planned seeds, and the error of each.

use nalgebra::Vector3;

/// Offset from a planned seed to the seed placed for it, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedOffset {
    /// Vector from the planned place to the place at rest, scene frame.
    pub vector_m: Vector3<f64>,
    /// Component along the needle; positive: deeper than planned.
    pub along_m: f64,
    /// Component across the needle.
    pub across_m: f64,
}

impl SeedOffset {
    /// Computes the offset. `direction` is the unit vector of the needle, into the body.
    pub fn of(planned_m: [f64; 3], placed_m: [f64; 3], direction: [f64; 3]) -> Self {
        let (vector_m, direction) = (
            Vector3::from(placed_m) - Vector3::from(planned_m),
            Vector3::from(direction),
        );
        let along_m = vector_m.dot(&direction);
        Self {
            vector_m,
            along_m,
            across_m: (vector_m - direction * along_m).norm(),
        }
    }

    /// Returns the distance from plan, m.
    pub fn distance_m(&self) -> f64 {
        self.vector_m.norm()
    }
}

/// Returns, for each of `planned` seeds in the order of the drops, the index of its seed among
/// `placed`; `lost` are the numbers of drops that left none.
pub fn in_order(planned: usize, lost: &[usize], placed: usize) -> Vec<Option<usize>> {
    let mut next = 0..placed;
    (0..planned)
        .map(|number| if lost.contains(&number) { None } else { next.next() })
        .collect()
}

/// Returns the same if the order of the drops is unknown. A seed belongs to the nearest planned one
/// from where it was *dropped*, nearest pairs first: a later drift must not change its pair.
pub fn nearest(planned_m: &[[f64; 3]], dropped_at_m: &[[f64; 3]]) -> Vec<Option<usize>> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::with_capacity(planned_m.len() * dropped_at_m.len());
    for (i, target_m) in planned_m.iter().enumerate() {
        for (j, seed_m) in dropped_at_m.iter().enumerate() {
            let gap = Vector3::from(*seed_m) - Vector3::from(*target_m);
            pairs.push((gap.norm(), i, j));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut placed = vec![None; planned_m.len()];
    let mut used = vec![false; dropped_at_m.len()];
    for (_, i, j) in pairs {
        if placed[i].is_none() && !used[j] {
            used[j] = true;
            placed[i] = Some(j);
        }
    }
    placed
}

/// Distance from a planned drop within which a seed that left the tip belongs to it, m. A tip that
/// is held back counts as arrived within 2 mm.
const DROPPED_WITHIN_M: f64 = 2.5e-3;

/// Returns which of the planned drops were made, by the places at which seeds left the needle.
pub fn made(drops_m: &[[f64; 3]], dropped_at_m: &[[f64; 3]]) -> Vec<bool> {
    let seeds = nearest(drops_m, dropped_at_m);
    let is_near = |(drop_m, seed): (&[f64; 3], &Option<usize>)| {
        let seed_m = seed.map(|seed| Vector3::from(dropped_at_m[seed]));
        seed_m.is_some_and(|seed_m| (seed_m - Vector3::from(*drop_m)).norm() <= DROPPED_WITHIN_M)
    };
    drops_m.iter().zip(&seeds).map(is_near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_dropped_in_reverse_find_their_plan_and_drift_is_split() {
        let at = |z: f64| [0.0, 0.0, z];
        assert_eq!(
            nearest(&[at(0.01), at(0.02)], &[at(0.02), at(0.01)]),
            [Some(1), Some(0)]
        );
        assert_eq!(nearest(&[at(0.01), at(0.02)], &[at(0.02)]), [None, Some(0)]);
        let off = SeedOffset::of(at(0.01), [0.003, 0.0, 0.011], [0.0, 0.0, 1.0]);
        assert!((off.along_m - 0.001).abs() < 1e-12 && (off.across_m - 0.003).abs() < 1e-12);
    }

    /// Guards against counting seeds: one dropped by hand elsewhere would leave a planned one out.
    #[test]
    fn drops_are_identified_by_their_places() {
        let at = |z: f64| [0.0, 0.0, z];
        let planned = [at(0.05), at(0.04), at(0.03)];
        let dropped = [at(0.0505), [0.02, 0.0, 0.04], at(0.031)];
        assert_eq!(made(&planned, &dropped), [true, false, true]);
        assert_eq!(made(&planned, &[]), [false; 3]);
    }

    #[test]
    fn a_lost_drop_leaves_its_planned_seed_without_one() {
        assert_eq!(in_order(4, &[1], 2), [Some(0), None, Some(1), None]);
    }
}
