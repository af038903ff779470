//! The table is consistent, and every problem of a set names its parameters.

use super::*;
use ParameterId as P;

const ANY_DEVICE: f64 = f64::INFINITY;

#[test]
fn defaults_are_inside_their_limits_and_numbers_are_places() {
    for (index, p) in PARAMETERS.iter().enumerate() {
        assert_eq!(p.id as usize, index, "{}", p.key);
        assert_eq!(P::from_number(index as u32), Some(p.id));
        assert_eq!(p.problem(p.default), None);
        assert!(p.min < p.max, "{}", p.key);
    }
    assert_eq!(P::from_number(PARAMETER_COUNT as u32), None);
    assert_eq!(ParameterSet::default().problems_on(ANY_DEVICE), []);
}

#[test]
fn the_numbers_of_schema_5_still_stand() {
    let numbered = [
        (P::MinStretch, 0),
        (P::PunctureDepth, 6),
        (P::MembranePeak, 12),
        (P::StickStiffness, 22),
        (P::SkinPunctureDepth, 30),
        (P::WallFriction, 39),
    ];
    for (id, number) in numbered {
        assert_eq!(id as u32, number);
    }
}

/// Guards against a study that took this from the help, and no longer refused an empty column when its words changed.
#[test]
fn the_help_says_what_does_not_act_on_a_line() {
    for spec in &PARAMETERS {
        let is_named = spec.help.contains("Not used on a needle line");
        assert_eq!(is_named, !spec.acts_on_a_line(), "{}", spec.key);
    }
}

#[test]
fn every_bad_value_is_named() {
    let mut set = ParameterSet::default();
    set.set(P::MinStretch, f64::NAN);
    set.set(P::PunctureDepth, 1.0);
    let problems = set.problems_on(ANY_DEVICE);
    let ids: Vec<_> = problems.iter().flat_map(|p| p.parameters().to_vec()).collect();
    assert_eq!(ids, [P::MinStretch, P::PunctureDepth]);
    let text = problems[1].to_string();
    assert!(text.contains("needle.puncture_depth = 1000.000000 mm"), "{text}");
}

/// The refusal used to name `shear_deg`, which is no row of the table.
#[test]
fn a_refusal_of_shear_names_the_rows_of_both_angles() {
    let mut set = ParameterSet::default();
    set.set(P::ShearHorizontal, 50_f64.to_radians());
    set.set(P::ShearVertical, 45_f64.to_radians());
    let problems = set.problems();
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].parameters(), [P::ShearHorizontal, P::ShearVertical]);
    for id in problems[0].parameters() {
        assert!(problems[0].to_string().contains(id.spec().key));
    }
}

#[test]
fn springs_that_the_device_cannot_hold_are_listed_with_what_makes_them() {
    let mut set = ParameterSet::default();
    set.set(P::MembranePeak, 20.0);
    set.set(P::ForceScale, 1.0);
    let problems = set.problems_on(2000.0);
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].parameters().contains(&P::MembranePeak));
    set.set(P::ForceScale, 0.5);
    assert_eq!(set.problems_on(2000.0), []);
    set = ParameterSet::default();
    set.set(P::Coupling, 1.0);
    set.set(P::TissueStiffness, 800.0);
    set.set(P::GuideStiffness, 800.0);
    set.set(P::ForceScale, 1.0);
    let springs: Vec<_> = set.problems_on(799.0).iter().map(|p| p.parameters()[0]).collect();
    assert_eq!(springs, [P::GuideStiffness, P::TissueStiffness]);
    // A scale of zero renders nothing, so nothing is too stiff.
    set.set(P::ForceScale, 0.0);
    assert_eq!(set.problems_on(2000.0), []);
}

#[test]
fn sources_name_what_a_reader_can_open() {
    for p in &PARAMETERS {
        assert!(!p.source.contains("design"), "{}: {}", p.key, p.source);
    }
}
