//! Objects with attributes removed, emptied, doubled or contradicted: each answer is that of the
//! unchanged object, a refusal, or comes with a note that names the attribute.

use super::super::element::Endian;
use super::dose::{DoseImage, DoseKind, DoseOf};
use super::structures::StructureSet;
use super::structures::write::{Outlined, Written};
use super::values::items;
use super::write::{bytes as file_bytes, sequence};
use super::{Identity, checked, dose, plan, segmentation, series, structures};
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::header::Header;
use dicom_core::value::{PrimitiveValue, Value};
use dicom_core::{DataElement, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Objects of each kind in the everyday suite; `make attributes` sets another number.
const OBJECTS: usize = 150;
const NUMBER: &str = "STYLET_ATTRIBUTES";

/// Figures of an answer, and its notes; or the reason of a refusal.
type Answer = Result<(Vec<f64>, Vec<String>), String>;

/// Values that contradict another attribute of the same object.
const CONTRADICTIONS: [(Tag, &str); 24] = [
    (tags::NUMBER_OF_CONTOUR_POINTS, "3"),
    (tags::REFERENCED_ROI_NUMBER, "2"),
    (tags::ROI_NUMBER, "2"),
    (tags::FRAME_OF_REFERENCE_UID, "1.2.3.9"),
    (tags::REFERENCED_FRAME_OF_REFERENCE_UID, "1.2.3.9"),
    (tags::NUMBER_OF_CONTROL_POINTS, "1"),
    (tags::CHANNEL_NUMBER, "2"),
    (tags::SOURCE_NUMBER, "2"),
    (tags::REFERENCED_SOURCE_NUMBER, "77"),
    (tags::REFERENCED_BRACHY_APPLICATION_SETUP_NUMBER, "7"),
    (tags::APPLICATION_SETUP_NUMBER, "7"),
    (tags::NUMBER_OF_BRACHY_APPLICATION_SETUPS, "3"),
    (tags::NUMBER_OF_FRAMES, "2"),
    (tags::ROWS, "2"),
    (tags::COLUMNS, "7"),
    (tags::BITS_ALLOCATED, "16"),
    (tags::BITS_STORED, "12"),
    (tags::HIGH_BIT, "11"),
    (tags::SAMPLES_PER_PIXEL, "3"),
    (tags::SOURCE_ISOTOPE_NAME, "Pd-103"),
    (tags::SEGMENT_NUMBER, "2"),
    (tags::REFERENCED_SEGMENT_NUMBER, "2"),
    (tags::SEGMENTATION_TYPE, "FRACTIONAL"),
    (tags::SPACING_BETWEEN_SLICES, "1.25"),
];

struct Random(u64);

impl Random {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % most
    }
}

/// Place of an attribute: the items on the way, and its tag.
type Place = (Vec<(Tag, usize)>, Tag);

fn places(object: &InMemDicomObject, way: &[(Tag, usize)], all: &mut Vec<Place>) {
    for element in object.iter() {
        let tag = element.tag();
        all.push((way.to_vec(), tag));
        for (n, item) in items(object, tag).iter().enumerate() {
            places(item, &[way, &[(tag, n)]].concat(), all);
        }
    }
}

fn change(object: &mut InMemDicomObject, way: &[(Tag, usize)], what: &mut dyn FnMut(&mut InMemDicomObject)) {
    let Some(((tag, n), rest)) = way.split_first() else {
        return what(object);
    };
    object.update_value(*tag, |value| {
        if let Some(item) = value.items_mut().and_then(|items| items.get_mut(*n)) {
            change(item, rest, what);
        }
    });
}

fn damage(object: &mut InMemDicomObject, (way, tag): &Place, random: &mut Random) {
    let kind = random.below(4);
    change(object, way, &mut |object| {
        let Some(element) = object.get(*tag).cloned() else {
            return;
        };
        let vr = element.vr();
        match (kind, CONTRADICTIONS.iter().find(|(of, _)| of == tag)) {
            (0, _) => {
                object.remove_element(*tag);
            }
            (1, _) if vr == VR::SQ => {
                object.put(sequence(*tag, Vec::new()));
            }
            (1, _) => {
                object.put(DataElement::new(*tag, vr, PrimitiveValue::Empty));
            }
            (3, Some((_, value))) => {
                let whole = |text: &str| PrimitiveValue::from(text.parse::<u16>().unwrap_or_default());
                let value = if vr == VR::US {
                    whole(value)
                } else {
                    PrimitiveValue::from(*value)
                };
                object.put(DataElement::new(*tag, vr, value));
            }
            _ if vr == VR::SQ => {
                let mut all = items(object, *tag).to_vec();
                all.extend(all.first().cloned());
                object.put(sequence(*tag, all));
            }
            _ => {
                if let Value::Primitive(value) = element.value()
                    && let Ok(text) = value.to_str().into_owned().parse::<String>()
                {
                    let twice = PrimitiveValue::Strs(vec![text.clone(), text].into());
                    object.put(DataElement::new(*tag, if vr == VR::US { VR::IS } else { vr }, twice));
                }
            }
        }
    });
}

