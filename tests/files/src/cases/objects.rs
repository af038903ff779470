//! Small DICOM objects, made element by element, in LPS and mm.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::{DataSetSequence, PrimitiveValue};
use dicom_core::{DataElement, Length, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use std::path::Path;
use stylet_dose::Source;
use stylet_files::dicom::Identity;
use stylet_files::dicom::dose::{self, DoseImage, DoseKind, DoseOf};
use stylet_files::dicom::plan::{self, PlanSeed};
use stylet_implant::plan::exchange::seeds_of_source;

pub type Object = InMemDicomObject;
/// Corners of a contour.
pub type Contour = Vec<[f64; 3]>;

/// Distance of the planes of a contour and of the slices of a CT.
pub const SLICE_MM: f64 = 2.5;
const CORNERS: usize = 60;
/// Day of the plans.
const DAY: &str = "20260101";
/// Side of an image, and its columns and rows if it has no values.
const SIDE_MM: f64 = 64.0;
const PIXELS: usize = 128;

pub fn put(object: &mut Object, tag: Tag, value: &str) {
    let vr = StandardDataDictionary
        .by_tag(tag)
        .map_or(VR::UN, |entry| entry.vr().relaxed());
    let value = match vr {
        VR::US => PrimitiveValue::from(value.parse::<u16>().expect("a number")),
        _ => PrimitiveValue::from(value),
    };
    object.put(DataElement::new(tag, vr, value));
}

pub fn item(values: &[(Tag, &str)]) -> Object {
    let mut item = Object::new_empty();
    values.iter().for_each(|(tag, value)| put(&mut item, *tag, value));
    item
}

pub fn put_items(object: &mut Object, tag: Tag, items: Vec<Object>) {
    object.put(DataElement::new(
        tag,
        VR::SQ,
        DataSetSequence::new(items, Length::UNDEFINED),
    ));
}

/// Changes the items of a sequence.
pub fn change(object: &mut Object, tag: Tag, what: impl Fn(&mut Vec<Object>)) {
    let element = object.element(tag).expect("the sequence");
    let mut items = element.items().expect("a sequence").to_vec();
    what(&mut items);
    put_items(object, tag, items);
}

pub fn save(path: &Path, object: Object) {
    let meta = FileMetaTableBuilder::new().transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN);
    object
        .with_meta(meta)
        .expect("an object")
        .write_to_file(path)
        .expect("written");
}

fn of_bytes(bytes: &[u8]) -> Object {
    dicom_object::from_reader(&bytes[128..])
        .expect("an object")
        .into_inner()
}

pub fn identity() -> Identity {
    Identity {
        patient_name: "One^Case".to_owned(),
        patient_id: "P1".to_owned(),
        study: "1.2.3.5".to_owned(),
        frame_of_reference: "1.2.3.4".to_owned(),
        ..Identity::default()
    }
}

