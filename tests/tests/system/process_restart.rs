//! Cores that are killed, restarted, doubled, or find no memory: the operator's messages, and the remains.

use std::process::{Command, Stdio};
use std::time::Duration;
use stylet_host::link::{Link, LinkStatus};
use stylet_shm_schema::Instance;
use stylet_shm_schema::Request;
use stylet_tests::hand::{Insertion, assert_undisturbed};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, fresh_instance, left_behind, program, scratch, until};

fn core(instance: &Instance) -> Command {
    let flights = scratch(&format!("flights-{}", instance.name()));
    let mut command = Command::new(program("rt-core"));
    command
        .args([
            "--rt-if-allowed",
            "--exit-with-parent",
            "--instance",
            instance.name(),
            "--flight-dir",
        ])
        .arg(flights);
    command
}

#[test]
fn a_killed_core_is_seen_and_its_successor_is_found_by_the_same_host() {
    where_the_machine_runs(|| {
        let mut first = Core::start();
        let mut hand = Insertion::begin(&mut first, 0.005);
        hand.press();
        let before = hand.link.session().expect("live").session_id;
        let instance = first.kill();
        assert!(
            !left_behind(&instance).is_empty(),
            "a killed core leaves files: that is the case to cope with"
        );
        let mut silent = false;
        let absent = until(Duration::from_secs(5), || {
            hand.take();
            silent |= matches!(hand.link.status(), LinkStatus::Silent { .. });
            matches!(hand.link.status(), LinkStatus::Absent { .. })
        });
        let LinkStatus::Absent { why } = hand.link.status() else {
            panic!("{:?}", hand.link.status())
        };
        assert!(
            silent && absent && why.contains("rt-core has stopped") && why.contains("Start it"),
            "{why}"
        );
        assert_undisturbed(&hand.records);

        // Three times in succession: the host that watched the first one finds each.
        let (mut instance, mut last) = (instance, before);
        for _ in 0..3 {
            let mut next = Core::start_as(instance.clone(), &["--rt-if-allowed"]);
            let found = hand.watch_until(Duration::from_secs(15), |link| {
                link.status() == LinkStatus::Live && link.session().is_some_and(|s| s.session_id != last)
            });
            assert!(found && next.is_running(), "not found again: {:?}", hand.link.status());
            last = hand.link.session().expect("live").session_id;
            hand.watch(Duration::from_millis(300));
            ask(&mut hand.link, &Request::Engage).expect("a host that was there before commands the new core");
            instance = next.kill();
        }
        let end = Core::start_as(instance.clone(), &["--rt-if-allowed"]);
        let found = hand.watch_until(Duration::from_secs(15), |link| {
            link.status() == LinkStatus::Live && link.session().is_some_and(|s| s.session_id != last)
        });
        assert!(found, "not found again: {:?}", hand.link.status());
        drop(hand);
        end.finish();
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

#[test]
fn a_second_core_is_refused_under_the_same_name_and_runs_under_another() {
    where_the_machine_runs(|| {
        let mut first = Core::start();
        let mut hand = Insertion::begin(&mut first, 0.005);
        let mut second = core(&first.instance).stderr(Stdio::piped()).spawn().expect("runs");
        let mut status = None;
        assert!(hand.watch_until(Duration::from_secs(10), |_| {
            status = second.try_wait().expect("ours");
            status.is_some()
        }));
        let words = std::io::read_to_string(second.stderr.take().expect("piped")).expect("text");
        println!("{words}");
        assert_eq!(status.and_then(|s| s.code()), Some(1));
        assert!(
            words.contains("another rt-core") && words.contains("--instance"),
            "{words}"
        );

        let other = Core::start();
        let mut link = Link::new(other.instance.clone());
        let live = hand.watch_until(Duration::from_secs(10), |_| {
            link.poll();
            link.status() == LinkStatus::Live && link.parameters().is_some()
        });
        assert!(live, "another name is another core: {:?}", link.status());
        hand.watch(Duration::from_secs(2));
        assert_undisturbed(&hand.records);
        drop(link);
        other.finish();
        drop(hand);
        let instance = first.instance.clone();
        first.finish();
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

#[test]
fn what_killed_cores_and_hosts_left_is_removed_by_the_next_run() {
    where_the_machine_runs(|| {
        let mut instance = fresh_instance();
        for _ in 0..3 {
            let mut core = Core::start_as(instance.clone(), &["--rt-if-allowed"]);
            let out = scratch("stale").join("a.mcap");
            let mut host = Command::new(program("host-ui"))
                .args(["record", "--instance", instance.name(), "--out"])
                .arg(out)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("host-ui starts");
            drop(core.host());
            let _ = host.kill();
            let _ = host.wait();
            instance = core.kill();
        }
        assert!(!left_behind(&instance).is_empty());
        let mut core = Core::start_as(instance.clone(), &["--rt-if-allowed"]);
        let mut link = core.host();
        ask(&mut link, &Request::Engage).expect("works as on a clean machine");
        drop(link);
        core.finish();
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

/// Runs in a separate mount namespace with a small `/dev/shm`, so that no other program is affected.
const FULL: &str = r#"
set -u
mount -t tmpfs -o size=60m tmpfs /dev/shm || exit 77
core="$1/rt-core --rt-if-allowed --exit-with-parent --flight-dir $2"
record="$1/host-ui record --instance full --snapshot-rate 0 --out"
$core --instance full & running=$!
sleep 1
$record "$2/old.mcap" --duration 4 & old=$!
sleep 1
dd if=/dev/zero of=/dev/shm/filler bs=4k 2>/dev/null
$record "$2/new.mcap" --duration 1 2>"$2/new.words"; echo "new host $?"
$core --instance second 2>"$2/second.words"; echo "second core $?"
truncate -s -9M /dev/shm/filler
$core --instance third 2>"$2/third.words"; echo "third core $?"
wait $old; echo "old host $?"
rm /dev/shm/filler
$record "$2/after.mcap" --duration 1; echo "host after $?"
kill $running; wait $running; echo "core $?"
echo "left: $(ls /dev/shm)"
"#;

#[test]
fn full_shared_memory_is_reported_in_words_and_who_runs_already_goes_on() {
    let folder = scratch("full");
    let mut namespace = Command::new("unshare");
    // Without root, in a user namespace.
    // SAFETY: no preconditions.
    if unsafe { libc::getuid() } == 0 {
        namespace.arg("--mount");
    } else {
        namespace.args(["--mount", "--map-root-user"]);
    }
    let programs = program("rt-core").parent().expect("in a folder").to_owned();
    let output = namespace
        .args(["bash", "-c", FULL, "full"])
        .args([&programs, &folder])
        .output()
        .expect("unshare runs");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{printed}{}", String::from_utf8_lossy(&output.stderr));
    if output.status.code() == Some(77) || printed.is_empty() {
        println!("SKIPPED: this machine does not allow a mount namespace");
        return;
    }
    for line in [
        "new host 1",
        "second core 1",
        "third core 1",
        "old host 0",
        "host after 0",
        "core 0",
    ] {
        assert!(printed.lines().any(|l| l == line), "not {line:?}:\n{printed}");
    }
    assert!(printed.ends_with("left: \n"), "something is left:\n{printed}");
    for words in ["new", "second", "third"] {
        let text = std::fs::read_to_string(folder.join(format!("{words}.words"))).expect("written");
        assert!(text.contains("/dev/shm needs room"), "{words}: {text}");
    }
}

/// A host's wild write there used to make the core unfindable for the rest of its run.
#[test]
fn a_core_announces_itself_again_where_a_host_has_overwritten_that() {
    let mut core = Core::start();
    drop(core.host());
    let (announced, epoch) = (core.instance.folder().join("current"), core.instance.epoch());
    assert!(epoch.is_some());
    for damage in [&b"0123456789abcdef"[..], b"", b"\xff\xff"] {
        std::fs::write(&announced, damage).expect("ours");
        let is_found = until(Duration::from_secs(2), || core.instance.epoch() == epoch);
        assert!(is_found, "{damage:?}");
    }
    drop(core.host());
    core.finish();
}
