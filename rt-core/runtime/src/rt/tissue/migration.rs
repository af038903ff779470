//! Seeds that migrate along the open track that they lie in (docs/physics.md, *Seeds that migrate*).

use super::TissueLoop;
use crate::rt::seed::Seed;
use nalgebra::Vector3;
use stylet_random::Random;
use stylet_shm_schema::{SEED_LENGTH_M, SEED_RADIUS_M};
use stylet_sim::migration::Migration;

impl Seed {
    /// True if the seed belongs to the share that migrates: chosen by its position, so that each run moves the same
    /// seeds.
    fn migrates(&self, index: usize, share: f64) -> bool {
        let mixed_with = |seed: u64, c: f64| Random(seed.wrapping_add(c.to_bits()));
        let [x, y, z] = self.dropped_at_m;
        let seed = 0x9e37_79b9_7f4a_7c15_u64.wrapping_add(index as u64);
        let seed = [x, y].into_iter().fold(seed, |seed, c| mixed_with(seed, c).draw());
        mixed_with(seed, z).unit() < share
    }
}

impl TissueLoop {
    /// Moves loose migrating seeds back along their tracks with every needle that leaves the tissue.
    pub(super) fn migrate(&mut self) {
        let Migration { share, speed_m_per_s } = self.world.migration;
        if share <= 0.0 || self.state.in_by_line {
            return;
        }
        let by_m = speed_m_per_s * self.period_s;
        for index in 0..self.seeds.len() {
            let is_joined = self
                .seeds
                .get(index + 1)
                .is_some_and(|next| next.strand_pitch_m.is_some());
            let Some(seed) = self.seeds.get(index) else {
                continue;
            };
            let Some(along) = seed
                .track_to_entry
                .filter(|_| seed.strand_pitch_m.is_none() && !is_joined)
            else {
                continue;
            };
            if !seed.migrates(index, share) {
                continue;
            }
            // It stays where it meets the next seed, and where the body ends.
            let by_m = self.room_m(index, along.into()).min(by_m);
            if by_m > 0.0 {
                self.shift_seed(index, along.map(|c| c * by_m));
            }
        }
    }

    /// Returns the way of a seed along its track to the next one, m.
    fn room_m(&self, index: usize, along: Vector3<f64>) -> f64 {
        let body = &self.world.scene.body;
        let place_m = |seed: &Seed| Vector3::from(seed.tip.rest_m(body));
        let own_m = place_m(&self.seeds[index]);
        let to_m = |(_, other): (usize, &Seed)| {
            let off_m = place_m(other) - own_m;
            let ahead_m = off_m.dot(&along);
            let is_in_track = (off_m - along * ahead_m).norm() < 2.0 * SEED_RADIUS_M;
            (is_in_track && ahead_m > 0.0).then_some(ahead_m - SEED_LENGTH_M)
        };
        let others = self.seeds.iter().enumerate().filter(|(number, _)| *number != index);
        others.filter_map(to_m).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_sim::tissue::MaterialPoint;

    /// As many as in patients: 0.47 % of 19,236. Chance expects 90, with its square root as the deviation.
    #[test]
    fn the_share_of_seeds_that_migrates_is_the_one_asked_for() {
        let seed = |n: usize| Seed {
            tip: MaterialPoint::centre(0),
            tail: None,
            axis: [0.0, 0.0, 1.0],
            dropped_at_m: [1e-3 * (n % 131) as f64, 2e-3 * (n % 17) as f64, 1e-2],
            strand_pitch_m: None,
            track_to_entry: None,
        };
        let count = |share: f64| (0..19_236).filter(|&n| seed(n).migrates(n % 128, share)).count();
        let few = count(0.0047);
        println!("{few} of 19,236");
        assert!((60..=120).contains(&few), "{few}");
        assert_eq!((count(0.0), count(1.0)), (0, 19_236));
    }
}
