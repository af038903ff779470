//! A plan as DICOM: one source for each strength, one channel with a fixed source for each seed.

use super::super::write::{common, decimals, item, now, reference, sequence, string, whole};
use super::{Date, PlanSeed, SeedPlan};
use crate::error::ContentError;
use dicom_core::VR;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use stylet_anatomy::ras_from_lps;

const SECONDS_PER_DAY: f64 = 86_400.0;
const DOSE_REFERENCE: usize = 1;
const SETUP: usize = 1;
/// Length of the usual needle; no file read here gives another.
const NEEDLE_LENGTH_MM: f64 = 200.0;

type Element = dicom_core::DataElement<InMemDicomObject>;

/// Returns the bytes of the file.
pub fn bytes(plan: &SeedPlan) -> Result<Vec<u8>, ContentError> {
    if plan.seeds.is_empty() {
        return Err("a plan without seeds cannot be written".into());
    }
    let mut strengths: Vec<Strength> = plan.seeds.iter().map(Strength::of).collect();
    strengths.sort_by(Strength::cmp);
    strengths.dedup();
    let (today, time) = now();
    let planned_on = plan.planned_on.map_or_else(|| today.clone(), digits);
    let mut object = common(uids::RT_PLAN_STORAGE, "RTPLAN", &plan.identity);
    object.put(string(tags::SOP_INSTANCE_UID, &plan.uid));
    object.put(string(tags::RT_PLAN_LABEL, &plan.label));
    object.put(string(tags::RT_PLAN_DATE, &planned_on));
    object.put(string(tags::RT_PLAN_TIME, &time));
    match &plan.structure_set {
        Some(set) => {
            object.put(string(tags::RT_PLAN_GEOMETRY, "PATIENT"));
            let set = reference(uids::RT_STRUCTURE_SET_STORAGE, &set.uid);
            object.put(sequence(tags::REFERENCED_STRUCTURE_SET_SEQUENCE, vec![set]));
        }
        // PATIENT would need a structure set.
        None => {
            object.put(string(tags::RT_PLAN_GEOMETRY, "TREATMENT_DEVICE"));
        }
    }
    object.put(string(tags::APPROVAL_STATUS, "UNAPPROVED"));
    if let Some(gy) = plan.prescription_gy {
        let target = plan.structure_set.as_ref().and_then(|set| set.target);
        let kind = if target.is_some() { "VOLUME" } else { "SITE" };
        let mut reference = item([
            whole(tags::DOSE_REFERENCE_NUMBER, DOSE_REFERENCE),
            string(tags::DOSE_REFERENCE_STRUCTURE_TYPE, kind),
            string(tags::DOSE_REFERENCE_TYPE, "TARGET"),
            decimals(tags::TARGET_PRESCRIPTION_DOSE, &[gy]),
        ]);
        if let Some(number) = target {
            reference.put(whole(tags::REFERENCED_ROI_NUMBER, number));
        }
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
    object.put(string(tags::BRACHY_TREATMENT_TECHNIQUE, "PERMANENT"));
    object.put(string(tags::BRACHY_TREATMENT_TYPE, "MANUAL"));
    let machine = item([string(tags::TREATMENT_MACHINE_NAME, "")]);
    object.put(sequence(tags::TREATMENT_MACHINE_SEQUENCE, vec![machine]));
    let sources = strengths
        .iter()
        .zip(1..)
        .map(|(strength, n)| source(plan, n, strength, (&today, &time)));
    object.put(sequence(tags::SOURCE_SEQUENCE, sources.collect()));
    object.put(sequence(
        tags::APPLICATION_SETUP_SEQUENCE,
        vec![setup(plan, &strengths)],
    ));
    super::super::write::bytes(object)
}

/// Source of the file: seeds of one strength on one day.
#[derive(PartialEq)]
struct Strength {
    u: f64,
    on: Option<Date>,
}

impl Strength {
    fn of(seed: &PlanSeed) -> Self {
        Self {
            u: seed.strength_u,
            on: seed.strength_on,
        }
    }

    fn cmp(&self, other: &Self) -> Ordering {
        self.u.total_cmp(&other.u).then(self.on.cmp(&other.on))
    }
}

fn digits(date: Date) -> String {
    date.strftime("%Y%m%d").to_string()
}

/// Writes a source; without a day of its own the strength is that of now.
fn source(plan: &SeedPlan, number: usize, strength: &Strength, (today, now): (&str, &str)) -> InMemDicomObject {
    let s = &plan.source;
    let date = strength.on.map_or_else(|| today.to_owned(), digits);
    let time = if strength.on.is_some() { "000000" } else { now };
    item([
        whole(tags::SOURCE_NUMBER, number),
        string(tags::SOURCE_TYPE, "LINE"),
        string(tags::SOURCE_MANUFACTURER, &s.manufacturer),
        string(tags::SOURCE_MODEL_ID, &s.model),
        string(tags::SOURCE_DESCRIPTION, &s.model),
        decimals(tags::ACTIVE_SOURCE_LENGTH, &[s.active_length_m * 1e3]),
        string(tags::SOURCE_ISOTOPE_NAME, &s.isotope),
        decimals(tags::SOURCE_ISOTOPE_HALF_LIFE, &[s.half_life_days]),
        string(tags::SOURCE_STRENGTH_UNITS, "AIR_KERMA_RATE"),
        // In uGy/h at 1 m, which is U.
        decimals(tags::REFERENCE_AIR_KERMA_RATE, &[strength.u]),
        string(tags::SOURCE_STRENGTH_REFERENCE_DATE, &date),
        string(tags::SOURCE_STRENGTH_REFERENCE_TIME, time),
    ])
}

fn setup(plan: &SeedPlan, strengths: &[Strength]) -> InMemDicomObject {
    let numbers = needle_numbers(plan);
    let mut channels = Vec::new();
    let mean_life_s = plan.source.half_life_days * SECONDS_PER_DAY / std::f64::consts::LN_2;
    for ((seed, needle), number) in plan.seeds.iter().zip(numbers).zip(1..) {
        let source = strengths.partition_point(|s| s.cmp(&Strength::of(seed)).is_lt()) + 1;
        let mut channel = item([
            whole(tags::CHANNEL_NUMBER, number),
            string(tags::CHANNEL_LENGTH, ""),
            decimals(tags::CHANNEL_TOTAL_TIME, &[mean_life_s]),
            string(tags::SOURCE_MOVEMENT_TYPE, "FIXED"),
            string(tags::TRANSFER_TUBE_NUMBER, ""),
            whole(tags::REFERENCED_SOURCE_NUMBER, source),
            whole(tags::NUMBER_OF_CONTROL_POINTS, 2),
            decimals(tags::FINAL_CUMULATIVE_TIME_WEIGHT, &[100.0]),
            sequence(
                tags::BRACHY_CONTROL_POINT_SEQUENCE,
                vec![point(seed, 0, 0.0), point(seed, 1, 100.0)],
            ),
        ]);
        needle
            .into_iter()
            .flat_map(|n| applicator(n, &seed.hole))
            .for_each(|element| {
                channel.put(element);
            });
        channels.push(channel);
    }
    let total_kerma: f64 = plan.seeds.iter().map(|s| s.strength_u * mean_life_s / 3600.0).sum();
    item([
        string(tags::APPLICATION_SETUP_TYPE, "PERINEAL"),
        whole(tags::APPLICATION_SETUP_NUMBER, SETUP),
        decimals(tags::TOTAL_REFERENCE_AIR_KERMA, &[total_kerma]),
        sequence(tags::CHANNEL_SEQUENCE, channels),
    ])
}

/// Returns a needle and its hole, without a structure.
fn applicator(number: u32, hole: &str) -> [Element; 5] {
    [
        whole(tags::SOURCE_APPLICATOR_NUMBER, number as usize),
        string(tags::SOURCE_APPLICATOR_ID, hole),
        string(tags::SOURCE_APPLICATOR_TYPE, "RIGID"),
        decimals(tags::SOURCE_APPLICATOR_LENGTH, &[NEEDLE_LENGTH_MM]),
        string(tags::REFERENCED_ROI_NUMBER, ""),
    ]
}

/// Returns the number of each seed's needle: its own, or the next free one for each hole of needles
/// without a number; none for seeds without either.
fn needle_numbers(plan: &SeedPlan) -> Vec<Option<u32>> {
    let mut last = plan.seeds.iter().filter_map(|s| s.needle).max().unwrap_or(0);
    let mut by_hole = BTreeMap::new();
    let mut numbers = Vec::with_capacity(plan.seeds.len());
    for seed in &plan.seeds {
        let of_hole = || {
            *by_hole.entry(seed.hole.as_str()).or_insert_with(|| {
                last += 1;
                last
            })
        };
        numbers.push(seed.needle.or_else(|| (!seed.hole.is_empty()).then(of_hole)));
    }
    numbers
}

/// Writes a control point; a fixed source has two, at the same place (PS3.3 C.8.8.15.7, example b).
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
