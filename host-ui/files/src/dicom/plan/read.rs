//! A plan from DICOM: seeds from the control points of every channel; every problem is listed.

use super::super::super::element::short;
use super::super::Identity;
use super::super::checked::Object;
use super::super::values::{exactly, items, name, needed, number, text};
use super::super::write::new_uid;
use super::{Date, PlanSeed, PlanSource, SeedPlan, permanent, prescription, setups};
use crate::error::{ContentError, invalid};
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use stylet_anatomy::ras_from_lps;

const MAX_SEEDS: usize = 10_000;
const MAX_NEEDLE: f64 = 1e9;
const MAX_PROBLEMS: usize = 8;
const MAX_MM: f64 = 10_000.0;
/// Distance below which control points are at one place.
const SAME_PLACE_MM: f64 = 1e-3;
/// Largest difference between half-lives of one isotope, as a share.
const SAME_HALF_LIFE: f64 = 0.01;

/// Reads an RT Plan of permanent seeds; the error lists every problem.
pub fn of(object: &Object) -> Result<SeedPlan, ContentError> {
    if object.sop_class != uids::RT_PLAN_STORAGE {
        return Err(invalid!(
            "it is DICOM of another kind (SOP class {}); a plan is an RT Plan",
            short(&object.sop_class)
        ));
    }
    let data = &object.data;
    permanent::is_brachytherapy(data)?;
    let (setups, mut notes) = setups::of(data)?;
    let channels: Vec<&InMemDicomObject> = setups.iter().flat_map(|s| items(s, tags::CHANNEL_SEQUENCE)).collect();
    let sources = sources(data, &channels, &mut notes)?;
    notes.extend(uneven(&channels));
    notes.extend(permanent::check(data, &channels, &sources[0].model)?);
    let (mut seeds, mut problems) = (Vec::new(), Vec::new());
    for channel in channels {
        if let Err(why) = of_channel(channel, &sources, &mut seeds, &mut notes) {
            problems.push(why.to_string());
        }
        if problems.len() >= MAX_PROBLEMS {
            break;
        }
    }
    ContentError::all(problems)?;
    if seeds.is_empty() {
        return Err("it contains no seed: no channel has a control point with a position".into());
    }
    let (source, of_models) = one_model(sources)?;
    notes.extend(of_models);
    let (prescription_gy, of_prescription) = prescription::of(data)?;
    notes.extend(of_prescription);
    Ok(SeedPlan {
        label: text(data, tags::RT_PLAN_LABEL).unwrap_or_default(),
        identity: Identity::of(object),
        structure_set: prescription::structure_set(data),
        uid: text(data, tags::SOP_INSTANCE_UID).unwrap_or_else(new_uid),
        prescription_gy,
        planned_on: date(data, tags::RT_PLAN_DATE)?,
        source,
        seeds,
        notes,
    })
}

struct Source {
    number: f64,
    model: PlanSource,
    strength_u: f64,
    strength_on: Option<Date>,
}

/// Returns the sources that channels use; others of the list have no part in the plan.
fn sources(
    data: &InMemDicomObject,
    channels: &[&InMemDicomObject],
    notes: &mut Vec<String>,
) -> Result<Vec<Source>, ContentError> {
    let (mut all, mut problems) = (Vec::<Source>::new(), Vec::new());
    let used = |source: f64| {
        let referred = |channel: &&InMemDicomObject| number(channel, tags::REFERENCED_SOURCE_NUMBER).ok().flatten();
        channels.iter().filter_map(referred).any(|number| number == source)
    };
    for item in items(data, tags::SOURCE_SEQUENCE) {
        if !number(item, tags::SOURCE_NUMBER)?.is_none_or(used) {
            continue;
        }
        match source(item, notes) {
            Ok(source) if all.iter().any(|other| other.number == source.number) => problems.push(format!(
                "{} {} is given twice, so it is not known which seeds are of which",
                name(tags::SOURCE_NUMBER),
                source.number
            )),
            Ok(source) => all.push(source),
            Err(why) => problems.push(why.to_string()),
        }
    }
    ContentError::all(problems)?;
    if all.is_empty() {
        return Err(invalid!(
            "{} has no source that a channel uses",
            name(tags::SOURCE_SEQUENCE)
        ));
    }
    Ok(all)
}

