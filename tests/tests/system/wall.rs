//! The wall between hosts and the force: memory that a host damages, and a bridge that is killed or hangs, reach neither loop nor the next start.

use std::collections::BTreeSet;
use std::fs::File;
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use stylet_host::link::LinkStatus;
use stylet_ports::{self as service, Node};
use stylet_shm_schema::{Instance, TickRecord};
use stylet_tests::hand::{Insertion, assert_undisturbed, missed};
use stylet_tests::random::Random;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, left_behind, program, repeats, scratch, until};

pub fn send(signal: libc::c_int, process: u32) {
    // SAFETY: plain numbers; the process is a child of a child of ours.
    unsafe { libc::kill(process as libc::pid_t, signal) };
}

/// The bridge of a core, once there is one other than `before`.
pub fn bridge(core: u32, before: Option<u32>) -> Option<u32> {
    let children = std::fs::read_to_string(format!("/proc/{core}/task/{core}/children")).ok()?;
    let mut children = children.split_whitespace().filter_map(|pid| pid.parse().ok());
    children.find(|&pid| {
        let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
        name.trim() == "stylet-bridge" && Some(pid) != before
    })
}

/// Lines of the map of a process that it shares, writable, with whoever has the same file.
fn shared_writable(process: u32) -> Vec<String> {
    let maps = std::fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
    let is_shared = |line: &&str| {
        line.split_whitespace()
            .nth(1)
            .is_some_and(|rights| rights.starts_with("rw-s"))
    };
    maps.lines().filter(is_shared).map(str::to_owned).collect()
}

#[test]
fn the_force_process_maps_nothing_that_another_process_can_write() {
    let mut core = Core::start();
    let link = core.host();
    let maps = shared_writable(core.id());
    assert!(maps.iter().all(|line| line.contains("/memfd:stylet-")), "{maps:#?}");
    assert!(!maps.is_empty(), "boards of state and snapshots");
    // Nobody else can map a board writable, not even with its descriptor.
    let mut boards = 0;
    for entry in std::fs::read_dir(format!("/proc/{}/fd", core.id()))
        .expect("ours")
        .flatten()
    {
        let target = std::fs::read_link(entry.path()).unwrap_or_default();
        if ["/memfd:stylet-state", "/memfd:stylet-snapshots"]
            .iter()
            .any(|name| target.to_string_lossy().starts_with(name))
        {
            boards += 1;
            let opened = File::options().read(true).write(true).open(entry.path());
            let written = opened.and_then(|file| file.write_at(&[1], 0));
            assert!(written.is_err(), "{} was written from outside", target.display());
        }
    }
    assert!(boards >= 2, "{boards}");
    drop(link);
    core.finish();
}

#[test]
fn a_bridge_that_is_killed_or_stopped_is_replaced_and_the_hand_feels_nothing() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.002);
        hand.press();
        let rounds = repeats("STYLET_BRIDGE_ROUNDS", 3);
        let mut back_ms = [Vec::new(), Vec::new()];
        for round in 0..2 * rounds {
            let signal = [libc::SIGKILL, libc::SIGSTOP][round as usize % 2];
            let before = bridge(core.id(), None).expect("a bridge");
            let begun = Instant::now();
            send(signal, before);
            let mut seen = hand.link.state().expect("live").tick;
            let is_back = hand.watch_until(Duration::from_secs(10), |link| {
                let tick = link.state().map_or(0, |state| state.tick);
                let moves = std::mem::replace(&mut seen, tick) < tick;
                moves && link.status() == LinkStatus::Live && bridge(core.id(), Some(before)).is_some()
            });
            assert!(is_back, "round {round}: {:?}", hand.link.status());
            back_ms[round as usize % 2].push(begun.elapsed().as_millis());
            hand.watch(Duration::from_millis(50 + 37 * (round % 7)));
        }
        hand.watch(Duration::from_millis(500));
        for (how, mut times) in ["killed", "stopped"].into_iter().zip(back_ms) {
            times.sort_unstable();
            let at = |part: usize| times[(times.len() - 1) * part / 100];
            println!(
                "{how} {rounds} times: hosts back after {} ms (p50), {} ms (most)",
                at(50),
                at(100)
            );
            assert!(at(50) < 1000, "{times:?}");
        }
        println!(
            "{} records, {} missed deadlines",
            hand.records.len(),
            missed(&hand.records)
        );
        // Every tick has its record, and no force jumps.
        assert_undisturbed(&hand.records);
        assert_eq!(hand.link.state().expect("live").records_lost, 0);
        assert_eq!(hand.link.events_unseen(), 0);
        let instance = core.instance.clone();
        drop(hand);
        core.finish();
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

struct Recorder(Child);

