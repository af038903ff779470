//! Hosts that are killed, stopped, starved, or that flood: the hand does not feel them.

use bytemuck::Zeroable;
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node};
use stylet_shm_schema::*;
use stylet_tests::hand::{Insertion, assert_undisturbed, missed};
use stylet_tests::witness::{STALL, Witness, where_the_machine_runs};
use stylet_tests::{Core, ask, left_behind, program, scratch, until};

/// A host without a window, which attaches to everything and reads it; killed with SIGKILL when dropped.
struct Host(Child);

impl Host {
    fn start(instance: &Instance) -> Self {
        let out = scratch(&format!("host-{}", instance.name())).join("session.mcap");
        let child = Process::new(program("host-ui"))
            .args(["record", "--instance", instance.name(), "--out"])
            .arg(out)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(child.expect("host-ui starts"))
    }

    fn is_running(&mut self) -> bool {
        matches!(self.0.try_wait(), Ok(None))
    }

    fn signal(&self, signal: libc::c_int) {
        // SAFETY: a child of ours that has not been waited for.
        assert_eq!(unsafe { libc::kill(self.0.id() as libc::pid_t, signal) }, 0);
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Ends the core, and checks that nothing is left of it and its hosts.
fn finish(core: Core, hand: Insertion) {
    drop(hand);
    let instance = core.instance.clone();
    core.finish();
    assert_eq!(left_behind(&instance), [""; 0]);
}

const KILLS: usize = 100;
const ROUNDS: usize = 10;
/// Most rounds that may be skipped because the machine was stalled.
const MOST_NOT_JUDGED: usize = 25;
const ROUND: Duration = Duration::from_millis(2500);

/// Runs one round with a living host and one with killed hosts: returns the missed deadlines of each.
fn round(core: &Core, hand: &mut Insertion) -> (u64, u64) {
    let mut host = Host::start(&core.instance);
    hand.watch(Duration::from_millis(500));
    let begin = hand.records.len();
    hand.watch(ROUND);
    let control = missed(&hand.records[begin..]);
    assert!(host.is_running(), "the host ended by itself");
    drop(host);

    hand.watch(Duration::from_millis(500));
    let (begin, since) = (hand.records.len(), Instant::now());
    for kill in 1..=KILLS / ROUNDS {
        let host = Host::start(&core.instance);
        // At all stages of start-up: after 10 to 230 ms.
        let until = since + ROUND * kill as u32 / (KILLS / ROUNDS) as u32;
        let late = Duration::from_millis(240 * (kill as u64 % 7) / 7);
        hand.watch((until - late).saturating_duration_since(Instant::now()));
        drop(host);
    }
    hand.watch((since + ROUND).saturating_duration_since(Instant::now()));
    (control, missed(&hand.records[begin..]))
}

#[test]
fn a_hundred_killed_hosts_cost_no_more_deadlines_than_living_ones() {
    let mut core = Core::start();
    let mut hand = Insertion::begin(&mut core, 0.001);
    let (mut control, mut killed, mut not_judged) = (Vec::new(), Vec::new(), 0);
    // Alternately in the same insertion, since a shared machine has bad seconds anyway.
    while control.len() < ROUNDS && not_judged < MOST_NOT_JUDGED {
        hand.records.clear();
        let witness = Witness::begin();
        let (alive, dead) = round(&core, &mut hand);
        let stall = witness.longest_stall();
        if stall >= STALL {
            not_judged += 1;
            println!(
                "a core stood still for {stall:?}; {alive} deadlines missed with a host, {dead} with kills: not judged"
            );
            ask(&mut hand.link, &Request::Engage).expect("armed, or armed again");
            hand.watch(Duration::from_millis(500));
            continue;
        }
        assert_undisturbed(&hand.records);
        control.push(alive);
        killed.push(dead);
    }
    if control.len() < ROUNDS {
        println!(
            "not measurable here: only {} rounds in which no core stood still",
            control.len()
        );
    }
    let sum = |v: &[u64]| v.iter().sum::<u64>();
    println!("missed deadlines in each round: control {control:?}, {KILLS} kills {killed:?}");
    println!("in all: control {}, with kills {}", sum(&control), sum(&killed));
    assert!(
        sum(&killed) <= sum(&control) || !is_worse(&control, &killed),
        "kills cost deadlines: control {control:?}, killed {killed:?}"
    );
    finish(core, hand);
}

/// One-sided rank-sum test at 1 in 1000: chance alone would hardly rank `b` so far above `a`.
fn is_worse(a: &[u64], b: &[u64]) -> bool {
    let wins: f64 = b
        .iter()
        .flat_map(|y| {
            a.iter()
                .map(move |x| f64::from(u8::from(y > x)) + 0.5 * f64::from(u8::from(y == x)))
        })
        .sum();
    let (n, m) = (a.len() as f64, b.len() as f64);
    (wins - n * m / 2.0) / (n * m * (n + m + 1.0) / 12.0).sqrt() > 3.09
}

#[test]
fn the_rank_test_separates_worse_from_chance() {
    assert!(is_worse(
        &[0, 1, 2, 1, 0, 3, 1, 0, 2, 1],
        &[5, 4, 6, 9, 4, 5, 7, 8, 6, 4]
    ));
    assert!(!is_worse(
        &[0, 1, 2, 1, 0, 3, 1, 0, 2, 9],
        &[1, 4, 0, 2, 1, 5, 0, 1, 2, 3]
    ));
}

#[test]
fn stopped_and_starved_hosts_are_not_felt_and_go_on_by_themselves() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.004);
        let mut host = Host::start(&core.instance);
        hand.watch(Duration::from_secs(1));
        host.signal(libc::SIGSTOP);
        // Starved as well: every core has work of normal priority, twice.
        let cores = std::thread::available_parallelism().map_or(2, |n| n.get());
        let burners: Vec<Host> = (0..2 * cores)
            .map(|_| {
                Host(
                    Process::new("sh")
                        .args(["-c", "while :; do :; done"])
                        .spawn()
                        .expect("sh"),
                )
            })
            .collect();
        hand.watch(Duration::from_secs(3));
        drop(burners);
        host.signal(libc::SIGCONT);
        hand.watch(Duration::from_secs(1));
        assert!(host.is_running(), "the host did not survive being stopped");
        // The core's queue holds 12 s: a host suspended for 3 s has lost nothing.
        host.signal(libc::SIGINT);
        let ended = host.0.wait().expect("ours");
        assert_eq!(ended.code(), Some(0), "a recording without gaps ends without an error");
        assert_undisturbed(&hand.records);
        assert_eq!(hand.link.state().expect("live").records_lost, 0);
        finish(core, hand);
    });
}