fn source(item: &InMemDicomObject, notes: &mut Vec<String>) -> Result<Source, ContentError> {
    let number = needed(item, tags::SOURCE_NUMBER, 0.0, 1e9)?;
    let at = |why: ContentError| why.within(format_args!("source {number}"));
    if let Some(units) = text(item, tags::SOURCE_STRENGTH_UNITS).filter(|u| u != "AIR_KERMA_RATE") {
        return Err(at(format!(
            "its strength is in {}; only air kerma strength is read",
            short(&units)
        )
        .into()));
    }
    let strength_u = needed(item, tags::REFERENCE_AIR_KERMA_RATE, 1e-6, 1e5).map_err(at)?;
    let half_life_days = needed(item, tags::SOURCE_ISOTOPE_HALF_LIFE, 1e-3, 1e6).map_err(at)?;
    let isotope = text(item, tags::SOURCE_ISOTOPE_NAME).ok_or_else(|| at("its isotope is missing".into()))?;
    for tag in [tags::ACTIVE_SOURCE_LENGTH, tags::SOURCE_STRENGTH_REFERENCE_DATE] {
        if text(item, tag).is_none() {
            notes.push(format!("source {number}: {} is missing", name(tag)));
        }
    }
    let length_mm = number_within(item, 100.0).map_err(at)?;
    Ok(Source {
        number,
        strength_u,
        strength_on: date(item, tags::SOURCE_STRENGTH_REFERENCE_DATE).map_err(at)?,
        model: PlanSource {
            model: text(item, tags::SOURCE_DESCRIPTION)
                .or(text(item, tags::SOURCE_MODEL_ID))
                .unwrap_or_default(),
            manufacturer: text(item, tags::SOURCE_MANUFACTURER).unwrap_or_default(),
            isotope,
            half_life_days,
            active_length_m: length_mm * 1e-3,
        },
    })
}

fn number_within(item: &InMemDicomObject, most: f64) -> Result<f64, ContentError> {
    match number(item, tags::ACTIVE_SOURCE_LENGTH)? {
        Some(v) if !(0.0..=most).contains(&v) => Err(invalid!("{} is {v}", name(tags::ACTIVE_SOURCE_LENGTH))),
        v => Ok(v.unwrap_or_default()),
    }
}

/// Returns the model, which all seeds of one plan must share, because dose knows only one.
fn one_model(sources: Vec<Source>) -> Result<(PlanSource, Vec<String>), ContentError> {
    let mut all = sources.into_iter().map(|s| s.model);
    let first = all.next().ok_or("no source")?;
    let mut notes = Vec::new();
    for other in all {
        let as_long = (other.half_life_days / first.half_life_days - 1.0).abs() < SAME_HALF_LIFE;
        if other.isotope != first.isotope || !as_long {
            return Err(invalid!(
                "it mixes seeds of {} and {}; only plans of one isotope are read",
                short(&first.isotope),
                short(&other.isotope)
            ));
        }
        if other.model != first.model {
            notes.push(format!(
                "seeds of model \"{}\" are taken as \"{}\"",
                short(&other.model),
                short(&first.model)
            ));
        }
    }
    Ok((first, notes))
}

fn of_channel(
    channel: &InMemDicomObject,
    sources: &[Source],
    seeds: &mut Vec<PlanSeed>,
    notes: &mut Vec<String>,
) -> Result<(), ContentError> {
    let channel_number = needed(channel, tags::CHANNEL_NUMBER, 0.0, 1e9)?;
    let at = |why: ContentError| why.within(format_args!("channel {channel_number}"));
    let referenced = needed(channel, tags::REFERENCED_SOURCE_NUMBER, 0.0, 1e9).map_err(at)?;
    let source = sources.iter().find(|s| s.number == referenced);
    let source = source.ok_or_else(|| at(format!("it refers to source {referenced}, which is missing").into()))?;
    let hole = text(channel, tags::SOURCE_APPLICATOR_ID).unwrap_or_default();
    let applicator = number(channel, tags::SOURCE_APPLICATOR_NUMBER).map_err(at)?;
    let is_number = |n: &f64| n.fract() == 0.0 && (1.0..=MAX_NEEDLE).contains(n);
    let needle = applicator.filter(is_number).map(|n| n as u32);
    let points = items(channel, tags::BRACHY_CONTROL_POINT_SEQUENCE);
    if points.is_empty() {
        let points = name(tags::BRACHY_CONTROL_POINT_SEQUENCE);
        notes.push(format!(
            "channel {channel_number} has no seed: {points} is missing or empty"
        ));
    }
    let stated = number(channel, tags::NUMBER_OF_CONTROL_POINTS).map_err(at)?;
    if stated.is_some_and(|stated| stated != points.len() as f64) {
        return Err(at(format!(
            "{} is not the number of control points, {}",
            name(tags::NUMBER_OF_CONTROL_POINTS),
            points.len()
        )
        .into()));
    }
    let mut last: Option<Vector3<f64>> = None;
    for point in points {
        let Some(place) = exactly::<3>(point, tags::CONTROL_POINT3_D_POSITION).map_err(at)? else {
            return Err(at("a control point has no place in the patient".into()));
        };
        if place.iter().any(|v| v.abs() > MAX_MM) {
            return Err(at(format!(
                "a seed is at {place:?} mm; at most {MAX_MM} mm is accepted"
            )
            .into()));
        }
        let place = Vector3::from(place);
        // Two control points at one place are the beginning and the end of one seed.
        let stays = last.is_some_and(|p| (p - place).norm() < SAME_PLACE_MM);
        if !stays {
            if seeds.len() == MAX_SEEDS {
                return Err(at(format!("there are more than {MAX_SEEDS} seeds").into()));
            }
            seeds.push(PlanSeed {
                needle,
                hole: hole.clone(),
                position_m: (ras_from_lps(place) * 1e-3).into(),
                axis: axis_of(points, point).map_err(at)?,
                strength_u: source.strength_u,
                strength_on: source.strength_on,
            });
        }
        last = Some(place);
    }
    Ok(())
}

