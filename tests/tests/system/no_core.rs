//! A command for a core that does not run fails soon: it used to look for one for 3 s.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Alone, Core, fresh_instance, program, scratch};

/// Longest wait of an operator who has forgotten to start it.
const SOON: Duration = Duration::from_secs(2);

fn assert_says_so(instance: &str, command: &[&str]) {
    let begun = Instant::now();
    let output = Command::new(program("host-ui"))
        .args(command)
        .args(["--instance", instance])
        .stdin(Stdio::null())
        .output()
        .expect("host-ui runs");
    let (took, words) = (begun.elapsed(), String::from_utf8_lossy(&output.stderr).into_owned());
    println!("{command:?}: {took:?}");
    assert!(
        !output.status.success() && words.contains("Start it in another terminal"),
        "{words}"
    );
    assert!(took < SOON, "{command:?} took {took:?}");
}

#[test]
fn a_command_without_a_core_says_so_within_two_seconds() {
    where_the_machine_runs(|| {
        let file = scratch("no-core").join("session.mcap");
        let recorded = ["record", "--out", file.to_str().expect("UTF-8")];
        let alone = Alone(fresh_instance());
        for command in [&["procedure"] as &[&str], &["flight"], &recorded] {
            assert_says_so(alone.0.name(), command);
        }
        // The remains of a killed core are not a core.
        let mut core = Core::start();
        drop(core.host());
        let killed = Alone(core.kill());
        assert_says_so(killed.0.name(), &["procedure"]);
    });
}
