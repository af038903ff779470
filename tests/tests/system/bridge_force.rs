//! Force on the hand while bridges are killed and stopped, against two undisturbed insertions: it differs from them no
//! more than they differ from each other.

use crate::wall::{bridge, send};
use nalgebra::Vector3;
use std::time::{Duration, Instant};
use stylet_host::link::LinkStatus;
use stylet_shm_schema::TickRecord;
use stylet_tests::hand::{Insertion, assert_undisturbed, force_n};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, repeats};

const M_PER_S: f64 = 0.002;
/// Forces are compared by the position of the tip, in pieces of this length, m.
const PIECE_M: f64 = 1e-4;
/// Length of an insertion's path, m.
const LONGEST_M: f64 = 0.055;
/// Approximate length of a round: a stopped bridge is replaced after 0.4 s.
const ROUND_S: f64 = 0.8;

/// Mean force in each piece of the path, N.
fn forces(records: &[TickRecord]) -> Vec<f64> {
    let first = Vector3::from(records[0].tip_in_scene_m);
    let mut sums: Vec<(f64, f64)> = Vec::new();
    for record in records {
        let way_m = (Vector3::from(record.tip_in_scene_m) - first).norm();
        let piece = (way_m / PIECE_M) as usize;
        sums.resize(sums.len().max(piece + 1), (0.0, 0.0));
        sums[piece] = (sums[piece].0 + force_n(record), sums[piece].1 + 1.0);
    }
    sums.into_iter()
        .map(|(sum, count)| sum / f64::max(count, 1.0))
        .collect()
}

/// Returns the forces of an insertion in which the bridge is killed or stopped that often, or left alone for the same
/// time.
fn insertion(rounds: u64, speed_m_per_s: f64, is_disturbed: bool) -> Vec<f64> {
    let mut core = Core::start();
    let mut hand = Insertion::begin(&mut core, speed_m_per_s);
    let begun = Instant::now();
    if is_disturbed {
        for round in 0..2 * rounds {
            let before = bridge(core.id(), None).expect("a bridge");
            send([libc::SIGKILL, libc::SIGSTOP][round as usize % 2], before);
            let is_back = hand.watch_until(Duration::from_secs(10), |link| {
                bridge(core.id(), Some(before)).is_some() && link.status() == LinkStatus::Live
            });
            assert!(is_back, "round {round}: {:?}", hand.link.status());
            hand.watch(Duration::from_millis(300));
        }
    }
    let all = Duration::from_secs_f64(2.0 * rounds as f64 * ROUND_S + 2.0);
    hand.watch(all.saturating_sub(begun.elapsed()));
    assert_undisturbed(&hand.records);
    let forces = forces(&hand.records);
    drop(hand);
    core.finish();
    forces
}

/// Insertions of one kind differ by chance as well: to be interpreted by a reader, not run each day.
#[test]
#[ignore = "a measurement: make wall"]
fn killed_bridges_change_forces_no_more_than_chance_does() {
    let rounds = repeats("STYLET_BRIDGE_FORCE_ROUNDS", 2);
    let speed_m_per_s = M_PER_S.min(LONGEST_M / (2.0 * rounds as f64 * ROUND_S + 2.0));
    where_the_machine_runs(|| {
        let [disturbed, one, other] = [true, false, false].map(|is| insertion(rounds, speed_m_per_s, is));
        let pieces = disturbed.len().min(one.len()).min(other.len());
        let most = |difference: &dyn Fn(usize) -> f64| (0..pieces).map(difference).fold(0.0, f64::max);
        let bound_n = most(&|at| (one[at] - other[at]).abs());
        let outside_n = most(&|at| {
            let (low, high) = (one[at].min(other[at]), one[at].max(other[at]));
            (low - disturbed[at]).max(disturbed[at] - high)
        });
        let peak_n = most(&|at| one[at]);
        println!(
            "{rounds} killed and {rounds} stopped, {:.1} mm at {:.2} mm/s, up to {peak_n:.2} N: undisturbed insertions differ by at most \
             {bound_n:.4} N, the disturbed one leaves what lies between them by at most {outside_n:.4} N",
            pieces as f64 * PIECE_M * 1e3,
            speed_m_per_s * 1e3
        );
        assert!(peak_n > 1.0, "the needle meets nothing");
        assert!(outside_n <= bound_n, "{outside_n} N outside, bound {bound_n} N");
    });
}
