//! The wall between hosts and the force: memory damaged by a host, and a killed or hung bridge, reach neither loop nor
//! the next start.

use std::fs::File;
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use stylet_host::link::LinkStatus;
use stylet_tests::hand::{Insertion, assert_undisturbed, missed};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, left_behind, program, repeats, scratch, until};

pub fn send(signal: libc::c_int, process: u32) {
    // SAFETY: plain numbers; the process is a child of a child of ours.
    unsafe { libc::kill(process as libc::pid_t, signal) };
}

/// Returns the bridge of a core, once there is one other than `before`.
pub fn bridge(core: u32, before: Option<u32>) -> Option<u32> {
    let children = std::fs::read_to_string(format!("/proc/{core}/task/{core}/children")).ok()?;
    let mut children = children.split_whitespace().filter_map(|pid| pid.parse().ok());
    children.find(|&pid| {
        let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
        name.trim() == "stylet-bridge" && Some(pid) != before
    })
}

/// Returns the mappings that a process shares, writable, with other openers of the same file.
pub fn shared_writable(process: u32) -> Vec<String> {
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
    // No other process can map a board writable, not even with its descriptor.
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
fn a_killed_or_stopped_bridge_is_replaced_unfelt_by_the_hand() {
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

/// Runs as a different user; `None` if the test has no right to.
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

/// The core used to wait in silence for another user's empty file of the right name, and allocated one of 300 MB.
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
    // If the user cannot even run the program, as in a closed home folder, there is nothing to test.
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
    // In the way: reported with its owner.
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
