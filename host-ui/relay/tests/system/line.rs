//! Members on separate lines, in network namespaces: a line of 100 Mbit/s, and a class of twenty. As root, by `make
//! relay-class`.

use crate::fixture::{Keys, Named, Running, core, lease, scratch, until};
use crate::host::Host;
use crate::space::Line;
use crate::watch::{Seen, gaps, quantile, seconds, settle};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity};

fn measured() -> Duration {
    Duration::from_secs_f64(seconds(10.0))
}

fn observers() -> usize {
    std::env::var("STYLET_RELAY_OBSERVERS")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(20)
}

/// Rounds, each without the class and with it.
fn rounds() -> usize {
    let asked = std::env::var("STYLET_RELAY_ROUNDS").ok().and_then(|s| s.parse().ok());
    asked.unwrap_or(3)
}

#[test]
#[ignore = "as root: it makes a network namespace"]
fn a_line_of_100_megabits_carries_records_whole_and_snapshots_in_time() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &["--scene", "pelvis"]);
    let keys = Keys::reached_at(&[Line::server(1)]);
    let line = Line::new(1, Some("100mbit"));
    let served = keys.serve_on(&near, "0.0.0.0");
    let joined = line.join(
        &keys.invite_to("anna", Role::Observer, Validity::days(1), &Line::server(1)),
        &far,
    );
    let mut host = Host::new(&far);
    assert!(
        host.sees_the_core(Duration::from_secs(20)),
        "{}{}",
        served.log(),
        joined.log()
    );
    settle(&far);
    let seen = Seen::until(&far, Instant::now() + measured());
    println!("{}", seen.words("100 Mbit/s"));
    seen.has_every_record();
    drop(joined);
}

/// Wake-up latencies of the core's loop (µs), while a host next to it takes the records, which stay there.
fn wakes_us(local: &mut Host) -> Vec<f64> {
    local.poll();
    local.taken.clear();
    until(measured(), || {
        local.poll();
        false
    });
    assert!(local.taken.len() > 500, "{} records", local.taken.len());
    local.taken.iter().map(|r| r.wake_latency_ns as f64 * 1e-3).collect()
}

/// Fraction of the ticks in `made` that a member's host has, once the last has arrived or has been missing for a while.
/// Prints missing ones.
fn share_of(made: &BTreeSet<u64>, host: &mut Host, named: &Named) -> f64 {
    let last = made.last().copied();
    until(Duration::from_secs(5), || {
        host.poll();
        host.taken.last().map(|record| record.tick) >= last
    });
    let had: BTreeSet<u64> = host.taken.iter().map(|record| record.tick).collect();
    let missing: Vec<u64> = made.difference(&had).copied().collect();
    if let Some(first) = made.first().filter(|_| !missing.is_empty()) {
        println!(
            "{}: {} of {} records are missing, those {:?} after the first; {} came\n{}",
            named.0.name(),
            missing.len(),
            made.len(),
            gaps(&missing)
                .iter()
                .map(|(from, to)| (from - first, to - first))
                .collect::<Vec<_>>(),
            had.len(),
            lease(named, &["status"]).lines().next().unwrap_or_default()
        );
    }
    1.0 - missing.len() as f64 / made.len() as f64
}

#[test]
#[ignore = "as root: it makes a network namespace for each member"]
fn a_class_of_twenty_gets_its_records_and_the_core_does_not_notice() {
    let near = Named::new();
    let report = scratch("report").join("core.json");
    let core = core(&near, &["--report", report.to_str().expect("plain")]);
    let servers: Vec<String> = (1..=observers()).map(Line::server).collect();
    let keys = Keys::reached_at(&servers);
    let lines: Vec<Line> = (1..=observers()).map(|number| Line::new(number, None)).collect();
    let served = keys.serve_on(&near, "0.0.0.0");
    let invite =
        |(i, at): (usize, &String)| keys.invite_to(&format!("student-{i}"), Role::Observer, Validity::days(1), at);
    let invitations: Vec<_> = servers.iter().enumerate().map(invite).collect();
    let mut local = Host::new(&near);
    assert!(local.sees_the_core(Duration::from_secs(10)));
    let (mut without_us, mut with_us, mut shares) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..rounds() {
        without_us.push(wakes_us(&mut local));
        let far: Vec<Named> = lines.iter().map(|_| Named::new()).collect();
        let joined: Vec<Running> = (0..lines.len())
            .map(|i| lines[i].join(&invitations[i], &far[i]))
            .collect();
        let all = until(Duration::from_secs(60), || {
            served.log().matches("connected: ").count() >= lines.len()
        });
        assert!(all, "{}", served.log());
        std::thread::sleep(Duration::from_secs(5));
        let mut hosts: Vec<Host> = far.iter().map(Host::new).collect();
        // Polls all of them in each round: queues of a host that is not polled are bounded.
        let all_see = until(Duration::from_secs(30), || {
            hosts.iter_mut().map(Host::sees_it_now).filter(|sees| *sees).count() == far.len()
        });
        for ((host, joined), named) in hosts.iter_mut().zip(&joined).zip(&far) {
            if !host.sees_it_now() {
                println!("sees nothing: {}\n{}", lease(named, &["status"]), joined.log());
            }
        }
        assert!(all_see, "{}", served.log());
        for host in &mut hosts {
            host.poll();
            host.taken.clear();
        }
        with_us.push(wakes_us(&mut local));
        let made: BTreeSet<u64> = local.taken.iter().map(|record| record.tick).collect();
        for (host, named) in hosts.iter_mut().zip(&far) {
            shares.push(share_of(&made, host, named));
        }
        drop(hosts);
        drop(joined);
    }
    // Also for each round: a bad one must not be hidden among the others.
    let p99s = |rounds: &[Vec<f64>]| -> Vec<f64> { rounds.iter().map(|us| quantile(&mut us.clone(), 0.99)).collect() };
    let [mut quiet, mut busy] = [&without_us, &with_us].map(|rounds| p99s(rounds));
    for (without, with) in quiet.iter().zip(&busy) {
        println!(
            "wake-up p99 {without:.0} us without, {with:.0} us with: {:.2}",
            with / without
        );
    }
    let [all_quiet, all_busy] = [&without_us, &with_us].map(|rounds| quantile(&mut rounds.concat(), 0.99));
    println!(
        "wake-up p99 of all rounds together {all_quiet:.0} us without, {all_busy:.0} us with: {:.2}",
        all_busy / all_quiet
    );
    let [quiet, busy] = [&mut quiet, &mut busy].map(|p99s| quantile(p99s, 0.5));
    let least = shares.iter().copied().fold(1.0, f64::min);
    println!(
        "{} members: at least {:.4} % of the records each; wake-up p99 {quiet:.0} us without, {busy:.0} us with, medians of the rounds: {:.2}",
        lines.len(),
        100.0 * least,
        busy / quiet
    );
    assert!(least >= 0.999, "{shares:?}");
    drop(core);
    let text = std::fs::read_to_string(&report).expect("the core reports what its loops did");
    let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for name in ["haptic", "tissue"] {
        let own = &report[name];
        println!("{name}: {own}");
        let disturbed = ["heap_calls", "minor_faults", "major_faults"].map(|what| own[what].as_i64());
        assert_eq!(disturbed, [Some(0); 3], "{name}: heap calls and page faults");
    }
}
