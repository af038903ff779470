//! What a plan says of its seeds, compared with the source and the options that dose is computed with: refused where the dose
//! would be wrong, reported where it may be.

use super::{SeedFile, SeedRow};
use stylet_base::format::printable;
use stylet_base::nuclide::Nuclide;
use stylet_dose::Source;
use stylet_dose::decay::{days_to_s, left_after, s_to_days};
use stylet_files::dicom::plan::Date;

/// Half-lives of one isotope agree so well, as a share; tables differ by less.
const SAME_HALF_LIFE: f64 = 0.01;
/// Days that a strength may be old or young; a date beyond is a slip of the pen.
const MAX_DAYS: i32 = 3650;
/// Doses that differ by less are one.
const SAME_GY: f64 = 1e-6;

/// What a plan says of all its seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    /// Name of the model.
    pub model: String,
    /// Isotope, in any spelling.
    pub isotope: String,
    /// Half-life, in days.
    pub half_life_days: Option<f64>,
    /// Prescribed dose, in Gy.
    pub prescription_gy: Option<f64>,
    /// Day of the plan itself.
    pub planned_on: Option<Date>,
}

/// Why the dose would be wrong; the texts follow the name of the file.
#[derive(Debug, thiserror::Error)]
pub enum Mismatch {
    /// The seeds are of another nuclide than the source.
    #[error(
        "its seeds are {found} (model \"{found_model}\") and the source is {source_nuclide} (model \"{source_model}\"): the dose \
         would be wrong; choose a source file of {found} with --source"
    )]
    Nuclide {
        /// Isotope of the plan.
        found: String,
        /// Model in the plan.
        found_model: String,
        /// Isotope of the source.
        source_nuclide: String,
        /// Model of the source.
        source_model: String,
    },
    /// A strength whose day is years from that of the implant.
    #[error(
        "the strength of its seeds refers to {strength_on}, {days} days from the implant on {implant}; correct --implant-date"
    )]
    Date {
        /// Day of the strength.
        strength_on: Date,
        /// Day of the implant.
        implant: Date,
        /// Days between.
        days: i32,
    },
}

impl Declared {
    /// Compares with the source; what may be wrong comes back in words.
    pub fn check(&self, source: &Source) -> Result<Vec<String>, Mismatch> {
        let source_days = s_to_days(source.half_life_s);
        let other_days = self
            .half_life_days
            .filter(|days| (days / source_days - 1.0).abs() > SAME_HALF_LIFE);
        let is_same = match (Nuclide::parse(&self.isotope), Nuclide::parse(&source.nuclide)) {
            (Some(found), Some(of_source)) => found == of_source,
            // A name that nobody can read: nuclides of seeds differ in their half-lives.
            _ => other_days.is_none(),
        };
        if !is_same {
            return Err(Mismatch::Nuclide {
                found: shown(&self.isotope),
                found_model: shown(&self.model),
                source_nuclide: source.nuclide.clone(),
                source_model: source.model.clone(),
            });
        }
        let mut notes = Vec::new();
        if let Some(days) = other_days {
            notes.push(format!(
                "its half-life of {} is {days} days; that of the source counts, {source_days:.2} days",
                shown(&self.isotope)
            ));
        }
        if !self.is_of_model(source) {
            notes.push(format!(
                "its seeds are of model \"{}\"; dose is that of model \"{}\"",
                shown(&self.model),
                source.model
            ));
        }
        Ok(notes)
    }

    /// Whether the model has the name of the source's.
    pub fn is_of_model(&self, source: &Source) -> bool {
        is_same_model(&self.model, &source.model)
    }
}

impl SeedFile {
    /// Compares with source and options, and lets the strengths decay: the prescription in Gy, and what should be reported.
    pub fn agree(
        &mut self,
        source: &Source,
        asked_gy: Option<f64>,
        day: DayOfImplant,
    ) -> Result<(Option<f64>, Vec<String>), Mismatch> {
        let declared = self.declared.as_ref();
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(declared.map_or(Ok(Vec::new()), |d| d.check(source))?);
        notes.extend(day.decay(&mut self.rows, declared, source)?);
        let (prescription_gy, note) = prescription(asked_gy, declared, source);
        notes.extend(note);
        Ok((prescription_gy, notes))
    }
}

/// "OncoSeed 6711" is 6711; a plan that names no model is of any.
fn is_same_model(found: &str, of_source: &str) -> bool {
    let plain = |name: &str| name.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
    plain(found).is_empty() || plain(found).contains(&plain(of_source))
}

/// The beginning of a name out of a file.
fn shown(name: &str) -> String {
    printable(name).chars().take(40).collect()
}

/// The prescription in Gy: what was asked for, or the plan's, or the source's; and a note where they differ.
fn prescription(asked_gy: Option<f64>, declared: Option<&Declared>, source: &Source) -> (Option<f64>, Option<String>) {
    let of_plan = declared.and_then(|d| d.prescription_gy);
    let used = asked_gy.or(of_plan).or(source.prescription_gy);
    let (Some(of_plan), Some(used)) = (of_plan, used) else {
        return (used, None);
    };
    let differs = |gy: &f64| (gy - of_plan).abs() > SAME_GY;
    let note = match (asked_gy.filter(differs), source.prescription_gy.filter(differs)) {
        (Some(asked), _) => Some(format!(
            "it prescribes {of_plan} Gy; the {asked} Gy that were asked for count"
        )),
        (None, Some(usual)) => Some(format!(
            "it prescribes {of_plan} Gy, which counts; the source file names {usual} Gy"
        )),
        (None, None) => None,
    };
    (Some(used), note)
}

/// The day on which the seeds are implanted, and what the strengths of a file are then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DayOfImplant(pub Option<Date>);

impl DayOfImplant {
    /// Lets every strength that has a day decay to that of the implant. Without one the strengths stay, which is reported.
    fn decay(
        self,
        rows: &mut [SeedRow],
        declared: Option<&Declared>,
        source: &Source,
    ) -> Result<Option<String>, Mismatch> {
        let mut days: Vec<Date> = rows.iter().filter_map(|row| row.strength_on).collect();
        days.sort_unstable();
        let (Some(&first), Some(&last)) = (days.first(), days.last()) else {
            let note = self.0.filter(|_| !rows.is_empty());
            return Ok(note.map(|day| {
                format!("it gives no day for the strengths, so they are taken as those of the implant on {day}")
            }));
        };
        let when = match first == last {
            true => first.to_string(),
            false => format!("{first} to {last}"),
        };
        let Some(implant) = self.0 else {
            let old = declared.and_then(|d| d.planned_on).map_or_else(String::new, |planned| {
                format!(
                    " (the plan is of {planned}, {} days later)",
                    days_between(last, planned)
                )
            });
            return Ok(Some(format!(
                "strengths are used as of their reference date {when}{old}; give --implant-date to let them decay to that day"
            )));
        };
        for row in rows.iter_mut() {
            let Some(strength_on) = row.strength_on else { continue };
            let days = days_between(strength_on, implant);
            if days.abs() > MAX_DAYS {
                return Err(Mismatch::Date {
                    strength_on,
                    implant,
                    days,
                });
            }
            row.seed.strength_u *= left_after(days_to_s(f64::from(days)), source.half_life_s);
        }
        let left = left_after(days_to_s(f64::from(days_between(last, implant))), source.half_life_s);
        Ok(Some(format!(
            "strengths of {when} decay to the implant on {implant}: {:.1} % of the last are left",
            left * 100.0
        )))
    }
}

fn days_between(from: Date, to: Date) -> i32 {
    (to - from).get_days()
}

#[cfg(test)]
mod tests;