fn outlined(name: &str, side: f64) -> Outlined {
    let square = |z: f64| {
        let corner = |[x, y]: [f64; 2]| Vector3::new(x * side, y * side, z);
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(corner)
            .to_vec()
    };
    Outlined {
        name: name.to_owned(),
        contours: (0..5).map(|k| square(f64::from(k) * 2.5e-3)).collect(),
    }
}

fn of_structures(object: &checked::Object, _: &[u8]) -> Answer {
    let set = StructureSet::of(object).map_err(|why| why.to_string())?;
    let mut notes = set.notes.clone();
    let names: Vec<String> = set.structures.iter().map(|s| s.name.clone()).collect();
    let v = set.voxels(None).map_err(|why| why.to_string())?;
    notes.extend(v.frame.warning.clone());
    let mut figures = v.frame.spacing_m.to_vec();
    for (name, label) in names.iter().zip(1..) {
        figures.push(v.labels.iter().filter(|l| **l == label).count() as f64);
        figures.extend(name.bytes().map(f64::from));
    }
    Ok((figures, notes))
}

fn of_plan(object: &checked::Object, _: &[u8]) -> Answer {
    let plan = plan::of(object).map_err(|why| why.to_string())?;
    let mut figures = vec![
        plan.prescription_gy.unwrap_or(-1.0),
        plan.source.half_life_days,
        plan.source.active_length_m,
    ];
    for seed in &plan.seeds {
        figures.extend(seed.position_m);
        figures.extend(seed.axis.unwrap_or([9.0; 3]));
        let day = seed.strength_on.map_or(-1.0, |day| f64::from(day.day_of_year()));
        figures.extend([
            seed.strength_u,
            day,
            seed.needle.map_or(-1.0, f64::from),
            seed.hole.len() as f64,
        ]);
    }
    Ok((figures, plan.notes))
}

fn of_dose(object: &checked::Object, pixels: &[u8]) -> Answer {
    let dose = dose::of(object, pixels, Endian::Little).map_err(|why| why.to_string())?;
    let dims = dose.dims.map(|d| d as f64);
    let figures = [dims.as_slice(), &dose.origin_m, &dose.spacing_m, &dose.dose_gy].concat();
    Ok((figures, dose.notes))
}

fn of_segmentation(object: &checked::Object, pixels: &[u8]) -> Answer {
    let v = segmentation::of(object, pixels, Endian::Little).map_err(|why| why.to_string())?;
    let mut figures = v.dims.map(|d| d as f64).to_vec();
    figures.extend(v.labels.iter().map(|label| f64::from(*label)));
    figures.extend(v.frame.columns_m().iter().chain(&v.frame.origin_m));
    figures.extend(v.names.values().flat_map(|name| name.bytes().map(f64::from)));
    Ok((figures, v.frame.warning.into_iter().chain(v.overlap).collect()))
}

/// Reads a damaged slice of a CT together with the whole one beside it.
fn of_image(object: &checked::Object, pixels: &[u8]) -> Answer {
    let beside = file_bytes(series::tests::slice("2.25.4", 1)).unwrap();
    let (beside, its_pixels, endian) = checked::read_with_pixels(&beside).unwrap();
    let frames = [(object, pixels), (&beside, &*its_pixels)];
    let frames = frames.map(|(object, pixels)| series::frame_of(object, pixels, endian));
    let frames: Result<Vec<series::Frame>, _> = frames.into_iter().collect();
    let volume = frames.and_then(series::volume).map_err(|why| why.to_string())?;
    let mut figures = volume.dims.map(|d| d as f64).to_vec();
    figures.extend(volume.values.iter().map(|value| f64::from(*value)));
    figures.extend(volume.frame.columns_m().iter().chain(&volume.frame.origin_m));
    Ok((figures, volume.frame.warning.into_iter().collect()))
}

