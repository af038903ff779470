//! A fault requires a decision: a script does not turn the force on again unless asked to.

use std::process::Command;
use std::time::Duration;
use stylet_shm_schema::{Fault, Request};
use stylet_tests::stopped::StoppedThread;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, program, scratch, until};

const LONG: Duration = Duration::from_secs(30);

#[test]
fn a_procedure_does_not_begin_while_a_fault_stands_unless_it_may_rearm() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        ask(&mut link, &Request::Engage).expect("armed");
        let out = scratch(&format!("rearm-{}", core.instance.name()));
        let figures = out.join("health.prom");
        let mut health = Command::new(program("host-ui"))
            .args(["health", "--instance", core.instance.name(), "--openmetrics"])
            .arg(&figures)
            .spawn()
            .expect("host-ui starts");
        // Of a counter or a gauge; 0 before the file is there.
        let figure = |name: &str| -> f64 {
            let text = std::fs::read_to_string(&figures).unwrap_or_default();
            let line = text.lines().find(|l| l.starts_with(name));
            line.and_then(|l| l.rsplit(' ').next()?.parse().ok()).unwrap_or(0.0)
        };
        assert!(until(LONG, || figure("stylet_ticks_total") > 0.0));
        let stopped = StoppedThread::stop(core.id(), "tissue");
        let fault = Fault::TissueStale as u32;
        let mut fault_is = |fault: u32| {
            until(LONG, || {
                link.poll();
                link.state().is_some_and(|s| s.fault == fault)
            })
        };
        assert!(fault_is(fault));
        drop(stopped);
        let procedure = |name: &str| {
            let mut command = Command::new(program("host-ui"));
            command.args(["procedure", "--instance", core.instance.name(), "--out"]);
            command.arg(out.join(name));
            command
        };
        let refused = procedure("refused").output().expect("host-ui starts");
        let why = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(1), "{why}");
        assert!(
            why.contains("only a person re-arms") && why.contains("--rearm"),
            "{why}"
        );
        assert!(fault_is(fault), "it re-armed by itself");
        let mut allowed = procedure("allowed").arg("--rearm").spawn().expect("host-ui starts");
        let armed = fault_is(0);
        let counted = until(LONG, || figure("stylet_rearms_total") == 1.0);
        let (ticks, faults, all) = (
            figure("stylet_ticks_total"),
            figure("stylet_faults_total"),
            figure("stylet_tick_success_ratio"),
        );
        let goes_on = until(LONG, || figure("stylet_ticks_total") > ticks + 500.0);
        health.kill().expect("ours");
        health.wait().expect("ours");
        allowed.kill().expect("ours");
        allowed.wait().expect("ours");
        assert!(armed, "--rearm is the word for it");
        assert!(
            counted && goes_on,
            "{}",
            std::fs::read_to_string(&figures).unwrap_or_default()
        );
        assert!(
            faults == 1.0 && ticks > 500.0 && all > 0.0,
            "{faults} faults, {ticks} ticks, success {all}"
        );
    });
}