fn object(class: &str, modality: &str, uid: &str) -> Object {
    let of = identity();
    item(&[
        (tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192"),
        (tags::SOP_CLASS_UID, class),
        (tags::SOP_INSTANCE_UID, uid),
        (tags::MODALITY, modality),
        (tags::PATIENT_NAME, &of.patient_name),
        (tags::PATIENT_ID, &of.patient_id),
        (tags::STUDY_INSTANCE_UID, &of.study),
        (tags::FRAME_OF_REFERENCE_UID, &of.frame_of_reference),
        (tags::SERIES_INSTANCE_UID, "1.2.3.6"),
    ])
}

/// Returns circles in the planes of a ball.
pub fn ball(middle: [f64; 3], radius: f64) -> Vec<Contour> {
    let planes = (radius / SLICE_MM) as i32;
    let circle = |k: i32| {
        let off = f64::from(k) * SLICE_MM;
        let side = (radius * radius - off * off).sqrt();
        let corner = |n: usize| {
            let angle = std::f64::consts::TAU * n as f64 / CORNERS as f64;
            [
                middle[0] + side * angle.cos(),
                middle[1] + side * angle.sin(),
                middle[2] + off,
            ]
        };
        (0..CORNERS).map(corner).collect::<Contour>()
    };
    (-planes..=planes).map(circle).filter(|c| c[0][0] > middle[0]).collect()
}

/// Returns the volume of contours that each reach half-way to their neighbours, in cc.
pub fn volume_cc(contours: &[Contour]) -> f64 {
    let area = |c: &Contour| {
        let next = c.iter().skip(1).chain(c.first());
        c.iter()
            .zip(next)
            .map(|(a, b)| a[0] * b[1] - b[0] * a[1])
            .sum::<f64>()
            .abs()
            / 2.0
    };
    contours.iter().map(area).sum::<f64>() * SLICE_MM / 1e3
}

/// Returns a structure set of structures with number, name and contours.
pub fn structure_set(structures: &[(&str, &str, Vec<Contour>)]) -> Object {
    let mut set = object(uids::RT_STRUCTURE_SET_STORAGE, "RTSTRUCT", "1.2.3.20");
    put(&mut set, tags::STRUCTURE_SET_LABEL, "case");
    let frame = identity().frame_of_reference;
    put_items(
        &mut set,
        tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE,
        vec![item(&[(tags::FRAME_OF_REFERENCE_UID, &frame)])],
    );
    let roi = |(number, name, _): &(&str, &str, _)| {
        item(&[
            (tags::ROI_NUMBER, number),
            (tags::REFERENCED_FRAME_OF_REFERENCE_UID, &frame),
            (tags::ROI_NAME, name),
        ])
    };
    put_items(
        &mut set,
        tags::STRUCTURE_SET_ROI_SEQUENCE,
        structures.iter().map(roi).collect(),
    );
    let drawn = |(number, _, contours): &(&str, _, Vec<Contour>)| {
        let mut drawn = item(&[(tags::REFERENCED_ROI_NUMBER, number)]);
        put_items(
            &mut drawn,
            tags::CONTOUR_SEQUENCE,
            contours.iter().map(contour).collect(),
        );
        drawn
    };
    put_items(
        &mut set,
        tags::ROI_CONTOUR_SEQUENCE,
        structures.iter().map(drawn).collect(),
    );
    set
}

fn contour(corners: &Contour) -> Object {
    let numbers: Vec<String> = corners.iter().flatten().map(|v| format!("{v:.4}")).collect();
    item(&[
        (tags::CONTOUR_GEOMETRIC_TYPE, "CLOSED_PLANAR"),
        (tags::NUMBER_OF_CONTOUR_POINTS, &corners.len().to_string()),
        (tags::CONTOUR_DATA, &numbers.join("\\")),
    ])
}

/// Names images as those of a structure set.
pub fn put_images(set: &mut Object, uids_of: &[String]) {
    let image = |uid: &String| {
        item(&[
            (tags::REFERENCED_SOP_CLASS_UID, uids::CT_IMAGE_STORAGE),
            (tags::REFERENCED_SOP_INSTANCE_UID, uid),
        ])
    };
    let mut series = item(&[(tags::SERIES_INSTANCE_UID, "1.2.3.6")]);
    put_items(
        &mut series,
        tags::CONTOUR_IMAGE_SEQUENCE,
        uids_of.iter().map(image).collect(),
    );
    let mut study = item(&[
        (tags::REFERENCED_SOP_CLASS_UID, "1.2.840.10008.3.1.2.3.1"),
        (tags::REFERENCED_SOP_INSTANCE_UID, "1.2.3.5"),
    ]);
    put_items(&mut study, tags::RT_REFERENCED_SERIES_SEQUENCE, vec![series]);
    change(set, tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE, |frames| {
        put_items(&mut frames[0], tags::RT_REFERENCED_STUDY_SEQUENCE, vec![study.clone()]);
    });
}

/// Returns a slice of a CT whose middle is at x = y = 0; `values` in HU, x fastest, or 0 HU everywhere.
pub fn slice(uid: &str, z: &str, values: &[i16]) -> Object {
    let mut slice = object(uids::CT_IMAGE_STORAGE, "CT", uid);
    let values = if values.is_empty() {
        vec![0; PIXELS * PIXELS]
    } else {
        values.to_vec()
    };
    let pixels = values.len().isqrt();
    let pixel_mm = SIDE_MM / pixels as f64;
    let corner = (pixel_mm - SIDE_MM) / 2.0;
    for (tag, value) in [
        (
            tags::IMAGE_POSITION_PATIENT,
            format!("{corner}\\{corner}\\{z}").as_str(),
        ),
        (tags::IMAGE_ORIENTATION_PATIENT, "1\\0\\0\\0\\1\\0"),
        (tags::PIXEL_SPACING, &format!("{pixel_mm}\\{pixel_mm}")),
        (tags::ROWS, &pixels.to_string()),
        (tags::COLUMNS, &pixels.to_string()),
        (tags::SAMPLES_PER_PIXEL, "1"),
        (tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2"),
        (tags::BITS_ALLOCATED, "16"),
        (tags::BITS_STORED, "16"),
        (tags::HIGH_BIT, "15"),
        (tags::PIXEL_REPRESENTATION, "1"),
        (tags::RESCALE_SLOPE, "1"),
        (tags::RESCALE_INTERCEPT, "0"),
    ] {
        put(&mut slice, tag, value);
    }
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    slice.put(DataElement::new(
        tags::PIXEL_DATA,
        VR::OW,
        PrimitiveValue::U8(bytes.into()),
    ));
    slice
}

/// Writes a CT with slices at these heights; returns the UIDs of its images.
pub fn save_ct(folder: &Path, heights: &[f64]) -> Vec<String> {
    let save_slice = |(n, z): (usize, &f64)| {
        let uid = format!("1.2.3.6.{}", n + 1);
        save(&folder.join(format!("{n:03}.dcm")), slice(&uid, &format!("{z}"), &[]));
        uid
    };
    heights.iter().enumerate().map(save_slice).collect()
}

/// Returns an RT Plan of seeds of 0.5 U at places in RAS and mm.
pub fn seed_plan(places: &[[f64; 3]], prescription_gy: f64) -> Object {
    let seed = |p: &[f64; 3]| PlanSeed {
        needle: None,
        hole: String::new(),
        position_m: p.map(|mm| mm * 1e-3),
        axis: Some([0.0, 0.0, 1.0]),
        strength_u: 0.5,
        strength_on: None,
    };
    let source = Source::known("6711").expect("the usual source");
    let seeds = places.iter().map(seed).collect();
    let plan = seeds_of_source(&source, seeds, Some(prescription_gy), identity());
    let mut plan = of_bytes(&plan::bytes(&plan).expect("a plan"));
    put(&mut plan, tags::RT_PLAN_DATE, DAY);
    change(&mut plan, tags::SOURCE_SEQUENCE, |sources| {
        let dated = |source| put(source, tags::SOURCE_STRENGTH_REFERENCE_DATE, DAY);
        sources.iter_mut().for_each(dated);
    });
    plan
}

/// Returns an RT Dose of 100 Gy in a cube around the origin.
pub fn even_dose() -> Object {
    let image = DoseImage {
        dims: [21; 3],
        origin_m: [-0.03; 3],
        spacing_m: [3e-3; 3],
        dose_gy: &[100.0; 21 * 21 * 21],
        kind: &DoseKind::default(),
    };
    let of = DoseOf {
        uid: "1.2.3.30",
        identity: &identity(),
        plan: "1.2.3.31",
        structure_set: None,
        histograms: &[],
    };
    of_bytes(&dose::bytes(&image, &of).expect("a dose"))
}
