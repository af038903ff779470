//! Plans against sources that they are not made for.

use super::*;

fn declared() -> Declared {
    Declared {
        model: "OncoSeed 6711".to_owned(),
        isotope: "125I".to_owned(),
        half_life_days: Some(59.4),
        prescription_gy: Some(110.0),
        planned_on: Some(Date::constant(2026, 10, 31)),
    }
}

fn rows() -> Vec<PlanSeed> {
    let row = |(strength_u, strength_on)| PlanSeed {
        position_m: [0.0; 3],
        axis: None,
        strength_u,
        needle: None,
        hole: String::new(),
        strength_on,
    };
    [
        (0.5, Some(Date::constant(2026, 9, 1))),
        (0.6, Some(Date::constant(2026, 9, 1))),
        (0.7, None),
    ]
    .map(row)
    .to_vec()
}

/// Guards against a plan of I-125 with the source of Pd-103, which gave 28.4 Gy instead of 190.1 in
/// silence.
#[test]
fn another_isotope_is_refused_and_another_model_or_half_life_is_reported() {
    let (iodine, palladium) = (Source::known("6711").unwrap(), Source::known("200").unwrap());
    assert_eq!(declared().check(&iodine).unwrap(), [""; 0]);
    let why = declared().check(&palladium).unwrap_err().to_string();
    assert!(
        why.contains("seeds are 125I") && why.contains("Pd-103") && why.contains("--source"),
        "{why}"
    );
    let unreadable = Declared {
        isotope: "seed".to_owned(),
        ..declared()
    };
    assert!(unreadable.check(&iodine).is_ok() && unreadable.check(&palladium).is_err());
    let other = Declared {
        model: "IAI-125A".to_owned(),
        half_life_days: Some(60.2),
        ..declared()
    };
    let notes = other.check(&iodine).unwrap();
    assert!(
        notes[0].contains("60.2 days") && notes[1].contains("IAI-125A"),
        "{notes:?}"
    );
}

/// Guards against a prescription of 110 Gy in the plan that was ignored for 145 of the source.
#[test]
fn the_plan_s_prescription_overrides_the_source_s() {
    let source = Source::known("6711").unwrap();
    let (used, note) = prescription(None, Some(&declared()), &source);
    assert_eq!(used, Some(110.0));
    let note = note.unwrap();
    assert!(note.contains("110 Gy") && note.contains("145 Gy"), "{note}");
    let (used, note) = prescription(Some(120.0), Some(&declared()), &source);
    assert!(used == Some(120.0) && note.unwrap().contains("prescribes 110 Gy"));
    assert_eq!(prescription(Some(110.0), Some(&declared()), &source).0, Some(110.0));
    assert_eq!(prescription(None, None, &source), (Some(145.0), None));
}

/// Guards against a strength of 60 days before the implant that was used without decay.
#[test]
fn strengths_decay_to_the_day_of_the_implant() {
    let source = Source::known("6711").unwrap();
    let mut aged = rows();
    let implant = Some(Date::constant(2026, 10, 31));
    let note = decay(implant, &mut aged, Some(&declared()), &source).unwrap().unwrap();
    let left = (-60.0_f64 / 59.4).exp2();
    let strengths: Vec<f64> = aged.iter().map(|r| r.strength_u).collect();
    assert!(
        (strengths[0] - 0.5 * left).abs() < 1e-12 && strengths[2] == 0.7,
        "{strengths:?}"
    );
    assert!(note.contains("2026-09-01") && note.contains("49.7 %"), "{note}");
    let mut same = rows();
    let note = decay(None, &mut same, Some(&declared()), &source).unwrap();
    assert_eq!(same, rows());
    let note = note.unwrap();
    assert!(note.contains("2026-09-01") && note.contains("60 days later"), "{note}");
    let wrong = Some(Date::constant(2062, 10, 31));
    assert!(decay(wrong, &mut same, None, &source).is_err());
}

/// Guards against seeds of 0 U and 50 U that passed, and against strengths of years ahead.
#[test]
fn strengths_of_no_seed_are_refused_or_reported() {
    assert_eq!(strengths(&rows()).unwrap(), None);
    let with = |strength_u: f64| {
        let mut all = rows();
        all[1].strength_u = strength_u;
        strengths(&all)
    };
    assert!(
        with(0.0)
            .unwrap_err()
            .to_string()
            .contains("seed 2 has a strength of 0 U")
    );
    assert!(
        with(50.0)
            .unwrap()
            .unwrap()
            .contains("1 of its 3 seeds have an unusual strength, up to 50 U")
    );
}

/// Guards against "1214.8 % of the last one remain" and "-365 days later".
#[test]
fn a_reference_day_after_the_implant_is_told_or_refused() {
    let source = Source::known("6711").unwrap();
    let on = |month: i8, day: i8| Some(Date::constant(2026, month, day));
    // The strengths are of 2026-09-01.
    let note = decay(on(8, 22), &mut rows(), None, &source).unwrap().unwrap();
    assert!(
        note.contains("counted back to the implant on 2026-08-22, 10 days before: 112.4 %"),
        "{note}"
    );
    let why = decay(on(2, 1), &mut rows(), None, &source).unwrap_err().to_string();
    assert!(why.contains("2026-09-01, 212 days after the implant"), "{why}");
    let earlier = Declared {
        planned_on: Some(Date::constant(2026, 8, 22)),
        ..declared()
    };
    let note = decay(None, &mut rows(), Some(&earlier), &source).unwrap().unwrap();
    assert!(note.contains("2026-08-22, 10 days earlier"), "{note}");
}
