//! Objects of another patient or frame of reference, and doses that are not the physical dose of a plan.

use super::objects::{Object, ball, even_dose, identity, put, save, seed_plan, structure_set};
use super::{Case, Right};
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use std::path::Path;

const DOSE: &str = "dose --source source --seeds plan.dcm --structures rs.dcm --out out";
const TEN: [[f64; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [8.0, 0.0, 3.0],
    [-8.0, 1.0, -3.0],
    [0.0, 8.0, 6.0],
    [1.0, -8.0, -6.0],
    [5.0, 5.0, -9.0],
    [-5.0, 5.0, 9.0],
    [5.0, -5.0, 9.0],
    [-5.0, -5.0, -9.0],
    [0.0, 2.0, -4.0],
];

pub fn cases() -> Vec<Case> {
    [together(), kinds()].into_iter().flatten().collect()
}

fn changed(mut object: Object, tag: Tag, value: &str) -> Object {
    put(&mut object, tag, value);
    object
}

/// Makes a plan, a structure set, a dose and a table of points of one patient, the plan changed.
fn files(folder: &Path, plan: Object) {
    save(&folder.join("plan.dcm"), plan);
    save(
        &folder.join("rs.dcm"),
        structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]),
    );
    save(&folder.join("dose.dcm"), even_dose());
    let points = identity().comments() + "x_mm,y_mm,z_mm\n1,2,3\n";
    std::fs::write(folder.join("points.csv"), points).expect("written");
}

fn together() -> Vec<Case> {
    let kind = "Another patient or another frame of reference";
    let other =
        |tag: Tag, value: &'static str| move |folder: &Path| files(folder, changed(seed_plan(&TEN, 145.0), tag, value));
    vec![
        Case::new(
            kind,
            "plan of patient OTHER",
            DOSE,
            Right::Refused("\"OTHER\""),
            other(tags::PATIENT_ID, "OTHER"),
        )
        .before("D90 7.93 Gy"),
        Case::new(
            kind,
            "plan in the frame 1.2.3.9",
            "perturb --source source --plan plan.dcm --structures rs.dcm --trials 2 --out out",
            Right::Refused("1.2.3.9"),
            other(tags::FRAME_OF_REFERENCE_UID, "1.2.3.9"),
        )
        .before("D90 7.93 Gy"),
        Case::new(
            kind,
            "dose of patient OTHER",
            "compare dose.dcm other.dcm",
            Right::Refused("\"OTHER\""),
            |folder| {
                files(folder, seed_plan(&TEN, 145.0));
                save(
                    &folder.join("other.dcm"),
                    changed(even_dose(), tags::PATIENT_ID, "OTHER"),
                );
            },
        )
        .before("mean 0.0 Gy"),
        Case::new(
            kind,
            "the plan of OTHER as a table, by `convert`",
            "convert plan.dcm seeds.csv; dose --source source --seeds seeds.csv --structures rs.dcm --out out",
            Right::Refused("\"OTHER\""),
            other(tags::PATIENT_ID, "OTHER"),
        ),
        Case::new(
            kind,
            "points of P1 for a plan of OTHER",
            "dose --source source --seeds plan.dcm --points points.csv --out out",
            Right::Refused("\"OTHER\""),
            other(tags::PATIENT_ID, "OTHER"),
        ),
        Case::new(
            kind,
            "no PatientID, another name",
            DOSE,
            Right::Refused("\"ELSE\""),
            |folder| {
                let plan = changed(seed_plan(&TEN, 145.0), tags::PATIENT_ID, "");
                files(folder, changed(plan, tags::PATIENT_NAME, "Else"));
            },
        ),
        Case::new(
            kind,
            "structures as NRRD, by `convert`, and a dose in another frame",
            "convert rs.dcm labels.nrrd; dose --rt-dose other.dcm --structures labels.nrrd --prescription-gy 145 --out out",
            Right::Refused("frame of reference is"),
            |folder| {
                files(folder, seed_plan(&TEN, 145.0));
                save(
                    &folder.join("other.dcm"),
                    changed(even_dose(), tags::FRAME_OF_REFERENCE_UID, "1.2.3.9"),
                );
            },
        ),
    ]
}

fn kinds() -> Vec<Case> {
    let kind = "Doses that are not the dose of the plan";
    let case = |file, commands, right, tag: Tag, value: &'static str| {
        Case::new(kind, file, commands, right, move |folder| {
            files(folder, seed_plan(&TEN, 145.0));
            save(&folder.join("odd.dcm"), changed(even_dose(), tag, value));
        })
    };
    let evaluated = "dose --rt-dose odd.dcm --structures rs.dcm --seeds plan.dcm --source source --out out";
    vec![
        case(
            "EFFECTIVE",
            "convert odd.dcm dose.nrrd; convert dose.nrrd again.dcm --plan plan.dcm; convert again.dcm twice.nrrd",
            Right::Holds("twice.nrrd", "dose_type:=", "EFFECTIVE"),
            tags::DOSE_TYPE,
            "EFFECTIVE",
        )
        .before("written as PHYSICAL"),
        case(
            "FRACTION",
            "convert odd.dcm again.dcm",
            Right::Refused("FRACTION"),
            tags::DOSE_SUMMATION_TYPE,
            "FRACTION",
        )
        .before("written as PLAN"),
        case(
            "ERROR beside a physical dose",
            "compare dose.dcm odd.dcm",
            Right::Refused("ERROR"),
            tags::DOSE_TYPE,
            "ERROR",
        ),
        case(
            "a sum of plans",
            "compare dose.dcm odd.dcm",
            Right::Says(&["MULTI_PLAN"]),
            tags::DOSE_SUMMATION_TYPE,
            "MULTI_PLAN",
        ),
        case(
            "EFFECTIVE, for a second check",
            evaluated,
            Right::Refused("EFFECTIVE"),
            tags::DOSE_TYPE,
            "EFFECTIVE",
        ),
        case(
            "RECORD, for a second check",
            evaluated,
            Right::Says(&["RECORD"]),
            tags::DOSE_SUMMATION_TYPE,
            "RECORD",
        ),
        case(
            "in percent",
            "compare dose.dcm odd.dcm",
            Right::Refused("RELATIVE"),
            tags::DOSE_UNITS,
            "RELATIVE",
        ),
        case(
            "a type that DICOM does not define",
            "convert odd.dcm dose.nrrd",
            Right::Refused("ABSORBED"),
            tags::DOSE_TYPE,
            "ABSORBED",
        ),
    ]
}
