//! The study file and its distributions.

use super::{study_in, text};
use crate::draw::{Drawn, Implant};
use crate::quantity::Id;
use crate::{Study, StudyError};
use std::path::Path;

const VARIED: &str = r#"
[vary]
stiffness = { log_normal = [2.0, 1.5], within = [0.2, 10.0] }
insert_mm_per_s = { uniform = [20.0, 80.0] }
retract_mm_per_s = { log_uniform = [10.0, 100.0] }
entry_right_mm = { normal = [1.0, 2.0], within = [-19.0, 20.0] }
hand_mass_kg = { choice = [0.3, 0.7] }
hand_damping_n_s_per_m = 7
"#;

#[test]
fn every_problem_is_listed_with_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = r#"
name = "a b"
implants = 0
tissue = "jelly"
[[gland]]
scene = "knee"
plan = "plan.toml"
[[gland]]
scene = "paper"
plan = "no.toml"
[vary]
speed = 3.0
stiffness = { normal = [1.0, 0.2] }
insert_mm_per_s = { uniform = [80.0, 20.0] }
retract_mm_per_s = { uniform = [1.0, 1000.0] }
hand_mass_kg = "heavy"
entry_right_mm = { normal = [5.0, 1.0], within = [-1.0, 1.0] }
"needle.depth_coefficient" = 100.0
"layers.gland_toughness" = -1.0
"#;
    let problems = study_in(folder.path(), wrong).expect_err("it is wrong all over");
    let expected = [
        "name is \"a b\"",
        "implants is 0; it must be a whole number from 1",
        "tissue is \"jelly\"; there are chainmail, fem, paper",
        "gland 1: scene is \"knee\"; there are paper, pelvis, full",
        "gland 2: plan ",
        "vary.speed: there is no such quantity; there are stiffness, hand_mass_kg",
        "vary.stiffness: a normal distribution needs its ends",
        "vary.insert_mm_per_s: [80, 20]: the first must be the smaller one",
        "vary.retract_mm_per_s: it reaches from 1 to 1000; the limits are 0.5 to 280",
        "vary.hand_mass_kg: give a number, { uniform",
        "vary.entry_right_mm: the middle is 5, outside of within = [-1, 1]",
        "vary.needle.depth_coefficient: it does nothing in tissue",
        "vary.layers.gland_toughness: it reaches from -1 to -1; the limits are 0 to 5000",
    ];
    for start in expected {
        assert!(
            problems.iter().any(|p| p.starts_with(start)),
            "{start} is not in {problems:#?}"
        );
    }
    // Nothing else: the wrong file of a plan is one problem.
    assert_eq!(problems.len(), expected.len(), "{problems:#?}");
}

#[test]
fn a_key_or_type_that_no_study_has_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    for (wrong, expected) in [
        (
            text("implants = 1\nsead = 1"),
            "unknown field `sead`, expected one of `name`, `seed`",
        ),
        (
            text("implants = 1") + "hole = \"G7\"",
            "unknown field `hole`, expected `scene` or `plan`",
        ),
        (text("implants = 1.5"), "expected u32"),
        (text("implants = 1\nseed = -1"), "expected u64"),
        (text("implants = 1\nvary = 3"), "expected a map"),
        (text(""), "missing field `implants`"),
        ("name = \"t\"\nimplants = 1".to_owned(), "there is no gland"),
    ] {
        let problems = study_in(folder.path(), &wrong).expect_err(expected);
        assert!(problems.len() == 1 && problems[0].contains(expected), "{problems:#?}");
    }
}

/// Thousands of insertions failed one by one where the file could have been refused.
#[test]
fn parameters_that_the_device_does_not_hold_together_are_refused_with_their_values() {
    let folder = tempfile::tempdir().unwrap();
    let keys = "[vary]\n\"force.membrane_peak\" = { uniform = [4.0, 9.0] }";
    let problems = study_in(folder.path(), &(text("implants = 1") + keys)).expect_err("refused");
    assert_eq!(problems.len(), 1, "{problems:#?}");
    assert!(
        problems[0].contains("force.membrane_peak = 9") && problems[0].contains("the device holds at most"),
        "{problems:#?}"
    );
    let usual = keys.replace("9.0", "6.0");
    assert!(study_in(folder.path(), &(text("implants = 1") + &usual)).is_ok());
}

#[test]
fn a_plan_without_sense_is_refused_with_the_number_of_its_needle() {
    let folder = tempfile::tempdir().unwrap();
    let plan = super::PLAN
        .replace("strength_u = [0.4, 0.5]", "strength_u = [0.4]")
        .replace("spacer_mm = 5.5", "spacer_mm = -1.0");
    std::fs::write(folder.path().join("plan.toml"), plan).unwrap();
    let problems = Study::of_text(&text("implants = 1"), folder.path())
        .expect_err("refused")
        .0;
    assert_eq!(problems.len(), 2, "{problems:#?}");
    let problems: Vec<_> = problems.iter().map(ToString::to_string).collect();
    assert!(problems[0].contains("needle 1: 2 seeds in seed_along_mm and 1 in strength_u"));
    assert!(problems[1].contains("needle 2: spacer_mm is -1"));
}

