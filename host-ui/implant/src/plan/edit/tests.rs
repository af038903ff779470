//! Edits against their results, undo against earlier plans, and checks against plans with one fault
//! each.

use super::*;
use crate::plan::anatomy::ball;
use crate::plan::check::problems;
use crate::plan::{Anatomy, NeedleSeed, Template};
use stylet_anatomy::PatientFrame;

const GLAND_M: [f64; 3] = [0.05, 0.05, 0.06];

fn anatomy() -> Anatomy {
    Anatomy {
        target: ball("gland", GLAND_M, [0.024, 0.02, 0.02]),
        spared: vec![ball("urethra", GLAND_M, [0.003, 0.003, 0.025])],
        bone: Vec::new(),
        lower_m: [0.0; 3],
        upper_m: [0.1; 3],
        patient: PatientFrame::default(),
    }
}

fn empty() -> ImplantPlan {
    ImplantPlan {
        template: Template {
            middle_m: [0.05, 0.05, -0.01],
            columns: [-1.0, 0.0, 0.0],
            rows: [0.0, 1.0, 0.0],
            inwards: [0.0, 0.0, 1.0],
            pitch_m: 5e-3,
        },
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        needles: Vec::new(),
    }
}

impl ImplantPlan {
    /// Returns the plan with one more loose seed; a strand becomes loose.
    pub(in crate::plan) fn with_seed(&self, needle: usize, along_m: f64, strength_u: f64) -> Result<Self, PlanError> {
        self.change(needle, |n| {
            n.loading = Loading::Loose;
            n.seeds.push(NeedleSeed { along_m, strength_u });
            Ok(())
        })
    }
}

fn hole(name: &str) -> Hole {
    name.parse().expect("a hole")
}

/// Returns two needles next to the urethra, three seeds each.
fn good() -> ImplantPlan {
    let plan = empty().with_needle(hole("E7"), 0.08).unwrap();
    let plan = plan.with_strand(0, 3, 0.08, 0.5).unwrap();
    let plan = plan.with_needle(hole("I7"), 0.08).unwrap();
    let plan = plan.with_seed(1, 0.06, 0.5).unwrap();
    let plan = plan.with_seed(1, 0.08, 0.5).unwrap();
    plan.with_seed(1, 0.07, 0.5).unwrap()
}

#[test]
fn a_good_plan_has_no_problem() {
    let plan = good();
    assert_eq!(problems(&plan, &anatomy()), Vec::new());
    let z: Vec<f64> = plan.seeds().iter().map(|s| s.position_m[2]).collect();
    for (found, expected) in z.iter().zip([0.07, 0.06, 0.05, 0.07, 0.06, 0.05]) {
        assert!((found - expected).abs() < 1e-12, "{z:?}");
    }
    assert!((plan.seeds()[0].position_m[0] - 0.06).abs() < 1e-12);
    assert_eq!(plan.seeds()[0].axis, Some([0.0, 0.0, 1.0]));
}

#[test]
fn each_fault_is_reported_once_and_all_together() {
    let anatomy = anatomy();
    let one = |plan: ImplantPlan, words: &str| {
        let found = problems(&plan, &anatomy);
        assert_eq!(found.len(), 1, "{words}: {found:?}");
        assert!(found[0].to_string().contains(words), "{words}: {}", found[0]);
    };
    one(empty(), "no needle");
    one(good().with_seed(1, 0.0575, 0.5).unwrap(), "closer than its length");
    one(good().with_seed(1, 0.04, 0.5).unwrap(), "outside gland");
    one(good().with_seed(1, 0.065, 20.0).unwrap(), "20 U");
    one(good().with_needle(hole("E8"), 0.05).unwrap(), "no seed");
    let through = good()
        .with_needle(hole("G7"), 0.05)
        .unwrap()
        .with_seed(2, 0.055, 0.5)
        .unwrap();
    one(through, "goes through urethra");
    let mut broken = good();
    broken.needles[0].seeds[1].along_m += 1e-3;
    one(broken, "strand");
    let mut deep = good();
    deep.needles[1].depth_m = 0.25;
    one(deep, "reaches 200 mm");
    let mut tip_alone = good();
    tip_alone.needles[1].depth_m = 0.19855;
    one(tip_alone, "its tip goes 200.8 mm deep");
    let mut twice = good();
    twice.needles[1].hole = Some(hole("E7"));
    one(twice, "the hole of needle 1");
    let mut beside = good();
    beside.needles[1].entry_m = beside.needles[0].entry_m;
    assert_eq!(problems(&beside, &anatomy).len(), 3, "each seed lies on another");

    let mut wrong = good().with_strength(f64::NAN);
    wrong.needles[0].direction = [0.0; 3];
    assert!(problems(&wrong, &anatomy).len() >= 4);
}

