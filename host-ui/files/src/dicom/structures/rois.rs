//! Names and frames of the structures of a file: a number that is given twice, and two frames in
//! one file, are refused.

use super::super::super::element::short;
use super::super::values::{items, name, needed, text};
use super::Contoured;
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;

/// Structures of a file, with their numbers.
pub struct Rois(Vec<(f64, Option<String>)>);

impl Rois {
    pub fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let mut all: Vec<(f64, Option<String>)> = Vec::new();
        let mut frames: Vec<(String, String)> = Vec::new();
        frames.extend(text(data, tags::FRAME_OF_REFERENCE_UID).map(|uid| ("the file".to_owned(), uid)));
        for roi in items(data, tags::STRUCTURE_SET_ROI_SEQUENCE) {
            let number = needed(roi, tags::ROI_NUMBER, -2e9, 2e9)?;
            let roi_name = text(roi, tags::ROI_NAME);
            let shown = short(roi_name.as_deref().unwrap_or("a structure without a name"));
            if let Some((_, other)) = all.iter().find(|(n, other)| *n == number && *other != roi_name) {
                let other = short(other.as_deref().unwrap_or("a structure without a name"));
                return Err(invalid!(
                    "{} {number} is given twice, to {other} and to {shown}, so it is not known whose contours are whose; \
                     export it again",
                    name(tags::ROI_NUMBER)
                ));
            }
            frames.extend(text(roi, tags::REFERENCED_FRAME_OF_REFERENCE_UID).map(|uid| (shown, uid)));
            all.push((number, roi_name));
        }
        let first = frames.first();
        if let Some((one, other)) = first.and_then(|one| Some((one, frames.iter().find(|f| f.1 != one.1)?))) {
            return Err(invalid!(
                "it is in two frames of reference: {} in {}, {} in {}; export structures of one frame",
                one.0,
                short(&one.1),
                other.0,
                short(&other.1)
            ));
        }
        Ok(Self(all))
    }

    /// Returns the name of the structure with a number; reports one without a name.
    pub fn name(&self, number: f64, notes: &mut Vec<String>) -> String {
        let known = self.0.iter().find(|(n, _)| *n == number);
        if let Some(known) = known.and_then(|(_, known)| known.clone()) {
            return known;
        }
        let made = format!("ROI {number}");
        let without = match known {
            Some(_) => name(tags::ROI_NAME),
            None => format!(
                "{} with {} {number}",
                name(tags::STRUCTURE_SET_ROI_SEQUENCE),
                name(tags::ROI_NUMBER)
            ),
        };
        let note = format!("{without} is missing, so the structure is called {made}");
        if !notes.contains(&note) {
            notes.push(note);
        }
        made
    }
}

/// Reports structures that share a name.
pub fn same_names(structures: &[Contoured]) -> Vec<String> {
    let is = |one: &Contoured, other: &Contoured| one.name.eq_ignore_ascii_case(&other.name);
    let count = |one: &Contoured| structures.iter().filter(|other| is(one, other)).count();
    let is_first = |n: usize| structures[..n].iter().all(|earlier| !is(earlier, &structures[n]));
    let firsts = (0..structures.len()).filter(|&n| is_first(n));
    let several = firsts.map(|n| &structures[n]).filter(|one| count(one) > 1);
    several
        .map(|one| {
            format!(
                "{} structures are called {}; where one of them is chosen by its name, the first in the file is taken",
                count(one),
                short(&one.name)
            )
        })
        .collect()
}
