//! Members behind lines of their own, in network namespaces: a line of 100 Mbit/s, and a class of twenty. As root, by `make relay-class`.

use crate::fixture::{Host, Keys, Named, Running, core, scratch, until};
use crate::watch::{Seen, quantile, seconds, settle};
use std::path::Path;
use std::process::Command;
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

/// Each without the class and with it.
fn rounds() -> usize {
    let asked = std::env::var("STYLET_RELAY_ROUNDS").ok().and_then(|s| s.parse().ok());
    asked.unwrap_or(3)
}

fn run(words: &str) {
    let mut parts = words.split_whitespace();
    let output = Command::new(parts.next().expect("a program"))
        .args(parts)
        .output()
        .expect("runs");
    assert!(
        output.status.success(),
        "{words}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// A namespace with a cable to this one; removed when it is dropped.
struct Line {
    name: String,
    number: usize,
}

impl Line {
    /// Of `rate` each way, in the words of `tc`, or as fast as it can.
    fn new(number: usize, rate: Option<&str>) -> Self {
        let line = Self {
            name: format!("stylet{}-{number}", std::process::id()),
            number,
        };
        let (name, here, there) = (&line.name, line.cable("a"), line.cable("b"));
        run(&format!("ip netns add {name}"));
        run(&format!("ip link add {here} type veth peer name {there} netns {name}"));
        run(&format!("ip addr add {}/30 dev {here}", Self::server(number)));
        run(&format!("ip link set {here} up"));
        run(&format!("ip -n {name} addr add 10.77.{number}.2/30 dev {there}"));
        run(&format!("ip -n {name} link set {there} up"));
        if let Some(rate) = rate {
            run(&format!(
                "tc qdisc add dev {here} root tbf rate {rate} burst 64kb latency 50ms"
            ));
            run(&format!(
                "tc -n {name} qdisc add dev {there} root tbf rate {rate} burst 64kb latency 50ms"
            ));
        }
        line
    }

    fn cable(&self, end: &str) -> String {
        format!("st{}{end}{}", std::process::id() % 100_000, self.number)
    }

    fn server(number: usize) -> String {
        format!("10.77.{number}.1")
    }

    fn join(&self, invitation: &Path, named: &Named) -> Running {
        let mut command = Command::new("ip");
        command
            .args([
                "netns",
                "exec",
                &self.name,
                env!("CARGO_BIN_EXE_relay"),
                "join",
                "--instance",
                named.0.name(),
                "--invitation",
            ])
            .arg(invitation);
        Running::start(&mut command, scratch("join").join("log"))
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        // The cable goes with its end.
        let _ = Command::new("ip").args(["netns", "del", &self.name]).output();
        let _ = Command::new("ip").args(["link", "del", &self.cable("a")]).output();
    }
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

#[test]
#[ignore = "as root: it makes a network namespace for each member"]
fn a_class_of_twenty_gets_its_records_and_the_core_does_not_notice() {
    let near = Named::new();
    let _core = core(&near, &[]);
    let servers: Vec<String> = (1..=observers()).map(Line::server).collect();
    let keys = Keys::reached_at(&servers);
    let lines: Vec<Line> = (1..=observers()).map(|number| Line::new(number, None)).collect();
    let served = keys.serve_on(&near, "0.0.0.0");
    let invite =
        |(i, at): (usize, &String)| keys.invite_to(&format!("student-{i}"), Role::Observer, Validity::days(1), at);
    let invitations: Vec<_> = servers.iter().enumerate().map(invite).collect();
    let mut local = Host::new(&near);
    assert!(local.sees_the_core(Duration::from_secs(10)));
    // The p99 of each round: a bad one is not hidden among the others.
    let (mut without_us, mut with_us, mut shares) = (Vec::new(), Vec::new(), Vec::new());
    let mut wake = |length: Duration| {
        local.poll();
        local.taken.clear();
        until(length, || {
            local.poll();
            false
        });
        assert!(local.taken.len() > 500, "{} records", local.taken.len());
        let wakes = local.taken.iter().map(|r| r.wake_latency_ns as f64 * 1e-3);
        quantile(&mut wakes.collect::<Vec<f64>>(), 0.99)
    };
    for _ in 0..rounds() {
        without_us.push(wake(measured()));
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
        // All of them in each round: what waits for a host that is not polled is bounded.
        let all_see = until(Duration::from_secs(30), || {
            hosts.iter_mut().map(Host::sees_it_now).filter(|sees| *sees).count() == far.len()
        });
        assert!(all_see, "{}", served.log());
        for host in &mut hosts {
            host.poll();
            host.taken.clear();
        }
        with_us.push(wake(measured()));
        for host in &mut hosts {
            host.poll();
            let (first, last) = (
                host.taken.first().expect("records").tick,
                host.taken.last().expect("records").tick,
            );
            shares.push(host.taken.len() as f64 / (last - first + 1) as f64);
        }
        drop(hosts);
        drop(joined);
    }
    for (without, with) in without_us.iter().zip(&with_us) {
        println!(
            "wake-up p99 {without:.0} us without, {with:.0} us with: {:.2}",
            with / without
        );
    }
    let [quiet, busy] = [&mut without_us, &mut with_us].map(|p99s| quantile(p99s, 0.5));
    let least = shares.iter().copied().fold(1.0, f64::min);
    println!(
        "{} members: at least {:.4} % of the records each; wake-up p99 {quiet:.0} us without, {busy:.0} us with, medians of the rounds: {:.2}",
        lines.len(),
        100.0 * least,
        busy / quiet
    );
    assert!(least >= 0.999, "{shares:?}");
}