/// Sends as fast as it can for some time; returns how many the queue accepted.
fn flood(instance: &Instance, time: Duration, mut next: impl FnMut(u64) -> Command) -> u64 {
    let node = Node::join(instance).expect("same user");
    let port = service::commands::publisher(&node).expect("a free place");
    let (begun, mut sent) = (Instant::now(), 0);
    while begun.elapsed() < time {
        sent += u64::from(port.send(next(sent)).is_ok());
    }
    sent
}

#[test]
fn the_operator_can_release_under_a_flood_that_disturbs_no_loop() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.004);
        hand.press();
        let instance = core.instance.clone();
        let plan = |host: u64, id: u64| {
            let id_of_change = ParameterId::MembranePeak;
            let value = 5.0 + (id % 10) as f64 * 0.01;
            let change = ParameterChange {
                id: id_of_change,
                value,
            };
            Request::SetParameters(vec![change]).encode(host, id).expect("fits")
        };
        let begin = |host: u64, seconds: u64| {
            let instance = instance.clone();
            std::thread::spawn(move || flood(&instance, Duration::from_secs(seconds), |id| plan(host, id)))
        };
        // A host that joined between two flooding ones: its queue is read after one of theirs.
        let first = begin(77, 4);
        hand.watch(Duration::from_millis(500));
        let mut another = core.host();
        let second = begin(78, 3);
        hand.watch(Duration::from_millis(1500));
        let mark = Request::Mark(Mark {
            text: "seen".to_owned(),
            before_s: 0.0,
        });
        let asked = Instant::now();
        ask(&mut another, &mark).expect("a request of another host is taken");
        println!("marked for another host in {:?}, under a flood", asked.elapsed());
        drop(another);
        let asked = Instant::now();
        ask(&mut hand.link, &Request::Disengage).expect("a release is never refused");
        println!("released {:?} after it was asked, under a flood", asked.elapsed());
        assert!(hand.watch_until(Duration::from_secs(10), |_| first.is_finished() && second.is_finished()));
        let sent = first.join().expect("ours") + second.join().expect("ours");
        hand.watch(Duration::from_millis(500));
        let session = *hand.link.session().expect("live");
        println!("{sent} commands sent in 4 s, {} refused", session.refused);
        assert!(sent > 10_000 && session.refused > 1000, "{sent} {}", session.refused);
        stylet_tests::hand::assert_smooth(&hand.records);
        assert!(hand.records.iter().all(|r| r.fault == 0));
        assert_eq!(stylet_tests::hand::force_n(hand.records.last().expect("records")), 0.0);
        assert_eq!(hand.link.state().expect("live").records_lost, 0);
        finish(core, hand);
    });
}

