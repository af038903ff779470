//! Records complete and in order, snapshots at screen rate, and a far recording equal to the near one.

use crate::fixture::{Keys, Named, core, invitation, join, lease, program, scratch, until};
use crate::host::Host;
use crate::proxy::Proxy;
use crate::watch::{Beside, Seen, arrivals, quantile, seconds, settle, snapshots_lost, socket_ages_ms};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity, write_invitation};
use stylet_shm_schema::Instance;
use stylet_shm_schema::TickRecord;
use stylet_test_kit::witness::where_the_machine_runs;

#[test]
fn every_record_comes_in_order_and_snapshots_come_as_a_screen_shows_them() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &["--scene", "pelvis"]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let joined = join(&keys.invite("anna", Role::Observer, Validity::days(1)), &far);
    let mut host = Host::new(&far);
    assert!(
        host.sees_the_core(Duration::from_secs(10)),
        "{}{}",
        served.log(),
        joined.log()
    );
    let mut beside = Host::new(&near);
    assert!(beside.sees_the_core(Duration::from_secs(10)));
    let (scene, its) = (host.scene.expect("seen"), beside.scene.expect("seen"));
    assert_eq!(
        bytemuck::bytes_of(&scene),
        bytemuck::bytes_of(&its),
        "the scene is whole"
    );

    settle(&far);
    where_the_machine_runs(|| {
        let length = seconds(5.0);
        let end = Instant::now() + Duration::from_secs_f64(length);
        let lost_before = lease(&far, &["status"]);
        let (here, mut bare_ms, seen) = std::thread::scope(|scope| {
            let (bell, rung) = channel();
            let here = scope.spawn(|| arrivals(&near.0, end, &Beside::Ringing(bell)));
            let bare = scope.spawn(|| socket_ages_ms(end));
            let seen = Seen::beside(Beside::Rung(rung), &far, end);
            (here.join().expect("ran"), bare.join().expect("ran"), seen)
        });
        let there = &seen.records;
        let mut ages_ms: Vec<f64> = there
            .iter()
            .filter_map(|(tick, at)| Some(at.saturating_duration_since(*here.get(tick)?).as_secs_f64() * 1e3))
            .collect();
        let [median, most, longest] = [0.5, 0.99, 1.0].map(|share| quantile(&mut ages_ms, share));
        println!("age over the host beside the core: p50 {median:.2}, p99 {most:.2}, longest {longest:.2} ms");
        let [median, most, longest] = [0.5, 0.99, 1.0].map(|share| quantile(&mut bare_ms, share));
        println!(
            "a bare socket from thread to thread meanwhile: p50 {median:.2}, p99 {most:.2}, longest {longest:.2} ms"
        );
        println!("{}", seen.words("one machine"));
        seen.has_every_record();
        assert!(there.len() as f64 > 0.9 * here.len() as f64, "{} records", there.len());
        let shown = &seen.snapshots;
        assert!(shown.windows(2).all(|pair| pair[0].0 < pair[1].0), "in order");
        assert!(shown.len() as f64 <= 61.0 * length, "{} snapshots", shown.len());
        assert!(shown.len() > 20, "{} snapshots", shown.len());
        let lost_before = snapshots_lost(&lost_before);
        assert_eq!(seen.snapshots_lost() - lost_before, 0, "snapshots lost on one machine");
    });
}

#[test]
fn a_late_and_lossy_cable_costs_no_record() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let cable = Proxy::to(keys.port);
    cable.worsen(Duration::from_millis(20), 10);
    let path = keys.invite("anna", Role::Observer, Validity::days(1));
    let mut changed = invitation(&path);
    changed.server = format!("127.0.0.1:{}", cable.port);
    write_invitation(&path, &changed).expect("written");
    let joined = join(&path, &far);
    let mut host = Host::new(&far);
    assert!(
        host.sees_the_core(Duration::from_secs(20)),
        "{}{}",
        served.log(),
        joined.log()
    );
    settle(&far);
    let seen = Seen::until(&far, Instant::now() + Duration::from_secs_f64(seconds(5.0)));
    println!("{}", seen.words("20 ms and 1 % each way"));
    println!("server: {}\nmember: {}", served.log(), joined.log());
    seen.has_every_record();
}

/// It waited for the first answer of a server inside zenoh, and only SIGKILL ended it.
#[test]
fn a_join_that_no_server_answers_ends_when_it_is_asked_to() {
    let (keys, far) = (Keys::new(), Named::new());
    let mut joined = join(&keys.invite("anna", Role::Observer, Validity::days(1)), &far);
    std::thread::sleep(Duration::from_millis(500));
    joined.signal(libc::SIGTERM);
    let mut status = None;
    until(Duration::from_secs(10), || {
        status = joined.child.try_wait().expect("ours");
        status.is_some()
    });
    assert!(status.is_some_and(|status| status.success()), "{status:?}");
}

