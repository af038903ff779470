//! Contours of one structure as the file has them: those that enclose no area are left out, with a
//! note.

use super::super::super::element::short;
use super::super::values::{items, name, number, numbers, text};
use super::{Contoured, SAME_PLANE_M, area_vector, planes};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stylet_anatomy::ras_from_lps;

const MAX_MM: f64 = 10_000.0;
const EXCLUSIVE: &str = "CLOSEDPLANAR_XOR";
/// Area below which a contour is a point or a line.
const NO_AREA_M2: f64 = 1e-12;

/// Contours of a structure, with those that are left out, by the reason.
pub struct Drawn {
    pub number: f64,
    structure: Contoured,
    /// Whether the file says that overlaps of contours are holes.
    is_exclusive: bool,
    left_out: BTreeMap<String, usize>,
    /// Contours whose stated number of corners is another one.
    miscounted: usize,
}

impl Drawn {
    pub fn of(item: &InMemDicomObject, number: f64, called: String) -> Result<Self, ContentError> {
        let mut drawn = Self {
            number,
            structure: Contoured {
                name: called,
                contours: Vec::new(),
            },
            is_exclusive: true,
            left_out: BTreeMap::new(),
            miscounted: 0,
        };
        for contour in items(item, tags::CONTOUR_SEQUENCE) {
            let added = drawn.add(contour);
            added.map_err(|why| why.within(short(&drawn.structure.name)))?;
        }
        Ok(drawn)
    }

    fn add(&mut self, contour: &InMemDicomObject) -> Result<(), ContentError> {
        let kind = text(contour, tags::CONTOUR_GEOMETRIC_TYPE).unwrap_or_default();
        if !["CLOSED_PLANAR", EXCLUSIVE].contains(&kind.as_str()) {
            let kind = if kind.is_empty() { "of no kind" } else { &kind };
            self.leave_out(format!("{} is {}", name(tags::CONTOUR_GEOMETRIC_TYPE), short(kind)));
            return Ok(());
        }
        let values = numbers(contour, tags::CONTOUR_DATA)?.unwrap_or_default();
        if values.len() % 3 != 0 {
            return Err(invalid!(
                "{} has {} values; each corner of a contour has three",
                name(tags::CONTOUR_DATA),
                values.len()
            ));
        }
        if let Some(far) = values.iter().find(|v| v.abs() > MAX_MM) {
            return Err(invalid!("a corner is at {far} mm; at most {MAX_MM} mm is accepted"));
        }
        let corner = |p: &[f64]| ras_from_lps(Vector3::new(p[0], p[1], p[2])) * 1e-3;
        let mut corners: Vec<_> = values.chunks_exact(3).map(corner).collect();
        let stated = number(contour, tags::NUMBER_OF_CONTOUR_POINTS).ok().flatten();
        self.miscounted += usize::from(stated.is_some_and(|stated| stated != corners.len() as f64));
        // A contour that is run through twice would enclose nothing.
        let half = corners.len() / 2;
        if half >= 3 && corners[..half] == corners[half..] {
            corners.truncate(half);
        }
        if corners.len() < 3 {
            self.leave_out(format!("{} has fewer than three corners", name(tags::CONTOUR_DATA)));
            return Ok(());
        }
        let Some(normal) = area_vector(&corners).try_normalize(NO_AREA_M2) else {
            self.leave_out("it encloses no area".to_owned());
            return Ok(());
        };
        let off = corners.iter().map(|p| (p - corners[0]).dot(&normal).abs());
        let off_m = off.fold(0.0, f64::max);
        if off_m > 10.0 * SAME_PLANE_M {
            return Err(invalid!(
                "a contour called planar is {:.2} mm off its plane",
                off_m * 1e3
            ));
        }
        self.is_exclusive &= kind == EXCLUSIVE;
        self.structure.contours.push(corners);
        Ok(())
    }

    fn leave_out(&mut self, why: String) {
        *self.left_out.entry(why).or_default() += 1;
    }

    /// Adds contours of the same structure from another item of the file; returns a note.
    pub fn and(&mut self, other: Self) -> Option<String> {
        self.structure.contours.extend(other.structure.contours);
        self.is_exclusive &= other.is_exclusive;
        self.miscounted += other.miscounted;
        for (why, count) in other.left_out {
            *self.left_out.entry(why).or_default() += count;
        }
        Some(format!(
            "{}: its contours are in several items of {} and are taken together",
            short(&self.structure.name),
            name(tags::ROI_CONTOUR_SEQUENCE)
        ))
    }

    /// Returns the structure without duplicates and partial overlaps, `None` if nothing of it
    /// encloses a volume; and remarks.
    pub fn tidied(mut self) -> (Option<Contoured>, Vec<String>) {
        let called = short(&self.structure.name);
        if self.structure.contours.is_empty() {
            let whys: Vec<String> = self.left_out.into_keys().collect();
            let why = match whys.is_empty() {
                true => format!("{} is missing or empty", name(tags::CONTOUR_SEQUENCE)),
                false => whys.join("; "),
            };
            return (None, vec![format!("{called} is left out: {why}")]);
        }
        let total = self.structure.contours.len() + self.left_out.values().sum::<usize>();
        let left_out = self.left_out.iter();
        let mut notes: Vec<String> = left_out
            .map(|(why, count)| format!("{called}: {count} of its {total} contours left out: {why}"))
            .collect();
        if self.miscounted > 0 {
            notes.push(format!(
                "{called}: {} of {} contours is not the number of corners in {}, which counts",
                name(tags::NUMBER_OF_CONTOUR_POINTS),
                self.miscounted,
                name(tags::CONTOUR_DATA)
            ));
        }
        notes.extend(planes::tidy(&mut self.structure, self.is_exclusive));
        (Some(self.structure), notes)
    }
}