impl Recorder {
    fn start(instance: &Instance) -> Self {
        let child = Command::new(program("host-ui"))
            .args(["record", "--instance", instance.name(), "--out"])
            .arg(scratch(&format!("wild-{}", instance.name())).join("session.mcap"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(child.expect("host-ui starts"))
    }

    /// Files that it could damage, of which the names hold `kind`.
    fn files(&self, kind: &str) -> BTreeSet<PathBuf> {
        let maps = shared_writable(self.0.id());
        let paths = maps
            .iter()
            .filter_map(|line| line.split_whitespace().nth(5).map(PathBuf::from));
        paths
            .filter(|path| path.starts_with("/dev/shm") && path.to_string_lossy().contains(kind))
            .collect()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What a wild pointer of a host may damage.
#[derive(Clone, Copy, Debug)]
enum Damaged {
    /// Mappings of which the names hold this.
    Mapped(&'static str),
    /// Every file that a host can open.
    Opened,
}

impl Damaged {
    fn files(self, recorder: &Recorder, instance: &Instance) -> Vec<PathBuf> {
        match self {
            Self::Mapped(kind) => recorder.files(kind).into_iter().collect(),
            Self::Opened => openable(instance),
        }
    }
}

/// Files of the instance, in its folder and in shared memory.
fn openable(instance: &Instance) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![instance.folder()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                Ok(kind) if kind.is_file() => found.push(entry.path()),
                _ => {}
            }
        }
    }
    let objects = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let own = objects.filter(|entry| entry.file_name().to_string_lossy().starts_with(&instance.prefix()));
    found.extend(own.map(|entry| entry.path()).filter(|path| path.is_file()));
    found
}

/// Writes eight random bytes at a time into what a host can damage, as a wild pointer in it would, for `time`. How many.
fn write_wildly(
    damaged: Damaged,
    (recorder, instance): (&Recorder, &Instance),
    random: &mut Random,
    time: Duration,
) -> u64 {
    let (begun, mut writes) = (Instant::now(), 0);
    while begun.elapsed() < time {
        let files = damaged.files(recorder, instance);
        let looked = Instant::now();
        while !files.is_empty() && looked.elapsed() < Duration::from_millis(100) {
            let path = &files[random.below(files.len())];
            let Ok(file) = File::options().write(true).open(path) else {
                break;
            };
            let words = file.metadata().map_or(0, |about| about.len()) / 8;
            if words > 0 || matches!(damaged, Damaged::Opened) {
                let _ = file.write_at(&random.draw().to_ne_bytes(), random.draw() % words.max(1) * 8);
                writes += 1;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    writes
}

/// Damages what hosts share with a core; true where a bridge was replaced.
fn assert_survives(damaged: Damaged, seed: u64) -> bool {
    let mut core = Core::start();
    drop(core.host());
    let first = bridge(core.id(), None);
    let recorder = Recorder::start(&core.instance);
    let maps_all = until(Duration::from_secs(20), || {
        damaged.files(&recorder, &core.instance).len() > 1 && recorder.files("").len() > 1
    });
    assert!(maps_all, "{:?}", recorder.files(""));
    let mut random = Random(seed);
    let time = Duration::from_millis(2500);
    let writes = write_wildly(damaged, (&recorder, &core.instance), &mut random, time);
    assert!(writes > 0, "{damaged:?} {seed}: nothing was written");
    assert!(core.is_running(), "{damaged:?} {seed}: the core ended");
    drop(recorder);
    // A host finds its way by itself, and one that was there before gets the last 12 s again: the records are without a gap.
    let mut link = core.host();
    let has_state = until(Duration::from_secs(10), || {
        link.poll();
        link.state().is_some()
    });
    assert!(has_state, "{damaged:?} {seed}: no state");
    let is_replaced = bridge(core.id(), None) != first;
    let mut ticks: Vec<u64> = Vec::new();
    let is_whole = until(Duration::from_secs(10), || {
        let joined = Node::join_again(&core.instance).and_then(|node| Ok((service::records::subscriber(&node)?, node)));
        let Ok((records, _node)) = joined.inspect_err(|why| println!("{why}")) else {
            return false;
        };
        ticks.clear();
        until(Duration::from_secs(2), || {
            while let Some(batch) = records.receive() {
                ticks.extend(batch.values().iter().map(|record: &TickRecord| record.tick));
            }
            ticks.len() > 2000
        })
    });
    assert!(is_whole, "{damaged:?} {seed}: {} records", ticks.len());
    let state = *link.state().expect("live");
    let missing = ticks.windows(2).filter(|pair| pair[1] != pair[0] + 1).count();
    assert_eq!(
        (state.fault, state.records_lost, missing),
        (0, 0, 0),
        "{damaged:?} {seed}"
    );
    drop(link);
    // SIGKILL: the next start finds everything that was damaged.
    let instance = core.kill();
    let mut next = Core::start_as(instance, &["--rt-if-allowed"]);
    drop(next.host());
    next.finish();
    is_replaced
}

fn assert_all_survive(seeds: u64, all: &[Damaged]) {
    let trials = (1..=seeds).flat_map(|seed| all.iter().map(move |damaged| (*damaged, seed)));
    let replaced: Vec<bool> = trials.map(|(damaged, seed)| assert_survives(damaged, seed)).collect();
    let (trials, replaced) = (replaced.len(), replaced.iter().filter(|is| **is).count());
    println!(
        "{trials} trials: no core ended, {replaced} bridges were replaced, 0 gaps in the records, {trials} next starts"
    );
}

/// Between 27 and 272 random writes of eight bytes used to end the core, and the next starts as well.
#[test]
fn wild_writes_of_a_host_reach_neither_the_force_nor_the_next_start() {
    let kinds = [".connection", ".dynamic", ".blackboard", ""].map(Damaged::Mapped);
    assert_all_survive(repeats("STYLET_WILD_SEEDS", 1), &kinds);
}

/// A host that has a path wrong writes into what it never maps, such as the name of the present epoch.
#[test]
fn wild_writes_into_files_reach_neither_the_force_nor_the_next_start() {
    assert_all_survive(repeats("STYLET_WILD_FILES", 1), &[Damaged::Opened]);
}

/// A user that is not this one; `None` where the test has no right to be another.
fn as_user(user: u32, program: &Path, arguments: &[&str]) -> Option<Command> {
    // SAFETY: no preconditions.
    if unsafe { libc::getuid() } != 0 {
        println!("skipped: only root can be another user");
        return None;
    }
    let mut command = Command::new(program);
    command
        .args(arguments)
        .uid(user)
        .gid(user)
        .env_remove("XDG_RUNTIME_DIR");
    Some(command)
}

/// An empty file of another user under the right name used to be waited for in silence, and one of 300 MB was allocated.
#[test]
fn what_another_user_leaves_is_named_or_is_not_in_the_way() {
    let (own, other) = (12_345, 65_534);
    let folder = PathBuf::from(format!("/dev/shm/stylet_{own}"));
    let flights = scratch("other-user");
    std::fs::set_permissions(&flights, std::fs::Permissions::from_mode(0o777)).expect("ours");
    let flights = flights.to_str().expect("UTF-8").to_owned();
    let arguments = [
        "--no-rt",
        "--exit-with-parent",
        "--instance",
        "squat",
        "--flight-dir",
        &flights,
    ];
    // Where the user could not even run the program, as in a home folder that is closed, there is nothing to see.
    let reachable = std::env::temp_dir().join(format!("stylet-other-user-{}", std::process::id()));
    std::fs::create_dir_all(&reachable).expect("room");
    std::fs::set_permissions(&reachable, std::fs::Permissions::from_mode(0o755)).expect("ours");
    for name in ["rt-core", "stylet-bridge"] {
        std::fs::copy(program(name), reachable.join(name)).expect("room");
    }
    let rt_core = reachable.join("rt-core");
    let run = |seconds: u64| -> Option<(bool, String)> {
        let mut child = as_user(own, &rt_core, &arguments)?
            .stderr(Stdio::piped())
            .spawn()
            .expect("rt-core starts");
        let begun = Instant::now();
        let ended = until(Duration::from_secs(seconds), || matches!(child.try_wait(), Ok(Some(_))));
        println!("ended {ended} after {:?}", begun.elapsed());
        send(libc::SIGTERM, child.id());
        let output = child.wait_with_output().expect("ours");
        Some((ended, String::from_utf8_lossy(&output.stderr).into_owned()))
    };
    let make = |what: &str| {
        let made = as_user(other, Path::new("/bin/sh"), &["-c", what]).map(|mut shell| shell.status());
        assert!(made.is_none_or(|status| status.expect("a shell").success()), "{what}");
    };
    let name = folder.display();
    // In the way: named, with its owner.
    for what in [
        format!("mkdir {name}"),
        format!("umask 0; : > {name}"),
        format!("ln -s /tmp {name}"),
    ] {
        make(&what);
        let Some((ended, words)) = run(20) else { break };
        as_user(other, Path::new("/bin/rm"), &["-rf", &name.to_string()]).map(|mut rm| rm.status());
        assert!(
            ended && words.contains(&name.to_string()) && words.contains("(65534)"),
            "{what}: {words}"
        );
    }
    // Not in the way: names of a run cannot be known before it.
    let object = "/dev/shm/stylet_12345_squat_x";
    make(&format!("truncate -s 300M {object}"));
    if let Some((ended, words)) = run(2) {
        assert!(!ended, "{words}");
        use std::os::unix::fs::MetadataExt;
        assert_eq!(
            std::fs::metadata(object).expect("there").blocks(),
            0,
            "nobody allocates it"
        );
    }
    let _ = std::fs::remove_file(object);
    let _ = std::fs::remove_dir_all(&reachable);
}
