//! Limits of a PC are raised, or reported; and totals survive a reset.

use std::os::unix::process::CommandExt;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use stylet_shm_schema::Request;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, fresh_instance, program, scratch, until};

/// Returns the first core that this process may use.
fn first_core() -> String {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
    let list = list.expect("a list of cores").trim();
    list.split([',', '-']).next().expect("one at least").to_owned()
}

/// Runs briefly with these soft and hard limits; the hard one stays for `None`.
fn limited(resource: libc::__rlimit_resource_t, soft: u64, hard: Option<u64>, options: &[&str]) -> Output {
    let instance = fresh_instance();
    let mut command = Command::new(program("rt-core"));
    let mut limit = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: `limit` is valid for writes.
    assert_eq!(unsafe { libc::getrlimit(resource, &mut limit) }, 0);
    (limit.rlim_cur, limit.rlim_max) = (soft, hard.unwrap_or(limit.rlim_max));
    let set = move || {
        // SAFETY: `limit` is valid for reads.
        match unsafe { libc::setrlimit(resource, &limit) } {
            0 => Ok(()),
            _ => Err(std::io::Error::last_os_error()),
        }
    };
    // SAFETY: between fork and exec it only makes a system call.
    unsafe { command.pre_exec(set) };
    let mut child = command
        .args(["--no-rt", "--exit-with-parent", "--instance", instance.name()])
        .args(["--flight-dir", scratch(instance.name()).to_str().expect("words")])
        .args(options)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("rt-core starts");
    let ended = until(Duration::from_secs(2), || matches!(child.try_wait(), Ok(Some(_))));
    if !ended {
        // SAFETY: a child of ours that has not been waited for.
        unsafe { libc::kill(child.id() as libc::pid_t, libc::SIGINT) };
    }
    let output = child.wait_with_output().expect("ours");
    instance.sweep();
    output
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn few_open_files_are_raised_or_named() {
    let raised = limited(libc::RLIMIT_NOFILE, 24, None, &[]);
    assert!(raised.status.success(), "{}", said(&raised));
    let named = limited(libc::RLIMIT_NOFILE, 56, Some(56), &[]);
    assert_eq!(named.status.code(), Some(1), "{}", said(&named));
    assert!(said(&named).contains("may open 56 files and needs"), "{}", said(&named));
}

/// It used to be killed by SIGXFSZ without a message.
#[test]
fn short_files_are_named_and_end_nothing_by_a_signal() {
    let named = limited(libc::RLIMIT_FSIZE, 100 << 10, Some(100 << 10), &[]);
    assert_eq!(named.status.code(), Some(1), "{}", said(&named));
    assert!(said(&named).contains("may be 100 KiB long"), "{}", said(&named));
}

#[test]
fn a_tissue_priority_above_the_force_loops_is_refused_on_a_shared_core() {
    let refused = |task: &[&str]| {
        let core = first_core();
        let output = Command::new(program("rt-core"))
            .args(task)
            .args(["--haptic-core", &core, "--tissue-core", &core])
            .args(["--haptic-priority", "10", "--tissue-priority", "98"])
            .output()
            .expect("rt-core starts");
        (output.status.code(), said(&output))
    };
    let out = scratch("limits-latency");
    let latency = ["latency", "--duration", "1s", "--out", out.to_str().expect("words")];
    for task in [&[][..], &latency] {
        let (code, why) = refused(task);
        assert!(
            code == Some(1) && why.contains("--tissue-priority 98: the tissue step shares core"),
            "{why}"
        );
    }
}

/// After a stall and a re-arm the final report knew of neither.
#[test]
fn a_standstill_stays_in_the_report_after_a_reset_and_a_rearm() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        ask(&mut link, &Request::Engage).expect("armed");
        let send = |signal| {
            // SAFETY: a child of ours that has not been waited for.
            assert_eq!(unsafe { libc::kill(core.id() as libc::pid_t, signal) }, 0);
        };
        send(libc::SIGSTOP);
        std::thread::sleep(Duration::from_millis(1500));
        send(libc::SIGCONT);
        assert!(until(Duration::from_secs(10), || ask(&mut link, &Request::Reset).is_ok()));
        assert!(until(Duration::from_secs(10), || ask(&mut link, &Request::Engage).is_ok()));
        std::thread::sleep(Duration::from_millis(100));
        drop(link);
        let report = core.finish();
        for of_loop in ["haptic", "tissue"] {
            let of = |name: &str| report[of_loop][name].as_f64().expect("a number");
            assert!(of("worst_wake_us") > 1.4e6, "{report}");
            assert!(of("worst_wake_since_armed_us") < of("worst_wake_us"), "{report}");
            assert!(of("missed_deadlines") > of("missed_deadlines_since_armed"), "{report}");
        }
    });
}
