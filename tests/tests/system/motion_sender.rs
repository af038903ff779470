//! A procedure that is killed or stopped while its needle moves: the hand is at rest within 5 mm and 0.4 s. It went on for 55 mm and 5 s.

use nalgebra::Vector3;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_host::link::Link;
use stylet_shm_schema::{EventKind, TickRecord, flags};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, program, scratch, until};

/// Trials of each kind; `STYLET_TRIALS` makes more.
const TRIALS: usize = 3;
/// Speed of the insertion: the fastest of published ones, mm/s.
const MM_PER_S: &str = "123";
/// At rest is slower than 3 mm/s, as the core has it: over so many ticks less than this, m. Then the spring of the hand lets go of its
/// last tenths of a millimetre, as after each stop.
const REST_TICKS: usize = 50;
const AT_REST_M: f64 = 1.5e-4;
/// A motion that lapsed is given up after these.
const GRACE_TICKS: usize = 300;

/// A program of the test, ended with it.
struct Program(Child);

impl Program {
    fn procedure(core: &Core) -> Self {
        let child = Command::new(program("host-ui"))
            .args([
                "procedure",
                "--instance",
                core.instance.name(),
                "--insert-speed",
                MM_PER_S,
            ])
            .arg("--out")
            .arg(scratch("motion-sender").join("out"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(child.expect("host-ui starts"))
    }

    fn send(&self, signal: libc::c_int) {
        // SAFETY: a child of ours that has not been waited for.
        assert_eq!(unsafe { libc::kill(self.0.id() as libc::pid_t, signal) }, 0);
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What another host saw of the hand.
#[derive(Debug)]
struct Trial {
    /// When its sender ended.
    mm_per_s: f64,
    /// From then on.
    farthest_mm: f64,
    /// Ticks until it was at rest.
    ticks: usize,
    /// It never reached its goal. One that brakes within reach of it arrives, and is not given up.
    was_on_its_way: bool,
}

fn tip(record: &TickRecord) -> Vector3<f64> {
    record.tip_in_scene_m.into()
}

fn now_ns() -> u64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the call only writes to `now`.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Ends the sender of a motion by a signal, so long after it is seen to move.
fn trial(core: &Core, observer: &mut Link, signal: libc::c_int, after: Duration) -> Trial {
    let sender = Program::procedure(core);
    let mut records = Vec::new();
    let mut watch = |limit, ready: &dyn Fn(&[TickRecord]) -> bool| {
        until(limit, || {
            observer.poll();
            records.append(&mut observer.take_records());
            ready(&records)
        })
    };
    watch(Duration::ZERO, &|_| true);
    let moves = |records: &[TickRecord]| {
        let [.., before, _, _, _, _, _, _, _, _, last] = records else {
            return false;
        };
        (tip(last) - tip(before)).norm() > 3e-4 && last.flags & flags::IN_MOTION != 0
    };
    assert!(watch(Duration::from_secs(20), &moves), "the needle does not move");
    watch(after, &|_| false);
    let ended_ns = now_ns();
    sender.send(signal);
    watch(Duration::from_millis(900), &|_| false);
    let last_known = records
        .iter()
        .rposition(|record| record.due_ns <= ended_ns)
        .expect("records");
    let (before, silent) = (
        &records[last_known.saturating_sub(10)..=last_known],
        &records[last_known..],
    );
    let at = tip(&silent[0]);
    Trial {
        mm_per_s: (at - tip(&before[0])).norm() * 1e5,
        farthest_mm: silent.iter().map(|r| (tip(r) - at).norm()).fold(0.0, f64::max) * 1e3,
        was_on_its_way: silent.get(GRACE_TICKS).is_some_and(|r| r.flags & flags::IN_MOTION != 0),
        ticks: silent
            .windows(REST_TICKS)
            .rposition(|w| (tip(&w[REST_TICKS - 1]) - tip(&w[0])).norm() > AT_REST_M)
            .map_or(0, |begin| begin + 1),
    }
}

fn given_up(observer: &Link) -> usize {
    let kind = EventKind::MotionGivenUp as u32;
    observer.events().iter().filter(|event| event.kind == kind).count()
}

#[test]
fn a_hand_whose_sender_ends_or_hangs_is_at_rest_within_5_mm_and_400_ticks() {
    let trials = std::env::var("STYLET_TRIALS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(TRIALS);
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut observer = core.host();
        let mut random = now_ns() | 1;
        for (signal, name) in [(libc::SIGKILL, "killed"), (libc::SIGSTOP, "stopped")] {
            let mut seen = Vec::new();
            for _ in 0..trials {
                random = random
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let after = Duration::from_millis((random >> 33) % 700);
                let known = given_up(&observer);
                let trial = trial(&core, &mut observer, signal, after);
                println!("{name} after {after:?}: {trial:?}");
                assert!(trial.farthest_mm <= 5.0 && trial.ticks <= 400, "{trial:?}");
                if trial.was_on_its_way {
                    assert_eq!(given_up(&observer), known + 1, "hosts hear of it");
                }
                seen.push(trial);
            }
            seen.sort_by(|a, b| a.farthest_mm.total_cmp(&b.farthest_mm));
            let fastest = seen.iter().map(|trial| trial.mm_per_s).fold(0.0, f64::max);
            let ticks = seen.iter().map(|trial| trial.ticks).max();
            let [least, middle, most] = [0, seen.len() / 2, seen.len() - 1].map(|n| seen[n].farthest_mm);
            println!(
                "{name}, {trials} trials: {least:.2} to {most:.2} mm, middle {middle:.2} mm, at most {ticks:?} ticks, from up to {fastest:.0} mm/s"
            );
        }
        drop(observer);
        core.finish();
    });
}