/// The way used to be checked to the middle of the deepest seed, while the tip goes half a seed deeper.
#[test]
fn what_only_the_tip_reaches_is_in_the_way() {
    let ahead = || vec![ball("bladder", [0.06, 0.05, 0.0815], [0.005, 0.005, 0.01])];
    let what = |anatomy: Anatomy| {
        problems(&good(), &anatomy)
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
    };
    let spared = what(Anatomy {
        spared: ahead(),
        ..anatomy()
    });
    assert_eq!(spared, ["needle 1: it goes through bladder, which is to be spared"]);
    let bone = what(Anatomy {
        bone: ahead(),
        ..anatomy()
    });
    assert!(
        bone.len() == 1 && bone[0].contains("bladder, which is bone"),
        "{bone:?}"
    );
}

#[test]
fn a_strand_gives_up_its_ends_only() {
    let plan = good();
    assert!(plan.without_seed(0, 1).is_err());
    assert_eq!(plan.without_seed(0, 0).unwrap().needles[0].seeds.len(), 2);
}

#[test]
fn a_hole_takes_one_needle() {
    let plan = good();
    assert!(plan.with_needle(hole("E7"), 0.05).is_err());
    assert!(plan.with_needle_at(0, hole("I7")).is_err());
    let moved = plan.with_needle_at(0, hole("E9")).unwrap();
    assert!((moved.seeds()[0].position_m[1] - 0.06).abs() < 1e-12);
    assert!(plan.without_needle(2).is_err());
}

#[test]
fn undo_and_redo_restore_each_plan() {
    let plans = [
        empty(),
        empty().with_needle(hole("E7"), 0.08).unwrap(),
        good(),
        good().with_strength(0.4),
    ];
    let mut history = History::new(plans[0].clone());
    plans.iter().for_each(|p| history.put(p.clone()));
    for plan in plans[..3].iter().rev() {
        assert!(history.undo());
        assert_eq!(history.now(), plan);
    }
    assert!(!history.undo());
    assert!(history.redo());
    assert_eq!(history.now(), &plans[1]);
    history.put(good());
    assert!(!history.redo(), "a new plan forgets those that were taken back");
    assert!(history.undo());
    assert_eq!(history.now(), &plans[1]);
}

#[test]
fn a_row_is_even_and_reads_back_equal() {
    let row = Row {
        count: 4,
        deepest_m: 0.081,
        pitch_m: 8e-3,
        stranded: true,
        strength_u: 0.4,
    };
    let plan = good().with_row(1, row).unwrap();
    let along: Vec<f64> = plan.needles[1].seeds.iter().map(|s| s.along_m).collect();
    for (found, expected) in along.iter().zip([0.081, 0.073, 0.065, 0.057]) {
        assert!((found - expected).abs() < 1e-12, "{along:?}");
    }
    assert_eq!(plan.needles[1].depth_m, 0.081);
    assert_eq!(plan.needles[1].loading.pitch_m(), Some(8e-3));
    let back = Row::of(&plan.needles[1]).unwrap();
    assert!((back.pitch_m - row.pitch_m).abs() < 1e-12);
    assert_eq!(Row { pitch_m: 8e-3, ..back }, row);
    assert!(good().with_row(1, Row { pitch_m: 4e-3, ..row }).is_err());
    assert!(good().with_row(1, Row { count: 0, ..row }).is_err());
}

#[test]
fn a_row_fills_a_piece_at_the_usual_pitch() {
    for (from_m, to_m, count) in [(0.05, 0.083, 4), (0.05, 0.0801, 4), (0.05, 0.079, 3), (0.05, 0.055, 1)] {
        let row = Row::filling([from_m, to_m], 0.5);
        assert_eq!((row.count, row.stranded), (count, count > 1), "{from_m} to {to_m}");
        let shallowest_m = row.deepest_m - (count - 1) as f64 * row.pitch_m;
        assert!(row.deepest_m <= to_m + 1e-12 && shallowest_m >= from_m - 1e-12);
        assert!(
            (row.deepest_m + shallowest_m - from_m - to_m).abs() < 1e-12,
            "in the middle"
        );
    }
}

#[test]
fn a_drag_is_one_undo_step() {
    let mut history = History::new(empty());
    history.put(good());
    for deepest_m in [0.081, 0.082, 0.083] {
        let mut row = Row::of(&history.now().needles[0]).unwrap();
        row.deepest_m = deepest_m;
        history.replace(history.now().with_row(0, row).unwrap());
    }
    assert!(history.undo());
    assert_eq!(history.now(), &empty());
}
