//! A rehearsal says what the live run does: same scene, same needle, seeds within a stated bound; and it disturbs nothing.

use host_ui::link::Link;
use host_ui::plan::rehearse::{Drops, LinkRehearser, Rehearser};
use host_ui::workflow::{NeedleTask, Pace, Run, RunStatus, default_plan};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use stylet_shm_schema::script::arrived_after;
use stylet_shm_schema::{CommandKind, EventKind, Fault, HapticState, TickRecord, flags};
use stylet_tests::{Core, ask, until};

/// Live and rehearsed seeds agree within this, and what two live runs differ by themselves.
const AGREE_M: f64 = 0.1e-3;
/// The tissue looks where the tip is every 5 ms and takes hold then: at which moment between two looks the tip meets it is chance.
const TISSUE_PERIOD_S: f64 = 5e-3;
/// While a hand that is late waits, the tissue recovers, in this time by 63 % (`tissue.recovery_time`) of at most what it gave
/// before puncture.
const RECOVERY_S: f64 = 1.0;
/// From the decision to drop until the tissue's tick.
const IN_TIME_TICKS: u64 = 10;

/// Where each seed came to rest, and how many ticks late it was dropped.
struct Live {
    seeds_m: Vec<[f64; 3]>,
    late_ticks: Vec<u64>,
    /// How far, until each drop, the time of the tissue and that of the hand have come apart: either loop may miss deadlines on a
    /// busy machine, and then stands still.
    skew_s: Vec<f64>,
}

fn live(link: &mut Link, task: &NeedleTask) -> Live {
    let mut run = Run::of_needles(vec![task.clone()], Pace::default());
    let (mut status, mut records) = (RunStatus::Working, Vec::new());
    let ended = until(Duration::from_secs(120), || {
        link.poll();
        records.append(&mut link.take_records());
        status = run.advance(link);
        status != RunStatus::Working
    });
    assert!(ended && status == RunStatus::Done, "{status:?}");
    let header = &link.snapshot().expect("live").header;
    let placed = &header.seeds[..header.seed_count as usize];
    let is_drop = |e: &&stylet_shm_schema::Event| e.kind == EventKind::SeedDropped as u32;
    let drops: Vec<u64> = link.events().iter().filter(is_drop).map(|e| e.time_ns).collect();
    let late = |(number, &dropped_ns): (usize, &u64)| {
        let after_ns = number.checked_sub(1).map_or(0, |before| drops[before]);
        let since = records.iter().skip_while(|r: &&TickRecord| r.due_ns <= after_ns);
        let decided_ns = decided_ns(since, &task.drops, number).unwrap_or(dropped_ns);
        (dropped_ns.saturating_sub(decided_ns) / 1_000_000).saturating_sub(IN_TIME_TICKS)
    };
    let skew = |dropped_ns: &u64| {
        let until = |r: &&TickRecord| r.due_ns <= *dropped_ns;
        let touched: Vec<&TickRecord> = records
            .iter()
            .take_while(until)
            .skip_while(|r| r.flags & flags::IN_CONTACT == 0)
            .collect();
        let (Some(first), Some(last)) = (touched.first(), touched.last()) else {
            return 0.0;
        };
        let (hand_s, tissue_s) = (
            touched.len() as f64 * 1e-3,
            (last.tissue_tick - first.tissue_tick) as f64 * 5e-3,
        );
        // A tissue tick may fall on either side at both ends.
        ((hand_s - tissue_s).abs() - 10e-3).max(0.0)
    };
    Live {
        skew_s: drops.iter().map(skew).collect(),
        seeds_m: placed.iter().map(|s| s.position_m).collect(),
        late_ticks: drops.iter().enumerate().map(late).collect(),
    }
}

/// When the rule says that the tip has arrived at a drop, tick by tick.
fn decided_ns<'a>(records: impl Iterator<Item = &'a TickRecord>, drops: &Drops, number: usize) -> Option<u64> {
    let mut since_ns = None;
    for r in records {
        let off = |a: usize| (r.tip_in_scene_m[a] - drops.entry_m[a]) * drops.direction[a];
        let mut state: HapticState = bytemuck::Zeroable::zeroed();
        (state.speed_m_per_s, state.depth_m, state.flags) = (r.speed_m_per_s, r.depth_m, r.flags);
        match arrived_after(&state, (0..3).map(off).sum::<f64>() - drops.along_m[number]) {
            None => since_ns = None,
            Some(long) => {
                if u128::from(r.due_ns - *since_ns.get_or_insert(r.due_ns)) >= long.as_nanos() {
                    return Some(r.due_ns);
                }
            }
        }
    }
    None
}

fn apart_m(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// The default needle of the host: rehearsed, then done.
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
    assert_eq!(
        (placed.seeds_m.len(), placed.late_ticks.len()),
        (rest.seeds_m.len(), rest.seeds_m.len())
    );
    let planned = task.plan.deepest_first();
    for (i, (live, rehearsed)) in placed.seeds_m.iter().zip(&rest.seeds_m).enumerate() {
        let (off, error) = (apart_m(live, rehearsed), apart_m(live, &planned[i]));
        let late_s = placed.late_ticks[..=i].iter().sum::<u64>() as f64 * 1e-3 + placed.skew_s[i];
        let bound = AGREE_M
            + Pace::default().insert_m_per_s * TISSUE_PERIOD_S
            + rest.displacement_before_puncture_m * late_s / RECOVERY_S;
        println!(
            "{scene}, seed {}: {:.3} mm from plan, rehearsal off by {:.3} mm, dropped {} ms late, loops {:.0} ms apart",
            i + 1,
            error * 1e3,
            off * 1e3,
            placed.late_ticks[i],
            placed.skew_s[i] * 1e3
        );
        assert!(
            off < bound,
            "seed {}: {live:?} live, {rehearsed:?} rehearsed, bound {bound} m",
            i + 1
        );
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
