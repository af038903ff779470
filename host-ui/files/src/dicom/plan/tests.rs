//! Plans that were written read back equal.

use super::super::checked;
use super::super::new_uid;
use super::*;
use crate::ContentError;

pub fn plan(count: usize) -> SeedPlan {
    let seed = |i: usize| {
        let t = i as f64;
        let axis = [t.sin() * t.cos(), t.sin() * t.sin(), t.cos()];
        PlanSeed {
            needle: Some((i / 4) as u32 + 3),
            hole: format!("{}{}", (b'A' + (i % 13) as u8) as char, i % 7 + 1),
            position_m: [t * 1.234567e-3 - 0.03, 0.0123456789 - t * 1e-4, -0.1 + t / 3e3],
            axis: (i % 5 != 4).then_some(axis),
            strength_u: [0.5, 0.4321, 0.62][i % 3],
            strength_on: Some(Date::constant(2026, 9, [1, 20][i % 2])),
        }
    };
    SeedPlan {
        label: "test".to_owned(),
        identity: Identity::new(),
        uid: new_uid(),
        structure_set: None,
        prescription_gy: Some(145.0),
        planned_on: Some(Date::constant(2026, 10, 31)),
        source: PlanSource {
            model: "6711".to_owned(),
            manufacturer: "nobody".to_owned(),
            isotope: "I-125".to_owned(),
            half_life_days: 59.4,
            active_length_m: 3e-3,
        },
        seeds: (0..count).map(seed).collect(),
        notes: Vec::new(),
    }
}

fn again(plan: &SeedPlan) -> Result<SeedPlan, ContentError> {
    checked::read(&bytes(plan).unwrap()).and_then(|o| of(&o))
}

#[test]
fn a_written_plan_reads_back_equal() {
    let plan = plan(90);
    let mut again = again(&plan).unwrap();
    let notes = std::mem::take(&mut again.notes);
    assert!(
        notes.len() == 1 && notes[0].contains("ControlPointOrientation"),
        "{notes:?}"
    );
    for (seed, was) in again.seeds.iter_mut().zip(&plan.seeds) {
        let off = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        // Sixteen characters a number, and an axis in single precision.
        assert!(off(seed.position_m, was.position_m) < 1e-13);
        assert_eq!(seed.axis.is_some(), was.axis.is_some());
        assert!(seed.axis.zip(was.axis).is_none_or(|(a, b)| off(a, b) < 2e-7));
        (seed.position_m, seed.axis) = (was.position_m, was.axis);
    }
    assert_eq!(again, plan);
}

/// Guards against one applicator for all needles without a hole, and against lost needle numbers of
/// a table.
#[test]
fn needles_keep_or_get_a_number() {
    let mut plan = plan(6);
    for (seed, (needle, hole)) in plan.seeds.iter_mut().zip([
        (Some(7), ""),
        (None, "C3"),
        (Some(2), ""),
        (None, "D4"),
        (None, "C3"),
        (Some(2), ""),
    ]) {
        (seed.needle, seed.hole) = (needle, hole.to_owned());
    }
    let found = again(&plan).unwrap().seeds.into_iter().map(|s| (s.needle, s.hole));
    let numbers = [7, 8, 2, 9, 8, 2].map(Some);
    let holes = ["", "C3", "", "D4", "C3", ""].map(str::to_owned);
    assert!(found.eq(numbers.into_iter().zip(holes)));
}

#[test]
fn dicom_axes_are_left_and_posterior() {
    use super::super::values::{exactly, items};
    use dicom_dictionary_std::tags;
    let object = checked::read(&bytes(&plan(1)).unwrap()).unwrap();
    let setup = &items(&object.data, tags::APPLICATION_SETUP_SEQUENCE)[0];
    let channel = &items(setup, tags::CHANNEL_SEQUENCE)[0];
    let points = items(channel, tags::BRACHY_CONTROL_POINT_SEQUENCE);
    assert_eq!(points.len(), 2);
    let place = exactly::<3>(&points[0], tags::CONTROL_POINT3_D_POSITION)
        .unwrap()
        .unwrap();
    assert_eq!(place, [30.0, -12.3456789, -100.0]);
}

