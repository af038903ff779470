//! The drawing can be undone step by step, and an update is accepted only while it fits the
//! inserted needles.

use super::*;
use crate::planner::tests::{planned, planner};
use stylet_implant::intraoperative::Update;
use stylet_implant::plan::optimise::Figures;

#[test]
fn each_click_is_a_step_and_a_drag_is_one() {
    let mut planner = planner();
    let points = |planner: &Planner| planner.planning().review.drawn.contour.points();
    for x in [0.0, 0.01, 0.02] {
        planner.draw(Edit::Add {
            at_m: 0.0,
            point_m: [x, x * x],
        });
    }
    for (to, is_first) in [(0.03, true), (0.04, false), (0.05, false)] {
        planner.draw(Edit::Move {
            at_m: 0.0,
            number: 2,
            to_m: [to, 0.0],
            is_first,
        });
    }
    let drawn = planner.planning().review.drawn;
    assert_eq!(drawn.contour.at(0.0).expect("clicked").points_m[2], [0.05, 0.0]);
    planner.draw(Edit::Undo);
    let drawn = planner.planning().review.drawn;
    assert_eq!(
        drawn.contour.at(0.0).expect("clicked").points_m[2],
        [0.02, 4e-4],
        "before the drag"
    );
    planner.draw(Edit::Undo);
    assert_eq!(points(&planner), 2);
    planner.draw(Edit::Redo);
    assert_eq!(points(&planner), 3);
    planner.draw(Edit::TakeOver { at_m: 5e-3 });
    assert_eq!(points(&planner), 3 + TAKEN_OVER, "as the plane beside it proposes");
    planner.draw(Edit::Remove { at_m: 0.0, number: 0 });
    planner.draw(Edit::Mark([0.01; 3]));
    planner.draw(Edit::MoveMark {
        number: 0,
        to_m: [0.02; 3],
        is_first: true,
    });
    assert_eq!(planner.planning().review.drawn.marks_m, [[0.02; 3]]);
    planner.draw(Edit::RemoveMark(7));
    planner.draw(Edit::RemoveMark(0));
    assert!(planner.planning().review.drawn.marks_m.is_empty());
    planner.draw(Edit::Clear);
    assert_eq!(planner.planning().review.drawn, Drawn::default());
    planner.draw(Edit::Undo);
    assert_eq!(points(&planner), 2 + TAKEN_OVER);
}

/// Creates an update in which the second needle loses a seed.
fn proposed(begun: usize) -> Reviewed {
    let doses = Doses {
        now: Figures::default(),
        continued: Figures::default(),
    };
    let updated = Figures {
        d90: 101.0,
        ..Figures::default()
    };
    Reviewed {
        update: Update {
            plan: planned().without_seed(1, 1).expect("its last"),
            begun,
            doses,
            updated,
        },
        lying: 2,
        seeds_from: SeedsFrom::Tissue,
        agreement: None,
        marked: [0, 0],
        residuals_m: None,
        left: [[1, 2], [1, 1]],
        accepted: false,
    }
}

#[test]
fn an_accepted_update_is_one_undo_step() {
    let mut planner = planner();
    planner.begin_needle(0, 0);
    planner.take_update(proposed(1));
    assert!(planner.planning().review.update.is_some());
    planner.decide(false);
    assert_eq!(planner.plan(), Some(&planned()));
    planner.take_update(proposed(1));
    planner.decide(true);
    assert_eq!(planner.plan().expect("a plan").seed_count(), 3);
    assert!(planner.planning().review.can_withdraw);
    let accepted: Vec<bool> = planner.reviewed().iter().map(|r| r.accepted).collect();
    assert_eq!(accepted, [false, true]);
    planner.withdraw_update();
    assert_eq!(planner.plan(), Some(&planned()));
    assert!(!planner.reviewed()[1].accepted && !planner.planning().review.can_withdraw);
    planner.decide(true);
    assert_eq!(planner.reviewed().len(), 2, "nothing waits");
    planner.restart();
    assert!(planner.reviewed().is_empty(), "of another implantation");
}

/// Guards against an update that would undo an inserted needle.
#[test]
fn an_update_that_undoes_an_inserted_needle_is_refused() {
    let mut planner = planner();
    planner.begin_needle(0, 0);
    planner.finish_needle(2);
    planner.begin_needle(1, 2);
    planner.take_update(proposed(1));
    assert!(planner.planning().review.update.is_none());
    assert!(planner.take_message().is_some_and(|message| message.refused));
    // A click makes a pending update one of another contour.
    planner.take_update(proposed(2));
    planner.draw(Edit::Mark([0.0; 3]));
    assert!(planner.planning().review.update.is_none());
}
