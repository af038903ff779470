//! Changes of a plan during its execution.

use super::*;
use stylet_implant::plan::{Hole, Row};
use stylet_shm_schema::MAX_SEEDS;

fn hole(name: &str) -> Hole {
    name.parse().expect("a hole")
}

/// Creates two needles of two seeds each, 80 and 70 mm deep.
pub(crate) fn planned() -> ImplantPlan {
    let template = Template {
        middle_m: [0.05, 0.05, -0.01],
        columns: [-1.0, 0.0, 0.0],
        rows: [0.0, 1.0, 0.0],
        inwards: [0.0, 0.0, 1.0],
        pitch_m: 5e-3,
    };
    let plan = ImplantPlan {
        template,
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        needles: Vec::new(),
    };
    let plan = plan.with_needle(hole("E7"), 0.08).unwrap();
    let plan = plan.with_strand(0, 2, 0.08, 0.5).unwrap();
    let plan = plan.with_needle(hole("I7"), 0.08).unwrap();
    plan.with_strand(1, 2, 0.08, 0.5).unwrap()
}

pub(crate) fn planner() -> Planner {
    let mut planner = Planner::default();
    planner.put(planned());
    planner.show();
    planner
}

/// Returns the planning state after a frame.
pub(crate) fn planning(planner: &mut Planner) -> Planning {
    planner.show();
    planner.planning()
}

#[test]
fn only_needles_not_yet_inserted_can_be_changed() {
    let mut planner = planner();
    planner.edit(|plan| plan.with_needle_at(0, hole("F7")));
    planner.begin_needle(0, 0);
    let before = planner.plan().cloned();
    planner.edit(|plan| plan.without_needle(0));
    assert!(planner.take_message().is_some_and(|message| message.refused));
    planner.undo();
    assert!(
        planner.take_message().is_some_and(|message| message.refused),
        "it would move the needle"
    );
    assert_eq!(planner.plan().cloned(), before);
    planner.edit(|plan| plan.without_needle(1));
    assert_eq!(planner.take_message(), None);
    planner.undo();
    assert_eq!(planner.plan().cloned(), before);
}

#[test]
fn more_seeds_than_the_core_can_hold_are_refused() {
    let mut planner = planner();
    let row = Row {
        count: MAX_SEEDS,
        deepest_m: 0.08,
        pitch_m: 5e-3,
        stranded: false,
        strength_u: 0.5,
    };
    planner.set_row(0, row);
    assert!(planner.take_message().is_some_and(|message| message.refused));
    assert_eq!(planner.plan(), Some(&planned()));
}

/// Returns a compensation that drops the first seed 2 mm deeper.
fn deeper(needle: &Needle) -> Compensation {
    let mut drops = Drops::as_planned(needle);
    drops.along_m[0] += 2e-3;
    Compensation {
        drops,
        before_m: None,
        after_m: vec![[0.0; 3]; 2],
        rehearsals: 1,
        for_edges: 0,
        sensitive: Vec::new(),
    }
}

/// Returns everything that belongs to the plan.
fn all_of(
    planner: &Planner,
) -> (
    Option<History<ImplantPlan>>,
    Vec<(Needle, Compensation)>,
    NeedleProgress,
) {
    let parts = (&planner.history, &planner.compensated, &planner.planning.progress);
    (parts.0.clone(), parts.1.clone(), parts.2.clone())
}

/// Creates a planner with an undone step, a rehearsal, and a needle that is done.
fn inserting() -> Planner {
    let mut planner = planner();
    planner.edit(|plan| plan.with_needle_at(1, hole("J7")));
    planner.undo();
    let needle = planned().needles[1].clone();
    planner.compensated.push((needle.clone(), deeper(&needle)));
    planner.begin_needle(0, 0);
    planner.finish_needle(2);
    planner
}

#[test]
fn a_discarded_plan_is_restored_as_it_was() {
    let mut planner = inserting();
    let before = all_of(&planner);
    assert!(!planner.planning().can_restore);
    planner.discard();
    assert_eq!(planner.plan(), None);
    assert!(planning(&mut planner).implant.is_none() && planner.planning().can_restore);
    assert_eq!(planner.progress(), &NeedleProgress::default());
    assert!(planner.restore());
    assert_eq!(all_of(&planner), before);
    assert!(!planner.restore(), "there is a plan");
}

#[test]
fn a_plan_returns_with_its_scene_to_new_tissue() {
    use bytemuck::Zeroable;
    let scene = |name: &str| {
        let mut header = stylet_shm_schema::SceneHeader::zeroed();
        header.name = stylet_shm_schema::Text::new(name);
        Arc::new(SceneModel::new(header, Vec::new(), Vec::new(), Vec::new()))
    };
    let mut planner = inserting();
    planner.of_scene = Some(("paper".to_owned(), [0.0; 3]));
    let (history, compensated, _) = all_of(&planner);
    planner.take_scene(&scene("pelvis"));
    assert_eq!(planner.plan(), None);
    assert!(planner.take_message().is_some_and(|note| !note.refused));
    assert!(!planner.planning().can_restore, "of another scene");
    planner.take_scene(&scene("paper"));
    assert_eq!(all_of(&planner), (history, compensated, NeedleProgress::default()));
}

#[test]
fn rehearsals_hold_in_the_same_body_with_a_note_under_another_core() {
    let mut planner = inserting();
    planner.body = Some((7, 1));
    planner.meet_body(7, 1);
    assert!(planner.take_message().is_none());
    planner.meet_body(7, 2);
    assert_eq!(planner.compensated.len(), 1);
    assert!(planner.take_message().is_some_and(|note| !note.refused));
    planner.meet_body(8, 2);
    assert!(planner.compensated.is_empty() && planner.take_message().is_none());
}

#[test]
fn a_rehearsal_holds_until_its_needle_changes() {
    let mut planner = planner();
    let needle = planned().needles[0].clone();
    let done = deeper(&needle);
    planner.compensated.push((needle, done));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.082);
    planner.edit(|plan| plan.with_needle_at(1, hole("J7")));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.082, "another needle");
    planner.edit(|plan| plan.with_needle_at(0, hole("D7")));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.08);
    assert!(planner.compensated.is_empty());
}

#[test]
fn a_proposal_is_taken_as_one_change_and_goes_with_the_plan() {
    use crate::app::tests::fixture::proposals;
    let mut planner = planner();
    let of = planned();
    let all = proposals(&of);
    planner.planning.proposals = Some(all.clone());
    planner.choose(2);
    assert_eq!(planner.plan(), Some(&all[2].found.plan));
    planner.undo();
    assert_eq!(planner.plan(), Some(&of));
    planner.choose(7);
    assert_eq!(planner.plan(), Some(&of), "there is no such proposal");
    // A needle that was inserted stays.
    planner.begin_needle(0, 0);
    planner.choose(0);
    assert_eq!(planner.plan(), Some(&of));
    assert!(planner.take_message().is_some_and(|message| message.refused));
    planner.discard();
    assert!(planner.planning().proposals.is_none());
}

/// Guards against remarks that stood only on standard error.
#[test]
fn remarks_on_an_imported_plan_are_shown() {
    let mut planner = Planner::default();
    let job = Job::begin("plan reader", |messages, _| {
        let notes = vec!["its technique is missing".to_owned()];
        let _ = messages.send(JobMessage::Plan(planned(), notes));
    });
    planner.job = Some(job);
    while planner.job.is_some() {
        planner.take_job();
    }
    let expected = Note::done("The plan was read: its technique is missing.".to_owned());
    assert_eq!(planner.take_message(), Some(expected));
}