#[test]
fn a_comment_changes_no_fingerprint_and_every_value_and_plan_does() {
    let folder = tempfile::tempdir().unwrap();
    let print = |text: &str| study_in(folder.path(), text).expect("valid").fingerprint;
    let first = print(&text("implants = 4"));
    assert_eq!(first, print(&text("# Four.\nimplants   = 4")));
    assert_ne!(first, print(&text("implants = 5")));
    assert_ne!(first, print(&text("implants = 4\nseed = 2")));
    std::fs::write(folder.path().join("plan.toml"), super::PLAN.replace("6711", "200")).unwrap();
    assert_ne!(
        first,
        Study::of_text(&text("implants = 4"), folder.path())
            .expect("valid")
            .fingerprint
    );
}

#[test]
fn the_example_of_the_documentation_is_valid() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/study/paper.toml");
    let study = Study::read(&path).unwrap_or_else(|why| panic!("{why}"));
    assert!(study.implant_count() >= 1 && study.glands[0].plan.needles.len() >= 15);
    assert!(matches!(
        Study::read(Path::new("no.toml")),
        Err(StudyError::Read { .. })
    ));
}

fn varied(folder: &Path, more: &str) -> Study {
    study_in(folder, &(text("implants = 4000") + VARIED + more)).expect("valid")
}

/// Mean and standard deviation of the distributions in closed form; the bounds are four standard errors of 4,000 draws.
#[test]
fn draws_have_the_moments_of_their_distributions() {
    let folder = tempfile::tempdir().unwrap();
    let study = varied(folder.path(), "");
    let drawn: Vec<Drawn> = (0..4000)
        .map(|n| Drawn::of(&study, Implant::at(&study, n), 0))
        .collect();
    let moments = |of: &dyn Fn(&Drawn) -> f64| {
        let n = drawn.len() as f64;
        let mean = drawn.iter().map(of).sum::<f64>() / n;
        let variance = drawn.iter().map(|d| (of(d) - mean).powi(2)).sum::<f64>() / n;
        [mean, variance.sqrt()]
    };
    let ln10 = 10.0_f64.ln();
    let cases: [(&str, [f64; 2], [f64; 2]); 5] = [
        (
            "log_normal",
            moments(&|d| d.get(Id::Stiffness).ln()),
            [2.0_f64.ln(), 1.5_f64.ln()],
        ),
        (
            "uniform",
            moments(&|d| d.get(Id::Insert)),
            [50.0, 60.0 / 12.0_f64.sqrt()],
        ),
        (
            "log_uniform",
            moments(&|d| d.get(Id::Retract).ln()),
            [1.5 * ln10, ln10 / 12.0_f64.sqrt()],
        ),
        ("normal", moments(&|d| d.get(Id::EntryRight)), [1.0, 2.0]),
        ("choice", moments(&|d| d.get(Id::HandMass)), [0.5, 0.2]),
    ];
    for (name, [mean, deviation], [expected_mean, expected_deviation]) in cases {
        let bound = 4.0 * expected_deviation / 4000.0_f64.sqrt();
        assert!(
            (mean - expected_mean).abs() < bound,
            "{name}: mean {mean}, expected {expected_mean}"
        );
        assert!(
            (deviation - expected_deviation).abs() < bound,
            "{name}: {deviation}, expected {expected_deviation}"
        );
    }
    assert!(
        drawn
            .iter()
            .all(|d| d.get(Id::HandDamping) == 7.0 && d.get(Id::TiltRight) == 0.0)
    );
}

#[test]
fn needles_of_an_implant_share_the_patient_and_the_hand_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let study = varied(folder.path(), "");
    let of = |implant, needle| Drawn::of(&study, Implant::at(&study, implant), needle);
    let (one, other, next) = (of(0, 0), of(0, 1), of(1, 0));
    for id in [Id::Stiffness, Id::HandMass] {
        assert_eq!(one.get(id), other.get(id));
    }
    assert_ne!(one.get(Id::Insert), other.get(Id::Insert));
    assert_ne!(one.get(Id::Stiffness), next.get(Id::Stiffness));
}

#[test]
fn a_quantity_that_is_added_moves_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let (few, more) = (
        varied(folder.path(), ""),
        varied(
            folder.path(),
            "\"layers.gland_toughness\" = { uniform = [100.0, 200.0] }\n",
        ),
    );
    let of = |study: &Study| Drawn::of(study, Implant::at(study, 17), 1).values;
    let (few, more) = (of(&few), of(&more));
    assert_eq!((few.len() + 1, &few[..]), (more.len(), &more[..few.len()]));
}
