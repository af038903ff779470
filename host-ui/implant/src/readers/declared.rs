//! Declarations of a plan about its seeds, compared with the source and the options of the dose:
//! refused if the dose would be wrong, reported if it may be.

use super::SeedFile;
use stylet_base::format::printable;
use stylet_base::nuclide::Nuclide;
use stylet_dose::Source;
use stylet_dose::decay::{days_to_s, left_after, s_to_days};
use stylet_files::dicom::plan::{Date, PlanSeed};

/// Largest difference between half-lives of one isotope, as a share; tables differ by less.
const SAME_HALF_LIFE: f64 = 0.01;
/// Largest age of a strength in days; a date beyond is a typing error.
const MAX_DAYS: i32 = 3650;
/// Strengths of the seeds of permanent implants, U.
const USUAL_U: std::ops::RangeInclusive<f64> = 0.05..=10.0;
/// Half-lives after the implant on which a strength may be given: an implant may be brought forward.
const MOST_HALF_LIVES_AHEAD: f64 = 0.5;
/// Difference below which doses are equal.
const SAME_GY: f64 = 1e-6;

/// Declarations of a plan about all its seeds.
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

/// Reason why the dose would be wrong; the texts follow the name of the file.
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
    /// The reference day of a strength is years from the implant.
    #[error(
        "the strength of its seeds refers to {strength_on}, {} the implant on {implant}; correct --implant-date",
        before(.days)
    )]
    Date {
        /// Day of the strength.
        strength_on: Date,
        /// Day of the implant.
        implant: Date,
        /// Days from the strength to the implant.
        days: i32,
    },
    /// A seed without strength.
    #[error("its seed {number} has a strength of 0 U; give its strength")]
    NoStrength {
        /// Number of the seed, from 1.
        number: usize,
    },
}

/// Returns the days from a strength to the implant in words.
fn before(days: &i32) -> String {
    match days {
        ahead @ ..0 => format!("{} days after", -ahead),
        days => format!("{days} days before"),
    }
}

