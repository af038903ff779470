//! Check that a plan's sources are permanent, because dose is counted to the end of their decay.

use super::super::super::element::short;
use super::super::values::{items, name, number, text};
use super::PlanSource;
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use stylet_base::nuclide::Nuclide;

const SECONDS_PER_DAY: f64 = 86_400.0;

/// Refuses plans of external beams.
pub fn is_brachytherapy(data: &InMemDicomObject) -> Result<(), ContentError> {
    let beams = items(data, tags::BEAM_SEQUENCE).len();
    match text(data, tags::BRACHY_TREATMENT_TECHNIQUE) {
        Some(_) => Ok(()),
        None if beams > 0 => Err(invalid!(
            "it is a plan of {beams} external beams; a seed plan is one of brachytherapy"
        )),
        None => Err(invalid!(
            "{} is missing, so it is not a brachytherapy plan",
            name(tags::BRACHY_TREATMENT_TECHNIQUE)
        )),
    }
}

/// Refuses temporary sources, by technique, type, nuclide, movement and time; returns a note if the
/// technique leaves it open.
pub fn check(
    data: &InMemDicomObject,
    channels: &[&InMemDicomObject],
    source: &PlanSource,
) -> Result<Option<String>, ContentError> {
    let technique = text(data, tags::BRACHY_TREATMENT_TECHNIQUE).unwrap_or_default();
    let kind = text(data, tags::BRACHY_TREATMENT_TYPE).unwrap_or_default();
    let refused = |why: String| {
        Err(invalid!(
            "{why}: sources that are taken out again; only permanent implants are read"
        ))
    };
    let is_permanent = technique == "PERMANENT";
    let is_by_hand = ["MANUAL", "LDR"].contains(&kind.as_str());
    if ["HDR", "MDR", "PDR"].contains(&kind.as_str()) || !(is_permanent || is_by_hand) {
        let (technique, kind) = (short(&technique), short(&kind));
        return refused(format!("its technique is {technique} and its type {kind}"));
    }
    if is_permanent {
        return Ok(None);
    }
    // Some programs give the approach as the technique, and mark seeds by the type: then everything
    // else must indicate seeds.
    let isotope = short(&source.isotope);
    if !Nuclide::parse(&source.isotope).is_some_and(|n| n.is_of_permanent_seeds()) {
        let technique = short(&technique);
        return refused(format!("its technique is {technique} and its sources are {isotope}"));
    }
    for channel in channels {
        if let Some(movement) = text(channel, tags::SOURCE_MOVEMENT_TYPE).filter(|m| m != "FIXED") {
            return refused(format!("its sources move ({})", short(&movement)));
        }
        let stay_days = number(channel, tags::CHANNEL_TOTAL_TIME)?.unwrap_or_default() / SECONDS_PER_DAY;
        if stay_days > 0.0 && stay_days < source.half_life_days {
            return refused(format!(
                "its sources stay {stay_days:.2} days, less than their half-life of {} days",
                source.half_life_days
            ));
        }
    }
    Ok(Some(format!(
        "its technique is {} and not PERMANENT; by its type {kind} and its sources of {isotope} it is read as a permanent implant",
        short(&technique)
    )))
}
