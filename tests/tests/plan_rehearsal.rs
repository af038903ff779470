//! A rehearsal says what the live run does: same scene, same needle, seeds within a stated bound; and it disturbs nothing.

use host_ui::link::Link;
use host_ui::plan::rehearse::{Drops, LinkRehearser, Rehearser};
use host_ui::workflow::{NeedleTask, Pace, Run, RunStatus, default_plan};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use stylet_shm_schema::{CommandKind, Fault};
use stylet_tests::{Core, ask, until};

/// Live and rehearsed seeds agree within this. The live hand drops a seed when the host's poll, the bridge and the tissue tick have
/// their turn, some milliseconds earlier or later, while the tissue recovers.
const AGREE_M: f64 = 0.1e-3;

fn live(link: &mut Link, task: &NeedleTask) -> Vec<[f64; 3]> {
    let mut run = Run::of_needles(vec![task.clone()], Pace::default());
    let mut status = RunStatus::Working;
    let ended = until(Duration::from_secs(120), || {
        link.poll();
        link.take_records();
        status = run.advance(link);
        status != RunStatus::Working
    });
    assert!(ended && status == RunStatus::Done, "{status:?}");
    let header = &link.snapshot().expect("live").header;
    let placed = &header.seeds[..header.seed_count as usize];
    placed.iter().map(|s| s.position_m).collect()
}

fn apart_m(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// In each scene the default needle of the host: rehearsed, then done.
fn rehearsed_is_live(scene: &str) {
    let mut core = Core::start_with(&["--rt-if-allowed", "--scene", scene]);
    let mut link = core.host();
    let plan = default_plan(&link.scene().expect("live").header);
    let task = NeedleTask::as_planned(plan);
    let stop = AtomicBool::new(false);
    let mut rehearser = LinkRehearser {
        link: &mut link,
        interrupted: &stop,
    };
    let rest = rehearser.rehearse(&task.drops, &Pace::default()).expect("goes through");
    let placed = live(&mut link, &task);
    assert_eq!(placed.len(), rest.seeds_m.len());
    let planned = task.plan.deepest_first();
    for (i, (live, rehearsed)) in placed.iter().zip(&rest.seeds_m).enumerate() {
        let (off, error) = (apart_m(live, rehearsed), apart_m(live, &planned[i]));
        println!(
            "{scene}, seed {}: {:.3} mm from plan, rehearsal off by {:.3} mm",
            i + 1,
            error * 1e3,
            off * 1e3
        );
        assert!(off < AGREE_M, "seed {}: {live:?} live, {rehearsed:?} rehearsed", i + 1);
    }
    let peak = link.state().expect("live").peak_force_n;
    println!(
        "{scene}: peak force {peak:.3} N live, {:.3} N rehearsed",
        rest.peak_force_n
    );
    assert!((peak - rest.peak_force_n).abs() < 0.1 * peak);
}

#[test]
fn the_default_needle_of_the_paper_s_gland_ends_where_it_was_rehearsed() {
    rehearsed_is_live("paper");
}

#[test]
fn the_default_needle_of_the_pelvis_ends_where_it_was_rehearsed() {
    rehearsed_is_live("pelvis");
}

#[test]
fn one_rehearsal_at_a_time_and_the_run_does_not_notice() {
    let mut core = Core::start();
    let mut link = core.host();
    let plan = default_plan(&link.scene().expect("live").header);
    let drops: Drops = NeedleTask::as_planned(plan).drops;
    let values = drops.values(&Pace::default());
    let first = link.send(CommandKind::Rehearse, &values).expect("sent");
    let second = link.send(CommandKind::Rehearse, &values).expect("sent");
    let (mut one, mut other) = (None, None);
    until(Duration::from_secs(30), || {
        link.poll();
        one = one.take().or_else(|| link.reply(first));
        other = other.take().or_else(|| link.reply(second));
        one.is_some() && other.is_some()
    });
    let (one, other) = (one.expect("answered"), other.expect("answered"));
    assert!(one.accepted, "{}", one.text);
    assert!(
        !other.accepted && other.text.contains("another rehearsal"),
        "{}",
        other.text
    );
    assert_eq!(link.rehearsal(first).map(|r| r.seed_count), Some(5));
    assert!(link.rehearsal(second).is_none());

    let state = *link.state().expect("live");
    assert_eq!(
        (state.fault, state.seed_count),
        (Fault::None as u32, 0),
        "the live tissue has no seed"
    );
    let mut outside = values.clone();
    outside[13] = outside[2] - 0.05;
    let why = ask(&mut link, CommandKind::Rehearse, &outside).expect_err("nothing to drop a seed into");
    assert!(why.contains("outside the tissue"), "{why}");
    assert!(ask(&mut link, CommandKind::Rehearse, &values[..9]).is_err());
    ask(&mut link, CommandKind::Rehearse, &values).expect("the next one goes");
}
