//! A plan as DICOM: one source for each strength, one channel with a fixed source for each seed.

use super::super::super::frame::ras_from_lps;
use super::super::write::{common, decimals, item, now, sequence, string, whole};
use super::{PlanSeed, SeedPlan};
use dicom_core::VR;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;

const SECONDS_PER_DAY: f64 = 86_400.0;
const DOSE_REFERENCE: usize = 1;
const SETUP: usize = 1;

/// The whole file.
pub fn bytes(plan: &SeedPlan) -> Result<Vec<u8>, String> {
    if plan.seeds.is_empty() {
        return Err("a plan without seeds cannot be written".to_owned());
    }
    let mut strengths: Vec<f64> = plan.seeds.iter().map(|s| s.strength_u).collect();
    strengths.sort_by(f64::total_cmp);
    strengths.dedup();
    let (date, time) = now();
    let mut object = common(uids::RT_PLAN_STORAGE, "RTPLAN", &plan.identity);
    object.put(string(tags::SOP_INSTANCE_UID, VR::UI, &plan.uid));
    object.put(string(
        tags::RT_PLAN_LABEL,
        VR::SH,
        &plan.label.chars().take(16).collect::<String>(),
    ));
    object.put(string(tags::RT_PLAN_DATE, VR::DA, &date));
    object.put(string(tags::RT_PLAN_TIME, VR::TM, &time));
    // There may be no structure set that the plan was made on.
    object.put(string(tags::RT_PLAN_GEOMETRY, VR::CS, "PATIENT"));
    object.put(string(tags::APPROVAL_STATUS, VR::CS, "UNAPPROVED"));
    if let Some(gy) = plan.prescription_gy {
        let reference = item([
            whole(tags::DOSE_REFERENCE_NUMBER, DOSE_REFERENCE),
            string(tags::DOSE_REFERENCE_STRUCTURE_TYPE, VR::CS, "SITE"),
            string(tags::DOSE_REFERENCE_TYPE, VR::CS, "TARGET"),
            decimals(tags::TARGET_PRESCRIPTION_DOSE, &[gy]),
        ]);
        object.put(sequence(tags::DOSE_REFERENCE_SEQUENCE, vec![reference]));
    }
    let referenced = item([whole(tags::REFERENCED_BRACHY_APPLICATION_SETUP_NUMBER, SETUP)]);
    let group = item([
        whole(tags::FRACTION_GROUP_NUMBER, 1),
        whole(tags::NUMBER_OF_FRACTIONS_PLANNED, 1),
        whole(tags::NUMBER_OF_BEAMS, 0),
        whole(tags::NUMBER_OF_BRACHY_APPLICATION_SETUPS, 1),
        sequence(tags::REFERENCED_BRACHY_APPLICATION_SETUP_SEQUENCE, vec![referenced]),
    ]);
    object.put(sequence(tags::FRACTION_GROUP_SEQUENCE, vec![group]));
    object.put(string(tags::BRACHY_TREATMENT_TECHNIQUE, VR::CS, "PERMANENT"));
    object.put(string(tags::BRACHY_TREATMENT_TYPE, VR::CS, "MANUAL"));
    let machine = item([string(tags::TREATMENT_MACHINE_NAME, VR::SH, "")]);
    object.put(sequence(tags::TREATMENT_MACHINE_SEQUENCE, vec![machine]));
    let sources = strengths
        .iter()
        .zip(1..)
        .map(|(&u, n)| source(plan, n, u, &date, &time));
    object.put(sequence(tags::SOURCE_SEQUENCE, sources.collect()));
    object.put(sequence(
        tags::APPLICATION_SETUP_SEQUENCE,
        vec![setup(plan, &strengths)],
    ));
    super::super::write::bytes(object)
}