#[test]
fn ten_thousand_invalid_commands_are_all_refused_and_counted() {
    where_the_machine_runs(|| {
        const COUNT: u64 = 10_000;
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.003);
        let before = hand.link.session().expect("live").refused;
        let parameters = hand.link.parameters().expect("live").generation;
        let node = Node::join(&core.instance).expect("same user");
        let port = service::commands::publisher(&node).expect("a free place");
        let mut random = stylet_random::Random(1);
        for n in 0..COUNT {
            let mut command = Command::zeroed();
            for word in bytemuck::cast_slice_mut::<u8, u64>(bytemuck::bytes_of_mut(&mut command)) {
                *word = random.draw();
            }
            // Half of them with a valid kind and invalid values.
            if n % 2 == 0 {
                let value = f64::from_bits(random.draw() | 0x7ff0_0000_0000_0000);
                let id = ParameterId::ForceScale;
                let change = ParameterChange { id, value };
                command = Request::SetParameters(vec![change])
                    .encode(random.draw(), random.draw())
                    .expect("fits");
            } else {
                command.kind |= 1 << 31;
            }
            // Each must arrive: repeated if the queue is full.
            while port.send(command).expect("sent") == 0 {
                hand.watch(Duration::from_millis(2));
            }
            // No faster than the queue of 64 is read: each must be counted.
            if n % 32 == 31 {
                hand.watch(Duration::from_millis(8));
            }
        }
        hand.watch(Duration::from_millis(500));
        let refused = hand.link.session().expect("live").refused - before;
        println!("{refused} of {COUNT} refused");
        assert!(core.is_running());
        assert_eq!(refused, COUNT);
        assert_eq!(
            hand.link.parameters().expect("live").generation,
            parameters,
            "an invalid command changed a parameter"
        );
        assert_undisturbed(&hand.records);
        drop((port, node));
        finish(core, hand);
    });
}

/// The second of two changes in flight used to start from the set in force, and undid the first.
#[test]
fn two_changes_of_parameters_sent_at_once_are_both_in_force() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let changes = [(ParameterId::MembranePeak, 4.5), (ParameterId::CuttingForce, 1.25)];
        let sent = changes.map(|(id, value)| {
            let request = Request::SetParameters(vec![ParameterChange { id, value }]);
            link.send(&request).expect("sent")
        });
        let mut accepted = Vec::new();
        until(Duration::from_secs(5), || {
            link.poll();
            accepted.extend(
                sent.iter()
                    .filter_map(|&id| link.reply(id))
                    .map(|answer| answer.is_ok()),
            );
            accepted.len() == 2
        });
        assert_eq!(accepted, [true, true]);
        until(Duration::from_secs(1), || {
            link.poll();
            link.parameters().is_some_and(|p| p.generation == 3)
        });
        let set = link.parameters().expect("live").set;
        for (id, value) in changes {
            assert_eq!(set.get(id), value, "{}", id.spec().key);
        }
        drop(link);
        core.finish();
    });
}