#[test]
fn plans_that_mix_isotopes_or_refer_to_nothing_are_refused() {
    let mut data = checked::read(&bytes(&plan(4)).unwrap()).unwrap().data;
    let tags = |name: &str| StandardDataDictionary.parse_selector(name).unwrap();
    use dicom_core::dictionary::DataDictionary;
    use dicom_core::ops::{ApplyOp, AttributeAction, AttributeOp};
    use dicom_dictionary_std::StandardDataDictionary;
    let set = |data: &mut dicom_object::InMemDicomObject, at: &str, value: &str| {
        let action = AttributeAction::SetStr(value.to_owned().into());
        data.apply(AttributeOp::new(tags(at), action)).unwrap();
    };
    let read = |data: &dicom_object::InMemDicomObject| {
        let bytes = super::super::write::bytes(data.clone()).unwrap();
        checked::read(&bytes)
            .and_then(|o| of(&o))
            .map(|p| p.label)
            .map_err(|e| e.to_string())
    };
    let original = data.clone();
    set(&mut data, "300A0210[1].300A0226", "Pd-103");
    assert!(
        read(&data)
            .unwrap_err()
            .to_string()
            .contains("mixes seeds of I-125 and Pd-103")
    );
    data = original.clone();
    set(&mut data, "300A0230[0].300A0280[2].300C000E", "77");
    assert!(
        read(&data)
            .unwrap_err()
            .to_string()
            .contains("channel 3: it refers to source 77")
    );
    data = original.clone();
    set(&mut data, "300A0230[0].300A0280[0].300A02D0[0].300A02D4", "1\\2");
    set(&mut data, "300A0230[0].300A0280[1].300A02D0[0].300A02D4", "1\\2\\x");
    let both = read(&data).unwrap_err().to_string();
    assert!(
        both.contains("2 problems") && both.contains("channel 1") && both.contains("channel 2"),
        "{both}"
    );
    data = original;
    set(&mut data, "300A0200", "INTERSTITIAL");
    set(&mut data, "300A0202", "HDR");
    assert!(read(&data).unwrap_err().to_string().contains("taken out again"));
}

/// Guards against a temporary plan of Ir-192, loaded by hand, that was computed as a permanent one
/// of I-125.
#[test]
fn temporary_sources_are_refused() {
    use dicom_core::dictionary::DataDictionary;
    use dicom_core::ops::{ApplyOp, AttributeAction, AttributeOp};
    use dicom_dictionary_std::StandardDataDictionary;
    let original = checked::read(&bytes(&plan(4)).unwrap()).unwrap().data;
    let read = |changes: &[(&str, &str)]| {
        let mut data = original.clone();
        for (at, value) in changes {
            let at = StandardDataDictionary.parse_selector(at).unwrap();
            let action = AttributeAction::SetStr((*value).to_owned().into());
            data.apply(AttributeOp::new(at, action)).unwrap();
        }
        let bytes = super::super::write::bytes(data).unwrap();
        let plan = checked::read(&bytes).and_then(|o| of(&o));
        plan.map(|p| p.notes).map_err(|e| e.to_string())
    };
    let by_hand = [("300A0200", "INTERSTITIAL"), ("300A0202", "LDR")];
    let notes = read(&by_hand).unwrap();
    assert!(notes[0].contains("INTERSTITIAL and not PERMANENT"), "{notes:?}");
    for (change, reported) in [
        (("300A0210[0].300A0226", "Ir-192"), "its sources are Ir-192"),
        (
            ("300A0230[0].300A0280[2].300A0288", "STEPWISE"),
            "its sources move (STEPWISE)",
        ),
        (
            ("300A0230[0].300A0280[1].300A0286", "259200"),
            "its sources stay 3.00 days",
        ),
    ] {
        let why = read(&[by_hand[0], by_hand[1], change]).unwrap_err();
        assert!(why.contains(reported) && why.contains("taken out again"), "{why}");
    }
    assert!(read(&[("300A0202", "HDR")]).unwrap_err().contains("taken out again"));
}

/// Returns the plan of four seeds after changes of its attributes; an empty value removes one.
fn changed(changes: &[(&str, &str)]) -> Result<SeedPlan, String> {
    use dicom_core::dictionary::DataDictionary;
    use dicom_core::ops::{ApplyOp, AttributeAction, AttributeOp};
    use dicom_dictionary_std::StandardDataDictionary;
    let mut object = checked::read(&bytes(&plan(4)).unwrap()).unwrap();
    for (at, value) in changes {
        let at = StandardDataDictionary.parse_selector(at).unwrap();
        let action = match *value {
            "" => AttributeAction::Remove,
            value => AttributeAction::SetStr(value.to_owned().into()),
        };
        object.data.apply(AttributeOp::new(at, action)).unwrap();
    }
    of(&object).map_err(|why| why.to_string())
}

