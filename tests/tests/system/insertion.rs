//! One insertion through both processes: gland, force and seeds behave as the paper describes.

use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::{Pace, Run, RunStatus, default_plan};
use stylet_shm_schema::{Phase, TickRecord, flags};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, until};

/// A host's view of a whole procedure.
struct Seen {
    records: Vec<TickRecord>,
    worst_residual: f64,
    snapshots: u64,
    largest_displacement_before_puncture_m: f64,
}

fn run_procedure(link: &mut Link) -> Seen {
    let plan = default_plan(&link.scene().expect("a live core has a scene").header);
    let mut run = Run::new(plan, Pace::default());
    let mut seen = Seen {
        records: Vec::new(),
        worst_residual: 0.0,
        snapshots: 0,
        largest_displacement_before_puncture_m: 0.0,
    };
    let (mut status, mut last_tick) = (RunStatus::Working, 0);
    let ended = until(Duration::from_secs(120), || {
        link.poll();
        seen.records.append(&mut link.take_records());
        if let Some(snapshot) = link.snapshot()
            && snapshot.header.tissue_tick != last_tick
        {
            last_tick = snapshot.header.tissue_tick;
            seen.snapshots += 1;
            seen.worst_residual = seen.worst_residual.max(snapshot.header.residual);
            if snapshot.header.phase == Phase::Contraction as u32 {
                seen.largest_displacement_before_puncture_m = seen
                    .largest_displacement_before_puncture_m
                    .max(snapshot.header.max_displacement_m);
            }
        }
        status = run.advance(link);
        !matches!(status, RunStatus::Working)
    });
    assert!(ended, "the procedure did not end");
    assert!(matches!(status, RunStatus::Done), "the procedure failed: {status:?}");
    seen.records.append(&mut link.take_records());
    seen
}

#[test]
fn an_insertion_moves_the_gland_peaks_at_puncture_and_misplaces_seeds() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let seen = run_procedure(&mut link);
        let state = *link.state().expect("live");

        assert!(
            state.worst_residual <= 1e-3,
            "a tissue tick left {} element",
            state.worst_residual
        );
        assert!(seen.snapshots > 100, "{} snapshots", seen.snapshots);
        let moved_mm = seen.largest_displacement_before_puncture_m * 1e3;
        assert!(moved_mm > 2.0, "the gland moved {moved_mm} mm before puncture");

        let force = |r: &TickRecord| r.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        let puncture = seen
            .records
            .iter()
            .position(|r| r.flags & flags::PUNCTURED != 0)
            .expect("the membrane gave way");
        let before = seen.records[..puncture].iter().map(force).fold(0.0, f64::max);
        let after = seen.records[puncture + 20..puncture + 60]
            .iter()
            .map(force)
            .fold(0.0, f64::max);
        println!("force before puncture {before:.2} N, after {after:.2} N; gland moved {moved_mm:.2} mm");
        assert!(
            before > 3.0 && after < 0.7 * before,
            "before {before} N, after {after} N"
        );
        let largest = seen.records.iter().map(force).fold(0.0, f64::max);
        assert!(
            largest <= state.device_limit_n + 1e-9,
            "{largest} N is over the device's limit"
        );

        let snapshot = link.snapshot().expect("live");
        let plan = link.plan().expect("planned");
        assert_eq!(snapshot.header.seed_count, 5);
        let mut sum_mm = 0.0;
        for i in 0..5 {
            let (p, s) = (plan.seeds[i].position_m, snapshot.header.seeds[i].position_m);
            let error_mm = (0..3).map(|a| (p[a] - s[a]).powi(2)).sum::<f64>().sqrt() * 1e3;
            println!("seed {i}: {error_mm:.2} mm");
            assert!(error_mm < 10.0, "seed {i} ended {error_mm} mm from plan");
            sum_mm += error_mm;
        }
        assert!(
            sum_mm / 5.0 > 1.0,
            "the seeds ended {} mm from plan on average",
            sum_mm / 5.0
        );
        drop(link);
        core.finish();
    });
}

#[test]
fn every_tick_has_its_record() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        link.take_records();
        let mut records: Vec<TickRecord> = Vec::new();
        until(Duration::from_secs(3), || {
            link.poll();
            records.append(&mut link.take_records());
            false
        });
        assert!(records.len() > 1000, "{} records in 3 s", records.len());
        for pair in records.windows(2) {
            assert_eq!(pair[1].tick, pair[0].tick + 1, "a record is missing");
            let periods = u64::from(pair[1].missed) + 1;
            assert_eq!(
                pair[1].due_ns - pair[0].due_ns,
                periods * 1_000_000,
                "the grid kept its phase"
            );
        }
        assert_eq!(link.state().expect("live").records_lost, 0);
    });
}