impl Declared {
    /// Compares with the source; returns possible errors in words.
    pub fn check(&self, source: &Source) -> Result<Vec<String>, Mismatch> {
        let source_days = s_to_days(source.half_life_s);
        let other_days = self
            .half_life_days
            .filter(|days| (days / source_days - 1.0).abs() > SAME_HALF_LIFE);
        let is_same = match (Nuclide::parse(&self.isotope), Nuclide::parse(&source.nuclide)) {
            (Some(found), Some(of_source)) => found == of_source,
            // An unreadable name: nuclides of seeds differ in their half-lives.
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

    /// Returns whether the model has the name of the source's.
    pub fn is_of_model(&self, source: &Source) -> bool {
        is_same_model(&self.model, &source.model)
    }
}

impl SeedFile {
    /// Compares with source and options, and decays the strengths to the day of the implant. Returns the prescription in Gy,
    /// and remarks.
    pub fn agree(
        &mut self,
        source: &Source,
        asked_gy: Option<f64>,
        implant: Option<Date>,
    ) -> Result<(Option<f64>, Vec<String>), Mismatch> {
        let declared = self.declared.as_ref();
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(declared.map_or(Ok(Vec::new()), |d| d.check(source))?);
        notes.extend(strengths(&self.rows)?);
        notes.extend(decay(implant, &mut self.rows, declared, source)?);
        let (prescription_gy, note) = prescription(asked_gy, declared, source);
        notes.extend(note);
        Ok((prescription_gy, notes))
    }
}

/// Refuses seeds without a strength; reports strengths that no seed of a permanent implant has.
fn strengths(rows: &[PlanSeed]) -> Result<Option<String>, Mismatch> {
    if let Some(place) = rows.iter().position(|row| row.strength_u <= 0.0) {
        return Err(Mismatch::NoStrength { number: place + 1 });
    }
    let unusual = rows.iter().map(|row| row.strength_u).filter(|u| !USUAL_U.contains(u));
    let (count, most) = unusual.fold((0, 0.0_f64), |(count, most), u| (count + 1, most.max(u)));
    Ok((count > 0).then(|| {
        format!(
            "{count} of its {} seeds have an unusual strength, up to {most} U (permanent seeds have {} to {} U): is it in U?",
            rows.len(),
            USUAL_U.start(),
            USUAL_U.end()
        )
    }))
}

/// Compares models: "OncoSeed 6711" is 6711; a plan without a model matches any.
fn is_same_model(found: &str, of_source: &str) -> bool {
    let plain = |name: &str| name.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
    plain(found).is_empty() || plain(found).contains(&plain(of_source))
}

/// Returns the beginning of a name from a file.
fn shown(name: &str) -> String {
    printable(name).chars().take(40).collect()
}

/// Returns the prescription in Gy: the requested one, or the plan's, or the source's; and a note if
/// they differ.
fn prescription(asked_gy: Option<f64>, declared: Option<&Declared>, source: &Source) -> (Option<f64>, Option<String>) {
    let of_plan = declared.and_then(|d| d.prescription_gy);
    let used = asked_gy.or(of_plan).or(source.prescription_gy);
    let (Some(of_plan), Some(used)) = (of_plan, used) else {
        return (used, None);
    };
    let differs = |gy: &f64| (gy - of_plan).abs() > SAME_GY;
    let note = match (asked_gy.filter(differs), source.prescription_gy.filter(differs)) {
        (Some(asked), _) => Some(format!("it prescribes {of_plan} Gy; the requested {asked} Gy apply")),
        (None, Some(usual)) => Some(format!(
            "it prescribes {of_plan} Gy, which counts; the source file names {usual} Gy"
        )),
        (None, None) => None,
    };
    (Some(used), note)
}

/// Decays every strength with a date to the day of the implant. Without that day the strengths
/// stay, which is reported.
fn decay(
    implant: Option<Date>,
    rows: &mut [PlanSeed],
    declared: Option<&Declared>,
    source: &Source,
) -> Result<Option<String>, Mismatch> {
    let mut days: Vec<Date> = rows.iter().filter_map(|row| row.strength_on).collect();
    days.sort_unstable();
    let (Some(&first), Some(&last)) = (days.first(), days.last()) else {
        let note = implant.filter(|_| !rows.is_empty());
        return Ok(
            note.map(|day| format!("it gives no day for the strengths, so they are assumed for the implant on {day}"))
        );
    };
    let when = match first == last {
        true => first.to_string(),
        false => format!("{first} to {last}"),
    };
    let Some(implant) = implant else {
        let old =
            declared
                .and_then(|d| d.planned_on)
                .map_or_else(String::new, |planned| match days_between(last, planned) {
                    0 => " (the day of the plan)".to_owned(),
                    days if days < 0 => format!(" (the plan is of {planned}, {} days earlier)", -days),
                    days => format!(" (the plan is of {planned}, {days} days later)"),
                });
        return Ok(Some(format!(
            "strengths are used as of their reference date {when}{old}; give --implant-date to let them decay to that day"
        )));
    };
    for row in rows.iter_mut() {
        let Some(strength_on) = row.strength_on else { continue };
        let days = days_between(strength_on, implant);
        let half_lives = days_to_s(f64::from(-days)) / source.half_life_s;
        if days.abs() > MAX_DAYS || half_lives > MOST_HALF_LIVES_AHEAD {
            return Err(Mismatch::Date {
                strength_on,
                implant,
                days,
            });
        }
        row.strength_u *= left_after(days_to_s(f64::from(days)), source.half_life_s);
    }
    let ahead = days_between(implant, last);
    let left = left_after(days_to_s(f64::from(-ahead)), source.half_life_s) * 100.0;
    Ok(Some(match ahead > 0 {
        true => format!(
            "strengths of {when} are counted back to the implant on {implant}, {ahead} days before: {left:.1} % of the last one"
        ),
        false => {
            format!("strengths of {when} decay to the implant on {implant}: {left:.1} % of the last one remain")
        }
    }))
}
fn days_between(from: Date, to: Date) -> i32 {
    (to - from).get_days()
}

#[cfg(test)]
mod tests;
