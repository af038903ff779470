//! Runs while a fault stands, and what removes an implant: the window asks, and nothing begins before the answer.

use super::fixture::{Drawn, one_needle};
use crate::action::{Action, PlanAction};
use crate::panel::question::Question;
use std::path::PathBuf;
use stylet_shm_schema::{Fault, Request, flags};

#[test]
fn a_run_asks_before_it_rearms() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    drawn.app.shown = one_needle(0.0, 0);
    if let Some(state) = &mut drawn.app.shown.state {
        (state.fault, state.flags) = (Fault::TissueStale as u32, flags::REAL_TIME);
    }
    let ctx = drawn.ctx.clone();
    for begin in [Action::RunAll, Action::StartOver] {
        drawn.app.act(begin.clone(), &ctx);
        assert!(drawn.app.run.is_none() && drawn.app.question.is_some(), "{begin:?}");
        drawn.place("Re-arm and run (Y)");
        drawn.place("Leave the force off (N)");
        drawn.app.act(Action::Answer(false), &ctx);
        assert!(drawn.app.run.is_none() && drawn.app.question.is_none(), "{begin:?}");
        drawn.app.act(begin, &ctx);
        drawn.app.act(Action::Answer(true), &ctx);
        assert!(drawn.app.run.take().is_some());
    }
    // Without a fault the window does not ask.
    if let Some(state) = &mut drawn.app.shown.state {
        state.fault = 0;
    }
    drawn.app.act(Action::RunAll, &ctx);
    assert!(drawn.app.run.is_some());
}

/// Guards against a click on "Reset", beside "Disengage", that removed 83 seeds.
#[test]
fn what_removes_seeds_says_so_and_waits_for_the_answer() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    let ctx = drawn.ctx.clone();
    let actions = [
        Action::Send(Request::Reset),
        Action::StartOver,
        Action::RunAll,
        Action::LoadBuiltinScene(0),
        Action::LoadScene(PathBuf::from("other.nrrd")),
    ];
    for action in actions {
        drawn.app.shown = one_needle(0.0, 5);
        drawn.app.act(action.clone(), &ctx);
        assert!(drawn.app.run.is_none(), "{action:?}");
        assert!(
            !drawn.app.shown.load.is_busy() && drawn.app.waiting.is_empty(),
            "{action:?}"
        );
        assert!(
            matches!(&drawn.app.question, Some(Question::Remove(_, asked)) if **asked == action),
            "{action:?}"
        );
        drawn.place("Keep the implant (N)");
        // Keys and buttons of controllers do not reach the implant before the answer.
        for action in [
            Action::DropSeed,
            Action::Redo,
            Action::Send(Request::Engage),
            Action::Insert,
        ] {
            drawn.app.act(action.clone(), &ctx);
            // Without a core each of them would be refused.
            assert!(
                drawn.app.shown.note.is_none() && drawn.app.question.is_some(),
                "{action:?}"
            );
        }
        let undone = match action {
            Action::Send(Request::Reset) => "Ctrl+Z restores the seeds until the next one is dropped.",
            _ => "This cannot be undone.",
        };
        let text =
            format!("This removes 5 seeds from the tissue. {undone} Plan and debrief are saved under out/ first.");
        drawn.place(&text);
        drawn.app.act(Action::Answer(false), &ctx);
        assert!(drawn.app.question.is_none() && drawn.app.run.is_none());
        drawn.app.shown = one_needle(0.0, 0);
        drawn.app.act(action.clone(), &ctx);
        assert!(drawn.app.question.is_none(), "{action:?} removes nothing");
        (drawn.app.run, drawn.app.shown.load) = (None, Default::default());
        drawn.app.waiting.clear();
    }
    // A run that continues keeps the seeds.
    drawn.app.shown = one_needle(0.0, 5);
    drawn.app.shown.continues_at = Some((1, 3));
    drawn.app.act(Action::RunAll, &ctx);
    assert!(drawn.app.question.is_none() && drawn.app.run.is_some());
}

#[test]
fn another_scene_asks_while_the_needle_is_in_the_tissue() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    let ctx = drawn.ctx.clone();
    for action in [
        Action::LoadBuiltinScene(0),
        Action::LoadScene(PathBuf::from("other.nrrd")),
    ] {
        drawn.app.shown = one_needle(0.03, 0);
        drawn.app.act(action, &ctx);
        drawn.place("The needle is in the tissue: another scene ends the insertion.");
        drawn.app.act(Action::Answer(false), &ctx);
    }
    // A reset only takes the needle's contact back.
    drawn.app.act(Action::Send(Request::Reset), &ctx);
    assert!(drawn.app.question.is_none());
}

/// Guards against the plan of one case that replaced that of another.
#[test]
fn a_plan_replaces_no_file_of_another_case_without_an_answer() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    let ctx = drawn.ctx.clone();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("case7.toml");
    std::fs::write(&path, "of another case").expect("written");
    let save = || Action::Plan(PlanAction::Export(path.clone()));
    drawn.app.act(save(), &ctx);
    drawn.place("Replace the file?");
    drawn.app.act(Action::Answer(false), &ctx);
    assert_eq!(drawn.app.workflow.plan.own_file, None);
    drawn.app.act(save(), &ctx);
    drawn.app.act(Action::Answer(true), &ctx);
    assert_eq!(drawn.app.workflow.plan.own_file.as_ref(), Some(&path));
    // Now the file is this plan's.
    drawn.app.act(save(), &ctx);
    assert!(drawn.app.question.is_none());
    drawn.app.workflow.plan.forget_scene();
    drawn.app.act(save(), &ctx);
    assert!(drawn.app.question.is_some(), "of another scene");
}