/// Adds a copy of the first item of a sequence, with another value of one attribute.
fn doubled(sequence: dicom_core::Tag, tag: dicom_core::Tag, value: &str) -> Result<SeedPlan, String> {
    use super::super::values::items;
    use super::super::write::{sequence as written, string};
    let mut object = checked::read(&bytes(&plan(4)).unwrap()).unwrap();
    let mut all = items(&object.data, sequence).to_vec();
    let mut copy = all[0].clone();
    copy.put(string(tag, value));
    all.push(copy);
    object.data.put(written(sequence, all));
    of(&object).map_err(|why| why.to_string())
}

/// Guards against application setups that no fraction group names and that were counted.
#[test]
fn only_setups_of_a_fraction_group_count() {
    use dicom_dictionary_std::tags;
    let (setups, number) = (tags::APPLICATION_SETUP_SEQUENCE, tags::APPLICATION_SETUP_NUMBER);
    let two = doubled(setups, number, "2").unwrap();
    assert_eq!(two.seeds, changed(&[]).unwrap().seeds);
    assert!(
        two.notes
            .join("; ")
            .contains("application setup 2 with 4 channels is left out"),
        "{:?}",
        two.notes
    );
    assert!(doubled(setups, number, "1").unwrap_err().contains("is given twice"));
    let elsewhere = [("300A0070[0].300C000A[0].300C000C", "7")];
    assert!(changed(&elsewhere).unwrap_err().contains("setup 7, which is missing"));
    let thrice = changed(&[("300A0070[0].300A0078", "3")]).unwrap();
    assert!(
        thrice.notes.join("; ").contains("NumberOfFractionsPlanned"),
        "{:?}",
        thrice.notes
    );
}

/// Guards against a prescription of 14,500 that was dropped for that of the source, and against a
/// second one that nobody heard of.
#[test]
fn prescriptions_are_plausible_and_others_reported() {
    use dicom_dictionary_std::tags;
    let dose = "300A0010[0].300A0026";
    for wrong in ["14500", "0", "-145"] {
        let why = changed(&[(dose, wrong)]).unwrap_err();
        assert!(why.contains("TargetPrescriptionDose") && why.contains("cGy"), "{why}");
    }
    let two = doubled(tags::DOSE_REFERENCE_SEQUENCE, tags::TARGET_PRESCRIPTION_DOSE, "110").unwrap();
    assert_eq!(two.prescription_gy, Some(145.0));
    assert!(
        two.notes.join("; ").contains("145 Gy counts, and not 110 Gy"),
        "{:?}",
        two.notes
    );
    for (at, value, named) in [
        (dose, "", "TargetPrescriptionDose"),
        ("300A0010[0].300A0020", "", "DoseReferenceType"),
        ("300A0010[0].300A0020", "ORGAN_AT_RISK", "DoseReferenceType"),
    ] {
        let plan = changed(&[(at, value)]).unwrap();
        assert_eq!(plan.prescription_gy, None);
        assert!(plan.notes.join("; ").contains(named), "{:?}", plan.notes);
    }
}

/// Guards against a source of the list that no channel uses and that was held against the plan.
#[test]
fn sources_that_no_channel_uses_have_no_part_in_the_plan() {
    use dicom_dictionary_std::tags;
    let all_of_the_first: Vec<(String, &str)> = (0..4)
        .map(|n| (format!("300A0230[0].300A0280[{n}].300C000E"), "1"))
        .collect();
    let mut changes: Vec<(&str, &str)> = all_of_the_first.iter().map(|(at, to)| (at.as_str(), *to)).collect();
    changes.extend([("300A0210[1].300A0226", "Ir-192"), ("300A0210[1].300A022A", "0")]);
    let plan = changed(&changes).unwrap();
    assert!(
        plan.seeds
            .iter()
            .all(|seed| seed.strength_u == plan.seeds[0].strength_u)
    );
    // But a number that is given twice is not known.
    let why = doubled(tags::SOURCE_SEQUENCE, tags::SOURCE_NUMBER, "1").unwrap_err();
    assert!(why.contains("SourceNumber") && why.contains("is given twice"), "{why}");
}

#[test]
fn days_and_numbers_of_control_points_are_checked() {
    let why = changed(&[("300A0210[0].300A022C", "20261399")]).unwrap_err();
    assert!(
        why.contains("SourceStrengthReferenceDate") && why.contains("20261399"),
        "{why}"
    );
    let why = changed(&[("300A0230[0].300A0280[1].300A0110", "4")]).unwrap_err();
    assert!(
        why.contains("channel 2") && why.contains("NumberOfControlPoints"),
        "{why}"
    );
}
