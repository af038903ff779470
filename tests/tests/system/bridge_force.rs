//! Force on the hand while bridges are killed and stopped, against two undisturbed insertions of the same recorded
//! motion: it differs from them no more than they differ from each other.

use crate::wall::{bridge, send};
use nalgebra::Vector3;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use stylet_host::link::LinkStatus;
use stylet_shm_schema::{Request, TickRecord};
use stylet_tests::hand::{Insertion, assert_undisturbed, force_n};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, program, repeats, scratch};

const M_PER_S: f64 = 0.002;
/// Forces are compared by the position of the tip, in pieces of this length, m.
const PIECE_M: f64 = 1e-4;
/// Length of an insertion's path, m.
const LONGEST_M: f64 = 0.055;
/// Approximate length of a round: a stopped bridge is replaced after 0.4 s.
const ROUND_S: f64 = 0.8;

/// Time for which the recorded hand stands before the body: its line is solved for meanwhile.
const STANDS: Duration = Duration::from_secs(6);

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

/// Writes the motion of a hand that inserts a needle for that time: it needs no host, as a person's hand needs none.
fn record_motion(time: Duration, speed_m_per_s: f64, file: &Path) {
    let session = file.with_extension("mcap");
    let mut core = Core::start();
    let mut hand = Insertion::begin(&mut core, speed_m_per_s);
    hand.go(-0.005, 0.1);
    hand.watch(Duration::from_secs(1));
    let host_ui = |arguments: &[&str]| {
        let mut command = Command::new(program("host-ui"));
        command.args(arguments);
        command
    };
    let [session, motion] = [&session, file].map(|path| path.display().to_string());
    let seconds = time.as_secs_f64().to_string();
    let instance = core.instance.name().to_owned();
    let mut recorder = host_ui(&[
        "record",
        "--instance",
        &instance,
        "--out",
        &session,
        "--duration",
        &seconds,
    ])
    .spawn()
    .expect("host-ui starts");
    hand.watch(STANDS);
    hand.go(LONGEST_M, speed_m_per_s);
    hand.watch(time.saturating_sub(STANDS));
    assert!(recorder.wait().expect("ours").success());
    drop(hand);
    core.finish();
    let exported = host_ui(&["export", &session, "--motion", &motion]).status();
    assert!(exported.expect("host-ui starts").success());
}

/// Returns the forces of the recorded insertion in which the bridge is killed or stopped that often, or left alone.
fn insertion(rounds: u64, motion: &Path, is_disturbed: bool) -> Vec<f64> {
    let device = format!("replay:{}", motion.display());
    let mut core = Core::start_with(&["--rt-if-allowed", "--device", &device]);
    let mut link = core.host();
    ask(&mut link, &Request::Engage).expect("engaged");
    let mut hand = Insertion::of(link);
    hand.watch(STANDS);
    // Those from before the force was turned on.
    hand.records.clear();
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
    hand.watch(length(rounds).saturating_sub(begun.elapsed()));
    assert_undisturbed(&hand.records);
    let forces = forces(&hand.records);
    drop(hand);
    core.finish();
    forces
}

fn length(rounds: u64) -> Duration {
    Duration::from_secs_f64(2.0 * rounds as f64 * ROUND_S + 2.0)
}

/// Insertions of one kind differ by chance as well: to be interpreted by a reader, not run each day.
#[test]
#[ignore = "a measurement: make wall"]
fn killed_bridges_change_forces_no_more_than_chance_does() {
    let rounds = repeats("STYLET_BRIDGE_FORCE_ROUNDS", 2);
    let speed_m_per_s = M_PER_S.min(LONGEST_M / length(rounds).as_secs_f64());
    let motion = scratch("bridge-force").join("a.motion");
    where_the_machine_runs(|| {
        record_motion(length(rounds) + 2 * STANDS, speed_m_per_s, &motion);
        let [disturbed, one, other] = [true, false, false].map(|is| insertion(rounds, &motion, is));
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
