//! Records whole and in order, snapshots at the rate of a screen, and a recording on the far side that is that of the near one.

use crate::fixture::{Host, Keys, Named, core, invitation, join, lease, program, scratch, until};
use crate::proxy::Proxy;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity, write_invitation};
use stylet_relay::now_ns;
use stylet_shm_schema::service::{self, Instance};

/// Of each measurement; `STYLET_RELAY_S` makes it longer for a figure.
fn seconds() -> f64 {
    let asked = std::env::var("STYLET_RELAY_S").ok().and_then(|s| s.parse().ok());
    asked.unwrap_or(5.0)
}

/// When each tick was seen first, by a host that looks every 0.1 ms.
pub fn arrivals(instance: &Instance, until: Instant) -> BTreeMap<u64, Instant> {
    let node = instance.node().expect("shared memory");
    let port = service::records::subscriber(&node).expect("a port");
    let mut seen = BTreeMap::new();
    while Instant::now() < until {
        while let Some(sample) = port.receive() {
            let now = Instant::now();
            seen.extend(sample.values().iter().map(|record| (record.tick, now)));
        }
        std::thread::sleep(Duration::from_micros(100));
    }
    seen
}

/// How old each snapshot was when it came, ms, by its tissue tick. Both sides are on this machine, so their clock is one.
pub fn pictures(instance: &Instance, until: Instant) -> Vec<(u64, f64)> {
    let node = instance.node().expect("shared memory");
    let port = service::snapshots::subscriber(&node).expect("a port");
    let mut seen = Vec::new();
    while Instant::now() < until {
        while let Some(sample) = port.receive() {
            let header = sample.header();
            let age_ms = now_ns().saturating_sub(header.time_ns) as f64 * 1e-6;
            seen.push((header.tissue_tick, age_ms));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    seen
}

/// Ages in order; the first, which was kept for whoever comes late, left out.
pub fn ages_ms(shown: &[(u64, f64)]) -> Vec<f64> {
    let mut ages: Vec<f64> = shown.iter().skip(1).map(|(_, age)| *age).collect();
    ages.sort_by(f64::total_cmp);
    ages
}

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

    let end = Instant::now() + Duration::from_secs_f64(seconds());
    let (here, there, shown) = std::thread::scope(|scope| {
        let here = scope.spawn(|| arrivals(&near.0, end));
        let there = scope.spawn(|| arrivals(&far.0, end));
        let shown = scope.spawn(|| pictures(&far.0, end));
        (
            here.join().expect("ran"),
            there.join().expect("ran"),
            shown.join().expect("ran"),
        )
    });
    let (first, last) = (
        *there.keys().next().expect("records"),
        *there.keys().next_back().expect("records"),
    );
    let missing = here
        .keys()
        .filter(|tick| (first..=last).contains(tick) && !there.contains_key(tick))
        .count();
    let mut ages_ms: Vec<f64> = there
        .iter()
        .filter_map(|(tick, at)| Some(at.saturating_duration_since(*here.get(tick)?).as_secs_f64() * 1e3))
        .collect();
    ages_ms.sort_by(f64::total_cmp);
    let at = |share: f64| ages_ms[((ages_ms.len() - 1) as f64 * share) as usize];
    println!(
        "{} records, {missing} missing; age over the host beside the core: p50 {:.2}, p99 {:.2}, longest {:.2} ms; {} snapshots in {:.0} s",
        there.len(),
        at(0.5),
        at(0.99),
        at(1.0),
        shown.len(),
        seconds()
    );
    let words = lease(&far, &["status"]);
    println!("{words}");
    assert_eq!(missing, 0);
    assert!(
        there.len() as f64 > 0.9 * here.len() as f64 && there.len() > 500,
        "{} records",
        there.len()
    );
    assert!(words.contains(" 0 records lost"), "{words}");
    assert!(shown.windows(2).all(|pair| pair[0].0 < pair[1].0), "in order");
    assert!(shown.len() as f64 <= 61.0 * seconds(), "{} snapshots", shown.len());
    assert!(shown.len() > 20, "{} snapshots", shown.len());
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
    let end = Instant::now() + Duration::from_secs_f64(seconds());
    let (there, shown) = std::thread::scope(|scope| {
        let there = scope.spawn(|| arrivals(&far.0, end));
        let shown = scope.spawn(|| pictures(&far.0, end));
        (there.join().expect("ran"), shown.join().expect("ran"))
    });
    let ages_ms = ages_ms(&shown);
    let ticks: Vec<u64> = there.keys().copied().collect();
    let missing: u64 = ticks.windows(2).map(|pair| pair[1] - pair[0] - 1).sum();
    let words = lease(&far, &["status"]);
    println!(
        "20 ms and 1 % each way: {} records, {missing} missing; {} snapshots, p50 {:.0} ms old, the oldest {:.0} ms\n{words}",
        ticks.len(),
        shown.len(),
        ages_ms.get(ages_ms.len() / 2).unwrap_or(&f64::NAN),
        ages_ms.last().unwrap_or(&f64::NAN)
    );
    // How many snapshots pass depends on what QUIC makes of such a line: ADR 18 says how few they have been.
    assert!(ticks.len() > 500, "{} records", ticks.len());
    assert_eq!(missing, 0);
    assert!(words.contains(" 0 records lost"), "{words}");
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

/// Rows of a recording by their tick, as `host-ui export` writes them.
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
    // A recording marks its first tick: what was before it is not known.
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
