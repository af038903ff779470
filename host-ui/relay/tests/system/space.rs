//! Network namespaces with a cable each, which no test leaves behind: a test ended by a signal removes them, and the
//! next start removes those of a killed one.

use crate::fixture::{Named, Running, code, scratch};
use std::path::Path;
use std::process::Command;
use std::sync::Once;

/// Prefix of every namespace; the process that made it and a number follow.
const PREFIX: &str = "stylet";

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

/// A namespace with a cable to this one; removed when dropped.
pub struct Line {
    name: String,
    number: usize,
}

impl Line {
    /// Makes a line of `rate` each way, in the words of `tc`, or unlimited.
    pub fn new(number: usize, rate: Option<&str>) -> Self {
        static TIDY: Once = Once::new();
        TIDY.call_once(|| {
            sweep(|pid| !Path::new(&format!("/proc/{pid}")).exists());
            sweep_on_signals();
        });
        let process = std::process::id();
        let line = Self {
            name: format!("{PREFIX}{process}-{number}"),
            number,
        };
        let (name, here, there) = (&line.name, cable(process, number, "a"), cable(process, number, "b"));
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

    /// Address at which the namespace of that number reaches this one.
    pub fn server(number: usize) -> String {
        format!("10.77.{number}.1")
    }

    pub fn join(&self, invitation: &Path, named: &Named) -> Running {
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
        Running::start_with(&mut command, code(invitation).into(), scratch("join").join("log"))
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        remove(&self.name, std::process::id(), self.number);
    }
}

/// Names of interfaces have at most 15 letters.
fn cable(process: u32, number: usize, end: &str) -> String {
    format!("st{}{end}{number}", process % 100_000)
}

fn remove(name: &str, process: u32, number: usize) {
    let _ = Command::new("ip").args(["netns", "del", name]).output();
    // A namespace in which a process still runs keeps its end of the cable.
    let _ = Command::new("ip")
        .args(["link", "del", &cable(process, number, "a")])
        .output();
}

/// Name, process and number of each namespace made by such a test.
fn spaces() -> Vec<(String, u32, usize)> {
    let listed = Command::new("ip").args(["netns", "list"]).output();
    let listed = listed.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let of_line = |line: &str| {
        let name = line.split_whitespace().next()?;
        let (process, number) = name.strip_prefix(PREFIX)?.split_once('-')?;
        Some((name.to_owned(), process.parse().ok()?, number.parse().ok()?))
    };
    listed.unwrap_or_default().lines().filter_map(of_line).collect()
}

/// Removes the namespaces of the selected processes.
fn sweep(is_meant: impl Fn(u32) -> bool) {
    for (name, process, number) in spaces() {
        if is_meant(process) {
            remove(&name, process, number);
        }
    }
}

/// Removes this process's namespaces before a signal ends it.
fn sweep_on_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGHUP, SIGINT, SIGTERM]).expect("handlers");
    std::thread::spawn(move || {
        for signal in signals.forever() {
            sweep(|pid| pid == std::process::id());
            let _ = signal_hook::low_level::emulate_default_handler(signal);
        }
    });
}

mod tests {
    use super::*;
    use crate::fixture::until;
    use std::time::Duration;

    const HELD: &str = "STYLET_RELAY_HOLD_A_LINE";

    fn has_spaces_of(process: u32) -> bool {
        spaces().iter().any(|(_, its, _)| *its == process)
    }

    /// Runs this program again, holding a namespace.
    fn holder() -> Running {
        let mut command = Command::new(std::env::current_exe().expect("this program"));
        command
            .args(["--ignored", "--exact", "space::tests::a_line_that_is_held"])
            .env(HELD, "1");
        let running = Running::start(&mut command, scratch("holder").join("log"));
        let made = until(Duration::from_secs(10), || has_spaces_of(running.child.id()));
        assert!(made, "{}", running.log());
        running
    }

    #[test]
    #[ignore = "as root: the other process of the next test, and nothing alone"]
    fn a_line_that_is_held() {
        if std::env::var_os(HELD).is_some() {
            let _line = Line::new(200, None);
            std::thread::sleep(Duration::from_secs(60));
        }
    }

    /// Twenty namespaces of a killed class used to stay until they were removed by hand.
    #[test]
    #[ignore = "as root: it makes network namespaces"]
    fn lines_go_with_their_test_or_if_it_was_killed_with_the_next() {
        let mut ended = holder();
        let process = ended.child.id();
        ended.signal(libc::SIGTERM);
        let _ = ended.child.wait();
        assert!(!has_spaces_of(process), "after SIGTERM");

        let mut killed = holder();
        let process = killed.child.id();
        killed.signal(libc::SIGKILL);
        let _ = killed.child.wait();
        assert!(has_spaces_of(process), "nothing can remove them yet");
        let next = holder();
        assert!(!has_spaces_of(process), "at the next start");
        let living = next.child.id();
        let another = holder();
        assert!(has_spaces_of(living), "of a test that runs");
        let pair = [living, another.child.id()];
        drop((next, another));
        assert!(!pair.into_iter().any(has_spaces_of));
    }
}