/// Returns how many answers were equal, refused, noted, and the silent ones in words.
fn tried(name: &str, content: &[u8], answer: fn(&checked::Object, &[u8]) -> Answer) -> ([usize; 3], Vec<String>) {
    let object = || checked::read(content).unwrap();
    let pixels = checked::read_with_pixels(content).map_or(Vec::new(), |(_, pixels, _)| pixels.to_vec());
    let (whole, usual) = answer(&object(), &pixels).unwrap();
    let mut all = Vec::new();
    places(&object().data, &[], &mut all);
    let count = std::env::var(NUMBER)
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(OBJECTS);
    let alias = |tag: Tag| {
        StandardDataDictionary
            .by_tag(tag)
            .map_or(String::new(), |entry| entry.alias().to_owned())
    };
    let (mut counts, mut silent) = ([0; 3], BTreeMap::new());
    let mut random = Random(name.len() as u64 + 7);
    for _ in 0..count {
        let mut object = object();
        let changed: Vec<Place> = (0..=random.below(3))
            .map(|_| all[random.below(all.len())].clone())
            .collect();
        for place in &changed {
            damage(&mut object.data, place, &mut random);
        }
        let names: Vec<String> = changed
            .iter()
            .flat_map(|(way, tag)| way.iter().map(|(tag, _)| *tag).chain([*tag]))
            .map(alias)
            .filter(|name| !name.is_empty())
            .collect();
        match answer(&object, &pixels) {
            Err(_) => counts[1] += 1,
            Ok((figures, _)) if figures == whole => counts[0] += 1,
            Ok((_, notes)) => {
                let is_named = |note: &String| names.iter().any(|name| note.contains(name.as_str()));
                if notes.iter().filter(|note| !usual.contains(note)).any(is_named) {
                    counts[2] += 1;
                } else {
                    let what: Vec<String> = changed.iter().map(|(_, tag)| alias(*tag)).collect();
                    silent.insert(what.join(", "), notes.join("; "));
                }
            }
        }
    }
    let silent = silent
        .into_iter()
        .map(|(what, notes)| format!("{name}: {what}: {notes}"));
    (counts, silent.collect())
}

#[test]
fn damaged_attributes_are_harmless_refused_or_named() {
    let identity = Identity::new();
    let set = Written {
        uid: "2.25.1",
        identity: &identity,
        images: &[],
        structures: &[outlined("Prostate", 15e-3), outlined("Urethra", 3e-3)],
    };
    let image = DoseImage {
        dims: [3, 4, 3],
        origin_m: [0.0; 3],
        spacing_m: [1e-3, 2e-3, 3e-3],
        dose_gy: &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0].repeat(4),
        kind: &DoseKind::default(),
    };
    let of = DoseOf {
        uid: "2.25.2",
        identity: &identity,
        plan: "2.25.3",
        structure_set: None,
        histograms: &[],
    };
    let mut silent = Vec::new();
    for (name, content, answer) in [
        (
            "structures",
            structures::write::bytes(&set).unwrap(),
            of_structures as fn(&checked::Object, &[u8]) -> Answer,
        ),
        ("plan", plan::bytes(&plan::tests::plan(5)).unwrap(), of_plan),
        ("dose", dose::bytes(&image, &of).unwrap(), of_dose),
        (
            "segmentation",
            segmentation::write::bytes(&segmentation::tests::volume(false), &identity).unwrap(),
            of_segmentation,
        ),
        (
            "image",
            file_bytes(series::tests::slice("2.25.4", 0)).unwrap(),
            of_image,
        ),
    ] {
        let (counts, found) = tried(name, &content, answer);
        println!(
            "{name}: {} equal, {} refused, {} noted, {} kinds silent",
            counts[0],
            counts[1],
            counts[2],
            found.len()
        );
        assert!(counts[0] > 0 && counts[1] > 0, "{name}: {counts:?}");
        silent.extend(found);
    }
    assert!(
        silent.is_empty(),
        "{} kinds silent:\n{}",
        silent.len(),
        silent.join("\n")
    );
    // A change that must be found.
    let mut object = checked::read(&structures::write::bytes(&set).unwrap()).unwrap();
    object.data.put(sequence(tags::ROI_CONTOUR_SEQUENCE, Vec::new()));
    assert!(of_structures(&object, &[]).is_err());
}