fn source(plan: &SeedPlan, number: usize, strength_u: f64, date: &str, time: &str) -> InMemDicomObject {
    let s = &plan.source;
    item([
        whole(tags::SOURCE_NUMBER, number),
        string(tags::SOURCE_TYPE, VR::CS, "LINE"),
        string(tags::SOURCE_MANUFACTURER, VR::LO, &s.manufacturer),
        string(
            tags::SOURCE_MODEL_ID,
            VR::SH,
            &s.model.chars().take(16).collect::<String>(),
        ),
        string(
            tags::SOURCE_DESCRIPTION,
            VR::LO,
            &s.model.chars().take(64).collect::<String>(),
        ),
        decimals(tags::ACTIVE_SOURCE_LENGTH, &[s.active_length_m * 1e3]),
        string(tags::SOURCE_ISOTOPE_NAME, VR::LO, &s.isotope),
        decimals(tags::SOURCE_ISOTOPE_HALF_LIFE, &[s.half_life_days]),
        string(tags::SOURCE_STRENGTH_UNITS, VR::CS, "AIR_KERMA_RATE"),
        // In uGy/h at 1 m, which is U.
        decimals(tags::REFERENCE_AIR_KERMA_RATE, &[strength_u]),
        string(tags::SOURCE_STRENGTH_REFERENCE_DATE, VR::DA, date),
        string(tags::SOURCE_STRENGTH_REFERENCE_TIME, VR::TM, time),
    ])
}

fn setup(plan: &SeedPlan, strengths: &[f64]) -> InMemDicomObject {
    let mut needles: Vec<&str> = Vec::new();
    let mut channels = Vec::new();
    let mean_life_s = plan.source.half_life_days * SECONDS_PER_DAY / std::f64::consts::LN_2;
    for (seed, number) in plan.seeds.iter().zip(1..) {
        let needle = needles.iter().position(|n| *n == seed.needle).unwrap_or_else(|| {
            needles.push(&seed.needle);
            needles.len() - 1
        });
        let source = strengths.partition_point(|&u| u < seed.strength_u) + 1;
        channels.push(item([
            whole(tags::CHANNEL_NUMBER, number),
            string(tags::CHANNEL_LENGTH, VR::DS, ""),
            decimals(tags::CHANNEL_TOTAL_TIME, &[mean_life_s]),
            string(tags::SOURCE_MOVEMENT_TYPE, VR::CS, "FIXED"),
            whole(tags::SOURCE_APPLICATOR_NUMBER, needle + 1),
            string(
                tags::SOURCE_APPLICATOR_ID,
                VR::SH,
                &seed.needle.chars().take(16).collect::<String>(),
            ),
            string(tags::SOURCE_APPLICATOR_TYPE, VR::CS, "RIGID"),
            string(tags::SOURCE_APPLICATOR_LENGTH, VR::DS, ""),
            string(tags::TRANSFER_TUBE_NUMBER, VR::IS, ""),
            whole(tags::REFERENCED_SOURCE_NUMBER, source),
            whole(tags::NUMBER_OF_CONTROL_POINTS, 2),
            decimals(tags::FINAL_CUMULATIVE_TIME_WEIGHT, &[100.0]),
            sequence(
                tags::BRACHY_CONTROL_POINT_SEQUENCE,
                vec![point(seed, 0, 0.0), point(seed, 1, 100.0)],
            ),
        ]));
    }
    let total_kerma: f64 = plan.seeds.iter().map(|s| s.strength_u * mean_life_s / 3600.0).sum();
    item([
        string(tags::APPLICATION_SETUP_TYPE, VR::CS, "PERINEAL"),
        whole(tags::APPLICATION_SETUP_NUMBER, SETUP),
        decimals(tags::TOTAL_REFERENCE_AIR_KERMA, &[total_kerma]),
        sequence(tags::CHANNEL_SEQUENCE, channels),
    ])
}

/// A fixed source has two, at the same place (PS3.3 C.8.8.15.7, example b).
fn point(seed: &PlanSeed, index: usize, weight: f64) -> InMemDicomObject {
    let place_mm: [f64; 3] = (ras_from_lps(Vector3::from(seed.position_m)) * 1e3).into();
    let mut point = item([
        whole(tags::CONTROL_POINT_INDEX, index),
        decimals(tags::CUMULATIVE_TIME_WEIGHT, &[weight]),
        decimals(tags::CONTROL_POINT_RELATIVE_POSITION, &[0.0]),
        decimals(tags::CONTROL_POINT3_D_POSITION, &place_mm),
    ]);
    if let Some(axis) = seed.axis {
        let axis: [f64; 3] = ras_from_lps(Vector3::from(axis)).into();
        let element = dicom_core::DataElement::new(
            tags::CONTROL_POINT_ORIENTATION,
            VR::FL,
            dicom_core::value::PrimitiveValue::F32(axis.map(|c| c as f32).to_vec().into()),
        );
        point.put(element);
    }
    point
}
