//! Hosts that send as fast as they can: another host's stop and release are in force within 20 ticks.
//!
//! Counted in ticks of the force loop, from the tick in which the request was in its queue to the first that obeyed it.
//! The test shares the machine with the flood, so its own clock would measure the load instead. `make floods` tests
//! 1,000 requests under each flood.

use std::process::{Child, Command as Process, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use stylet_host::link::Link;
use stylet_implant::workflow::move_request;
use stylet_ports::{self as service, Node};
use stylet_shm_schema::*;
use stylet_tests::hand::assert_smooth;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, now_ns, repeats, until};

/// Latest tick at which a stop must be in force.
const MOST_TICKS: usize = 20;
const PROCESSES: usize = 10;
/// Marks a test process as one that floods this instance.
const INSTANCE: &str = "FLOODS_INSTANCE";

/// Identities in the requests of a flood.
#[derive(Clone, Copy, Debug)]
enum Flood {
    OneIdentity,
    NewIdentities,
    TenProcesses,
}

/// Threads or processes that flood until dropped.
struct Flooding {
    is_over: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
    threads: Vec<std::thread::JoinHandle<()>>,
    processes: Vec<Child>,
}

impl Flooding {
    fn begin(flood: Flood, instance: &Instance) -> Self {
        let (is_over, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let mut flooding = Self {
            is_over,
            sent,
            threads: Vec::new(),
            processes: Vec::new(),
        };
        match flood {
            Flood::OneIdentity | Flood::NewIdentities => flooding.threads.push(std::thread::spawn({
                let (instance, is_over, sent) = (instance.clone(), flooding.is_over.clone(), flooding.sent.clone());
                move || send_all(&instance, matches!(flood, Flood::NewIdentities), &is_over, &sent)
            })),
            Flood::TenProcesses => {
                let test = std::env::current_exe().expect("a test knows its own file");
                let process = |_| {
                    let mut process = Process::new(&test);
                    process.args(["--exact", "--ignored", "floods::a_process_that_floods"]);
                    process
                        .env(INSTANCE, instance.name())
                        .stdout(Stdio::null())
                        .stderr(Stdio::null());
                    process.spawn().expect("it starts")
                };
                flooding.processes = (0..PROCESSES).map(process).collect();
            }
        }
        flooding
    }
}

impl Drop for Flooding {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.threads
            .drain(..)
            .for_each(|thread| thread.join().expect("it floods"));
        for mut process in self.processes.drain(..) {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// Sends valid requests as fast as it can; waits if there is no room for another host.
fn send_all(instance: &Instance, has_new_identities: bool, is_over: &AtomicBool, sent: &AtomicU64) {
    let own = 1000 + u64::from(std::process::id());
    while !is_over.load(Ordering::Relaxed) {
        let node = Node::join(instance);
        let port = node.and_then(|node| Ok((service::commands::publisher(&node)?, node)));
        let Ok((port, node)) = port else {
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        while !is_over.load(Ordering::Relaxed) && node.is_current() {
            for _ in 0..64 {
                let id = sent.fetch_add(1, Ordering::Relaxed);
                let value = 5.0 + (id % 10) as f64 * 0.01;
                let change = ParameterChange {
                    id: ParameterId::MembranePeak,
                    value,
                };
                let host = if has_new_identities { own + id } else { own };
                let command = Request::SetParameters(vec![change]).encode(host, id).expect("fits");
                let _ = port.send(command);
            }
        }
    }
}

#[test]
#[ignore = "the program that one of the floods starts ten times"]
fn a_process_that_floods() {
    if let Some(instance) = std::env::var(INSTANCE).ok().and_then(|name| Instance::new(&name).ok()) {
        send_all(&instance, true, &AtomicBool::new(false), &AtomicU64::new(0));
    }
}

/// A host by its ports: it sends from this thread, at a known time.
struct Stopper {
    stops: service::Publisher<Command>,
    commands: service::Publisher<Command>,
    _node: Node,
    asked: u64,
}

impl Stopper {
    fn new(instance: &Instance) -> Self {
        let node = Node::join(instance).expect("same user");
        Self {
            stops: service::stops::publisher(&node).expect("a free place"),
            commands: service::commands::publisher(&node).expect("a free place"),
            _node: node,
            asked: 0,
        }
    }

    /// Sends a request as a link does, and returns the time at which it was queued.
    fn ask(&mut self, request: &Request) -> u64 {
        self.asked += 1;
        let command = request.encode(7, self.asked).expect("fits");
        assert_eq!(self.stops.send(command).expect("sent"), 1);
        let sent_ns = now_ns();
        let _ = self.commands.send(command);
        sent_ns
    }
}

/// The operator, who moves and re-arms after another host's stop.
struct Operator {
    link: Link,
    records: Vec<TickRecord>,
}

impl Operator {
    fn watch_until(&mut self, limit: Duration, ready: impl Fn(&HapticState) -> bool) -> bool {
        until(limit, || {
            self.link.poll();
            self.records.append(&mut self.link.take_records());
            self.link.state().is_some_and(&ready)
        })
    }

    fn watch(&mut self, time: Duration) {
        self.watch_until(time, |_| false);
    }

    /// Repeats a request until the state shows it: a flood of answers may displace one.
    fn set(&mut self, flag: u32, request: &Request) {
        let is_set = (0..20).any(|_| {
            self.link.send(request).expect("sent");
            self.watch_until(Duration::from_millis(500), |state| state.flags & flag != 0)
        });
        assert!(is_set, "{request:?} is not carried out");
    }
}

/// Alternately stops a moving hand and releases the force, under a flood.
fn stops_under(flood: Flood, count: u64) {
    let mut core = Core::start();
    let (link, records) = (core.host(), Vec::new());
    let mut operator = Operator { link, records };
    let mut stopper = Stopper::new(&core.instance);
    let state = operator.link.state().expect("live");
    let (home_m, direction) = (state.tip_in_scene_m, state.needle_direction);
    let flooding = Flooding::begin(flood, &core.instance);
    let begun = Instant::now();
    operator.watch(Duration::from_millis(500));
    let mut asked = Vec::new();
    for number in 0..count {
        let (flag, request) = match number % 2 {
            0 => {
                operator.set(flags::ENGAGED, &Request::Engage);
                (flags::ENGAGED, Request::Disengage)
            }
            _ => {
                // Each stop comes after a millimetre or so: a goal that near would be reached before anybody sees a motion.
                let now_m = operator.link.state().expect("live").tip_in_scene_m;
                let back_m: f64 = (0..3).map(|a| (home_m[a] - now_m[a]) * direction[a]).sum();
                let by_m = if back_m < 0.015 { 0.03 } else { 0.0 };
                let to_m = std::array::from_fn(|a| home_m[a] - by_m * direction[a]);
                operator.set(flags::IN_MOTION, &move_request(to_m, direction, 0.1, 2.0));
                (flags::IN_MOTION, Request::StopHand)
            }
        };
        operator.watch(Duration::from_millis(7 + number % 5));
        asked.push((flag, stopper.ask(&request)));
        let is_obeyed = operator.watch_until(Duration::from_secs(5), |state| state.flags & flag == 0);
        assert!(is_obeyed, "{request:?} is not obeyed");
    }
    operator.watch(Duration::from_millis(300));
    let (took, sent) = (begun.elapsed(), flooding.sent.load(Ordering::Relaxed));
    drop(flooding);
    let records = &operator.records;
    assert_smooth(records);
    let mut latest = 0;
    for (of, what) in [(flags::ENGAGED, "Disengage"), (flags::IN_MOTION, "StopHand")] {
        let of_kind = asked.iter().filter(|(flag, _)| *flag == of);
        let mut ticks: Vec<usize> = of_kind
            .map(|(flag, sent_ns)| {
                let known = records.partition_point(|record| record.due_ns <= *sent_ns);
                let obeys = |record: &TickRecord| record.flags & flag == 0;
                records[known..].iter().position(obeys).expect("obeyed") + 1
            })
            .collect();
        ticks.sort_unstable();
        let at = |share: f64| ticks[((ticks.len() - 1) as f64 * share) as usize];
        let too_late = ticks.iter().filter(|ticks| **ticks > MOST_TICKS).count();
        let [middle, p99, most] = [0.5, 0.99, 1.0].map(at);
        println!(
            "| {flood:?} | {what} | {} | {middle} | {p99} | {most} | {too_late} |",
            ticks.len()
        );
        latest = latest.max(most);
    }
    let refused = operator.link.session().expect("live").refused;
    println!("{flood:?}: {sent} requests sent by threads in {took:.1?}, {refused} refused");
    assert!(refused > 100, "{flood:?} is no flood: {refused} refused");
    assert!(latest <= MOST_TICKS, "{flood:?}: in force after {latest} ticks");
    drop((operator, stopper));
    core.finish();
}

#[test]
fn a_stop_or_release_is_in_force_within_20_ticks_under_every_flood() {
    let count = repeats("FLOODS_STOPS", 40);
    println!("| flood | request | asked | middle (ticks) | p99 | most | later than {MOST_TICKS} |");
    println!("|---|---|---|---|---|---|---|");
    for flood in [Flood::OneIdentity, Flood::NewIdentities, Flood::TenProcesses] {
        where_the_machine_runs(|| stops_under(flood, count));
    }
}