fn record(instance: &Instance, out: &Path) -> std::process::Child {
    Command::new(program("host-ui"))
        .args(["record", "--instance", instance.name(), "--duration", "4", "--out"])
        .arg(out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("host-ui starts")
}

/// Rows of a recording by tick, as written by `host-ui export`.
fn rows(recording: &Path) -> BTreeMap<u64, String> {
    let table = recording.with_extension("csv");
    let exported = Command::new(program("host-ui"))
        .arg("export")
        .arg(recording)
        .arg("--csv")
        .arg(&table)
        .status();
    assert!(exported.expect("host-ui runs").success());
    let text = std::fs::read_to_string(table).expect("written");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    let at = names
        .iter()
        .position(|name| *name == "tick")
        .expect("a column of ticks");
    let number = |line: &str| line.split(',').nth(at).and_then(|n| n.parse().ok()).expect("a number");
    lines.map(|line| (number(line), line.to_owned())).collect()
}

#[test]
fn a_recording_on_the_far_side_is_that_of_the_near_one() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let _served = keys.serve(&near);
    let joined = join(&keys.invite("anna", Role::Observer, Validity::days(1)), &far);
    let mut host = Host::new(&far);
    assert!(host.sees_the_core(Duration::from_secs(10)), "{}", joined.log());
    drop(host);
    let folder = scratch("recordings");
    let files = [folder.join("near.mcap"), folder.join("far.mcap")];
    let recorders = [record(&near.0, &files[0]), record(&far.0, &files[1])];
    for recorder in recorders {
        let output = recorder.wait_with_output().expect("ours");
        let words = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        println!("{words}");
        assert!(output.status.success(), "ticks were lost");
    }
    let [here, there] = files.map(|file| rows(&file));
    // A recording marks its first tick: earlier data is unknown.
    let (from, to) = (
        *here.keys().next().max(there.keys().next()).expect("rows"),
        *here.keys().next_back().min(there.keys().next_back()).expect("rows"),
    );
    let common = |rows: &BTreeMap<u64, String>| {
        rows.range(from + 1..=to)
            .map(|(_, row)| row.clone())
            .collect::<Vec<_>>()
    };
    println!("{} ticks in both recordings", common(&here).len());
    assert!(common(&here).len() > 1500, "{from} to {to}");
    let unequal: Vec<_> = common(&here)
        .into_iter()
        .zip(common(&there))
        .filter(|(here, there)| here != there)
        .collect();
    assert_eq!(unequal.first(), None, "{} rows differ", unequal.len());
    assert_eq!(common(&here).len(), common(&there).len());
}

#[test]
fn a_core_and_a_server_that_are_started_again_are_seen_again() {
    let (near, far) = (Named::new(), Named::new());
    let keys = Keys::new();
    let invitation = keys.invite("anna", Role::Observer, Validity::days(1));
    // Before there is a server, and a server before there is a core.
    let joined = join(&invitation, &far);
    let served = keys.serve(&near);
    let first = core(&near, &[]);
    let mut host = Host::new(&far);
    assert!(
        host.sees_the_core(Duration::from_secs(15)),
        "{}{}",
        served.log(),
        joined.log()
    );
    let run = host.session.map(|s| s.session_id);
    drop(first);
    let _second = core(&near, &[]);
    let again = until(Duration::from_secs(15), || {
        let ticks = host.state().is_some_and(|s| s.tick > 0);
        ticks && host.session.map(|s| s.session_id) != run
    });
    assert!(again, "{}{}", served.log(), joined.log());
    drop(served);
    assert!(joined.says("is not heard", Duration::from_secs(5)));
    let _served = keys.serve(&near);
    host.taken.clear();
    let again = until(Duration::from_secs(15), || {
        host.poll();
        host.taken.len() > 100
    });
    assert!(again, "{}", joined.log());
}

/// Each recording on its machine lacked the records made while it was down.
#[test]
fn a_restarted_member_hands_on_the_records_made_while_it_was_down() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let invitation = keys.invite("anna", Role::Observer, Validity::days(1));
    let mut killed = join(&invitation, &far);
    let mut host = Host::new(&far);
    assert!(host.sees_the_core(Duration::from_secs(10)), "{}", killed.log());
    let mut ticks = Vec::new();
    // Like a window: it drops records of a run other than the announced one.
    let mut takes = |host: &mut Host, more: usize| {
        let enough = ticks.len() + more;
        let came = until(Duration::from_secs(15), || {
            host.poll();
            let run = host.session.map(|session| session.session_id);
            let of_run = |record: &TickRecord| Some(record.session_id) == run;
            ticks.extend(host.taken.drain(..).filter(of_run).map(|record| record.tick));
            ticks.len() > enough
        });
        assert!(came, "{} records: {}", ticks.len(), served.log());
    };
    takes(&mut host, 500);
    killed.signal(libc::SIGKILL);
    let _ = killed.child.wait();
    std::thread::sleep(Duration::from_secs(1));
    let _again = join(&invitation, &far);
    takes(&mut host, 2500);
    let missing = ticks.windows(2).find(|pair| pair[1] != pair[0] + 1);
    assert_eq!(missing, None, "of {} records", ticks.len());
}
