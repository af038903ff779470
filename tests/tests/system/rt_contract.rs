//! After arming, no real-time thread allocates or faults a page, over thousands of ticks of each, with a procedure
//! running.

use std::time::Duration;
use stylet_implant::workflow::{Pace, Run, RunStatus, default_plan};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, until};

#[test]
fn armed_threads_make_no_heap_call_and_fault_no_page() {
    where_the_machine_runs(|| {
        the_loops_keep_their_contract(&["--rt-if-allowed"], 10_000);
    });
}

/// Lines arrive in both loops while they run, and are returned to be freed.
#[test]
fn armed_threads_make_no_heap_call_and_fault_no_page_with_finite_elements() {
    where_the_machine_runs(|| {
        the_loops_keep_their_contract(&["--rt-if-allowed", "--tissue", "fem"], 4_000);
    });
}

/// The third thread, before any motion or contact, keeps the same contract.
#[test]
fn armed_threads_make_no_heap_call_and_fault_no_page_with_a_second_device() {
    where_the_machine_runs(|| {
        the_loops_keep_their_contract(&["--rt-if-allowed", "--device-2", "simulated"], 4_000);
    });
}

fn the_loops_keep_their_contract(options: &[&str], ticks: u64) {
    let mut core = Core::start_with(options);
    let mut link = core.host();
    let plan = || default_plan(&link.scene().expect("live").header);
    let mut run = Run::new(plan(), Pace::default());
    let again = plan();
    // The tissue loop makes 200 ticks a second.
    until(Duration::from_secs(120), || {
        link.poll();
        link.take_records();
        if run.advance(&mut link) != RunStatus::Working {
            run = Run::new(again.clone(), Pace::default());
        }
        link.state()
            .is_some_and(|s| s.tick > ticks + 500 && s.tissue_tick > ticks + 50)
    });
    drop(link);
    let report = core.finish();
    println!("{report:#}");
    let third = options.contains(&"--device-2").then_some("second");
    for thread in ["haptic", "tissue"].into_iter().chain(third) {
        let count = |what: &str| report[thread][what].as_u64().expect("a count");
        assert!(count("ticks") > ticks, "{thread}: {} ticks", count("ticks"));
        assert_eq!(count("heap_calls"), 0, "{thread} called the heap");
        assert_eq!(count("major_faults"), 0, "{thread} read a page from disk");
        // Without the right to lock memory the kernel may take pages away.
        if report[thread]["policy"] == 1 {
            assert_eq!(count("minor_faults"), 0, "{thread} faulted a page");
        }
    }
}

/// A closure between a kernel and its vectors is enough for an instruction to become a call, several times as slow.
#[test]
#[cfg(target_arch = "x86_64")]
fn vector_instructions_are_inlined() {
    let listing = std::process::Command::new("objdump")
        .args(["--disassemble", "--demangle", "--no-show-raw-insn"])
        .arg(stylet_test_kit::program("rt-core"))
        .output()
        .expect("binutils");
    let listing = String::from_utf8_lossy(&listing.stdout);
    assert!(listing.contains("<stylet_sim::"), "no names");
    let mut within = "";
    let mut calls = std::collections::BTreeSet::new();
    for line in listing.lines() {
        if line.ends_with(">:") {
            within = line;
        } else if line.contains("call") && line.contains("core_arch") && line.contains("mm") {
            let is_ours = within.contains("<stylet_") || within.contains("<core::array");
            calls.extend(is_ours.then_some(within));
        }
    }
    assert!(calls.is_empty(), "{calls:#?}");
}