/// Reports attributes that only some channels have, and numbers that are given twice.
fn uneven(channels: &[&InMemDicomObject]) -> Vec<String> {
    let mut notes = Vec::new();
    let points = |channel: &InMemDicomObject| items(channel, tags::BRACHY_CONTROL_POINT_SEQUENCE).to_vec();
    let has_axis = |channel: &&&InMemDicomObject| {
        points(channel)
            .iter()
            .any(|point| text(point, tags::CONTROL_POINT_ORIENTATION).is_some())
    };
    let has = |tag: Tag| channels.iter().filter(|channel| text(channel, tag).is_some()).count();
    for (tag, count) in [
        (tags::SOURCE_APPLICATOR_NUMBER, has(tags::SOURCE_APPLICATOR_NUMBER)),
        (tags::SOURCE_APPLICATOR_ID, has(tags::SOURCE_APPLICATOR_ID)),
        (
            tags::CONTROL_POINT_ORIENTATION,
            channels.iter().filter(has_axis).count(),
        ),
    ] {
        if (1..channels.len()).contains(&count) {
            notes.push(format!(
                "{} is missing in {} of {} channels",
                name(tag),
                channels.len() - count,
                channels.len()
            ));
        }
    }
    let mut numbers: Vec<String> = channels
        .iter()
        .filter_map(|channel| text(channel, tags::CHANNEL_NUMBER))
        .collect();
    numbers.sort_unstable();
    if let Some(twice) = numbers.windows(2).find(|w| w[0] == w[1]) {
        notes.push(format!(
            "{} {} is given twice ({}); the seeds of both channels count",
            name(tags::CHANNEL_NUMBER),
            twice[0],
            name(tags::CHANNEL_SEQUENCE)
        ));
    }
    notes
}

/// Returns the axis of a seed, from any of the control points at its place.
fn axis_of(points: &[InMemDicomObject], first: &InMemDicomObject) -> Result<Option<[f64; 3]>, ContentError> {
    let place = |point: &InMemDicomObject| exactly::<3>(point, tags::CONTROL_POINT3_D_POSITION);
    let of_first = place(first)?;
    for point in points {
        if place(point)? == of_first
            && let Some(axis) = axis(point)?
        {
            return Ok(Some(axis));
        }
    }
    Ok(None)
}

fn axis(point: &InMemDicomObject) -> Result<Option<[f64; 3]>, ContentError> {
    let Some(axis) = exactly::<3>(point, tags::CONTROL_POINT_ORIENTATION)? else {
        return Ok(None);
    };
    let axis = ras_from_lps(Vector3::from(axis)).try_normalize(1e-6);
    axis.map(|a| Some(a.into()))
        .ok_or_else(|| format!("{} has no length", name(tags::CONTROL_POINT_ORIENTATION)).into())
}

/// Returns a date, if there is one.
fn date(object: &InMemDicomObject, tag: Tag) -> Result<Option<Date>, ContentError> {
    let Some(text) = text(object, tag) else { return Ok(None) };
    // Files from before 1993 have points between.
    let digits: String = text.chars().filter(|c| *c != '.').collect();
    let date = Date::strptime("%Y%m%d", digits);
    date.map(Some)
        .map_err(|_| format!("{} is \"{}\", which is not a day", name(tag), short(&text)).into())
}
