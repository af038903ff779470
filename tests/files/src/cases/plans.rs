//! Plans whose prescription, strengths, sources or setups contradict themselves.

use super::objects::{Object, change, item, put, put_items, save, seed_plan};
use super::{Case, Right};
use dicom_dictionary_std::tags;
use std::path::Path;

const POINT: &str = "dose --source source --seeds plan.dcm --points points.csv --out out";
const FOUR: [[f64; 3]; 4] = [[10.0, 0.0, 0.0], [-10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, -10.0, 0.0]];

pub fn cases() -> Vec<Case> {
    [setups(), prescriptions(), strengths()].into_iter().flatten().collect()
}

/// Makes a plan, and the point in its middle.
fn plan_of(make: impl Fn() -> Object + 'static) -> impl Fn(&Path) {
    move |folder| {
        save(&folder.join("plan.dcm"), make());
        std::fs::write(folder.join("points.csv"), "x_mm,y_mm,z_mm\n0,0,0\n").expect("written");
    }
}

/// Returns a plan with a second setup of the same seeds, 2 mm higher; its only group names the setup of this number.
fn two_setups(named: &'static str) -> Object {
    let mut plan = seed_plan(&FOUR, 145.0);
    change(&mut plan, tags::APPLICATION_SETUP_SEQUENCE, |setups| {
        let mut second = setups[0].clone();
        put(&mut second, tags::APPLICATION_SETUP_NUMBER, "2");
        setups.push(second);
    });
    change(&mut plan, tags::FRACTION_GROUP_SEQUENCE, |groups| {
        let reference = item(&[(tags::REFERENCED_BRACHY_APPLICATION_SETUP_NUMBER, named)]);
        put_items(
            &mut groups[0],
            tags::REFERENCED_BRACHY_APPLICATION_SETUP_SEQUENCE,
            vec![reference],
        );
    });
    plan
}

fn setups() -> Vec<Case> {
    let kind = "Application setups that no fraction group names";
    let case = |file, right, make: fn() -> Object| Case::new(kind, file, POINT, right, plan_of(make));
    vec![
        case("two setups, the group names the first", Right::Says(&["setup"]), || {
            two_setups("1")
        })
        .before("50.02 Gy of all 8 seeds for 42.93 Gy"),
        case("the group names the second", Right::Says(&["setup"]), || {
            two_setups("2")
        }),
        case(
            "the group names a third, which is missing",
            Right::Refused("etup"),
            || two_setups("3"),
        ),
        case("two setups of one number", Right::Refused("etup"), || {
            let mut plan = two_setups("1");
            change(&mut plan, tags::APPLICATION_SETUP_SEQUENCE, |setups| {
                put(&mut setups[1], tags::APPLICATION_SETUP_NUMBER, "1")
            });
            plan
        }),
        case("no fraction group", Right::Says(&["fraction group"]), || {
            let mut plan = two_setups("1");
            plan.remove_element(tags::FRACTION_GROUP_SEQUENCE);
            plan
        }),
    ]
}

fn prescriptions() -> Vec<Case> {
    let kind = "Prescriptions";
    let case = |file, right, make: fn() -> Object| Case::new(kind, file, POINT, right, plan_of(make));
    /// Returns a plan with further prescriptions of these doses and types.
    fn also(more: &[(&str, &str)]) -> Object {
        let mut plan = seed_plan(&FOUR, 110.0);
        change(&mut plan, tags::DOSE_REFERENCE_SEQUENCE, |references| {
            for (dose, kind) in more {
                let mut second = references[0].clone();
                put(&mut second, tags::DOSE_REFERENCE_NUMBER, "2");
                put(&mut second, tags::TARGET_PRESCRIPTION_DOSE, dose);
                put(&mut second, tags::DOSE_REFERENCE_TYPE, kind);
                references.push(second);
            }
        });
        plan
    }
    vec![
        case("14500, in cGy", Right::Refused("14500"), || seed_plan(&FOUR, 14_500.0))
            .before("145 Gy of the source file"),
        case("110 and 145 Gy", Right::Says(&["110", "145"]), || {
            also(&[("145", "TARGET")])
        })
        .before("the first, without mention of the second"),
        case("-145", Right::Refused("-145"), || seed_plan(&FOUR, -145.0)),
        case("110 Gy, and a limit for an organ", Right::Says(&[]), || {
            also(&[("200", "ORGAN_AT_RISK")])
        }),
        case("110 Gy twice", Right::Says(&[]), || also(&[("110", "TARGET")])),
        case("1001 Gy", Right::Refused("1001"), || seed_plan(&FOUR, 1001.0)),
    ]
}

fn strengths() -> Vec<Case> {
    let kind = "Strengths and their dates";
    fn source(plan: &mut Object, changed: impl Fn(&mut Object)) {
        change(plan, tags::SOURCE_SEQUENCE, |sources| changed(&mut sources[0]));
    }
    fn with(values: &[(dicom_core::Tag, &str)]) -> Object {
        let mut plan = seed_plan(&FOUR, 145.0);
        source(&mut plan, |source| {
            values.iter().for_each(|(tag, value)| put(source, *tag, value))
        });
        plan
    }
    const DATED: &str = "dose --source source --seeds plan.dcm --points points.csv --implant-date 2026-06-01 --out out";
    vec![
        Case::new(
            kind,
            "reference date a year after the implant",
            DATED,
            Right::Refused("2027-06-01"),
            plan_of(|| with(&[(tags::SOURCE_STRENGTH_REFERENCE_DATE, "20270601")])),
        )
        .before("\"1214.8 % of the last are left\""),
        Case::new(
            kind,
            "0 U",
            POINT,
            Right::Refused("ReferenceAirKermaRate"),
            plan_of(|| with(&[(tags::REFERENCE_AIR_KERMA_RATE, "0")])),
        )
        .before("passed"),
        Case::new(
            kind,
            "50 U",
            POINT,
            Right::Says(&["50"]),
            plan_of(|| with(&[(tags::REFERENCE_AIR_KERMA_RATE, "50")])),
        )
        .before("passed"),
        Case::new(
            kind,
            "reference date 20 days after the implant",
            DATED,
            Right::Says(&["2026-06-21"]),
            plan_of(|| with(&[(tags::SOURCE_STRENGTH_REFERENCE_DATE, "20260621")])),
        ),
        Case::new(
            kind,
            "an unused source of Pd-103 in the list",
            POINT,
            Right::Says(&[]),
            plan_of(|| {
                let mut plan = seed_plan(&FOUR, 145.0);
                change(&mut plan, tags::SOURCE_SEQUENCE, |sources| {
                    let mut unused = sources[0].clone();
                    put(&mut unused, tags::SOURCE_NUMBER, "9");
                    put(&mut unused, tags::SOURCE_ISOTOPE_NAME, "Pd-103");
                    put(&mut unused, tags::SOURCE_ISOTOPE_HALF_LIFE, "16.99");
                    sources.push(unused);
                });
                plan
            }),
        ),
        Case::new(
            kind,
            "0.5 mU, in mGy/h for uGy/h",
            POINT,
            Right::Says(&["0.0005"]),
            plan_of(|| with(&[(tags::REFERENCE_AIR_KERMA_RATE, "0.0005")])),
        ),
    ]
}
