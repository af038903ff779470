//! Plans in files: TOML for the whole plan, CSV for the seeds alone; mm, patient frame (RAS).

use super::problem::{FileProblem, SeedsProblem};
use super::{Hole, ImplantPlan, Loading, Needle, NeedleSeed, PlanError, Template};
use crate::readers::SeedFile;
use nalgebra::Vector3;
use std::path::Path;
use stylet_anatomy::PatientFrame;
use stylet_base::input;
use stylet_procedure::{NeedleFile, PlanFile, PlanProblem, TemplateFile};
use stylet_shm_schema::ProblemList;

const MAX_BYTES: u64 = 4 << 20;
/// Distance below which the lines of seeds are one needle.
const SAME_LINE_M: f64 = 0.5e-3;
const HEADER: &str = "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u,needle,hole";

/// Formats a plan as TOML.
pub fn to_text(plan: &ImplantPlan, patient: &PatientFrame) -> Result<String, PlanError> {
    let (mm, turned) = (
        |v: [f64; 3]| patient.patient_from_scene(v).map(|c| c * 1e3),
        |d| patient.patient_from_scene_direction(d),
    );
    let t = &plan.template;
    let needle = |n: &Needle| NeedleFile {
        hole: n.hole.map(|h| h.to_string()),
        entry_mm: mm(n.entry_m),
        direction: turned(n.direction),
        depth_mm: n.depth_m * 1e3,
        retract_to_mm: n.retract_to_m * 1e3,
        spacer_mm: match n.loading {
            Loading::Loose => None,
            Loading::Stranded { spacer_m } => Some(spacer_m * 1e3),
        },
        seed_along_mm: n.seeds.iter().map(|s| s.along_m * 1e3).collect(),
        strength_u: n.seeds.iter().map(|s| s.strength_u).collect(),
    };
    let file = PlanFile {
        format: PlanFile::FORMAT.to_owned(),
        source: plan.source.clone(),
        prescription_gy: plan.prescription_gy,
        template: TemplateFile {
            middle_hole_mm: mm(t.middle_m),
            columns: turned(t.columns),
            rows: turned(t.rows),
            inwards: turned(t.inwards),
            pitch_mm: t.pitch_m * 1e3,
        },
        needles: plan.needles.iter().map(needle).collect(),
    };
    Ok(toml::to_string(&file)?)
}

/// Parses TOML; lists every problem.
pub fn from_text(text: &str, patient: &PatientFrame) -> Result<ImplantPlan, ProblemList<FileProblem>> {
    let file: PlanFile = toml::from_str(text).map_err(FileProblem::from)?;
    let mut problems: Vec<FileProblem> = file.problems().into_iter().map(FileProblem::from).collect();
    let needles = (1..).zip(&file.needles).map(|(number, n)| {
        let hole = n.hole.as_deref().map(str::parse::<Hole>).transpose();
        let hole = hole.unwrap_or_else(|problem| {
            problems.push(FileProblem::Hole { number, problem });
            None
        });
        needle(n, hole, patient).in_order_of_file()
    });
    let needles = needles.collect();
    ProblemList::check(problems)?;
    Ok(ImplantPlan {
        template: template(&file.template, patient),
        source: file.source,
        prescription_gy: file.prescription_gy,
        needles,
    })
}

impl Needle {
    /// Sorts the seeds deepest first, keeping the depth of the file.
    fn in_order_of_file(self) -> Self {
        let depth_m = self.depth_m;
        Self {
            depth_m,
            ..self.in_order()
        }
    }
}

fn template(file: &TemplateFile, patient: &PatientFrame) -> Template {
    Template {
        middle_m: patient.scene_from_patient(file.middle_hole_mm.map(|c| c * 1e-3)),
        columns: patient.scene_from_patient_direction(file.columns),
        rows: patient.scene_from_patient_direction(file.rows),
        inwards: patient.scene_from_patient_direction(file.inwards),
        pitch_m: file.pitch_mm * 1e-3,
    }
}

fn needle(file: &NeedleFile, hole: Option<Hole>, patient: &PatientFrame) -> Needle {
    let seed = |(along, &strength_u): (&f64, &f64)| NeedleSeed {
        along_m: along * 1e-3,
        strength_u,
    };
    Needle {
        hole,
        entry_m: patient.scene_from_patient(file.entry_mm.map(|c| c * 1e-3)),
        direction: patient.scene_from_patient_direction(file.direction),
        depth_m: file.depth_mm * 1e-3,
        retract_to_m: file.retract_to_mm * 1e-3,
        loading: file
            .spacer_mm
            .map_or(Loading::Loose, |s| Loading::Stranded { spacer_m: s * 1e-3 }),
        seeds: file.seed_along_mm.iter().zip(&file.strength_u).map(seed).collect(),
    }
}

/// Reads a plan file; the error names it.
pub fn read(path: &Path, patient: &PatientFrame) -> Result<ImplantPlan, PlanError> {
    let text = input::read_text(path, MAX_BYTES).map_err(|e| PlanError::of_file(path, e))?;
    from_text(&text, patient).map_err(|e| PlanError::of_file(path, e))
}

/// Formats seeds for `host-ui dose --seeds`, with the number of their needle and its hole.
pub fn seeds_to_csv(plan: &ImplantPlan, patient: &PatientFrame) -> String {
    let mut text = format!("{HEADER}\n");
    for row in plan.rows(patient) {
        let [x, y, z] = row.position_m.map(|c| c * 1e3);
        let [a, b, c] = row.axis.unwrap_or_default();
        let (strength, number, hole) = (row.strength_u, row.needle.unwrap_or_default(), row.hole);
        text += &format!("{x:.6},{y:.6},{z:.6},{a:.9},{b:.9},{c:.9},{strength},{number},{hole}\n");
    }
    text
}

/// Converts seeds to needles through a template. Seeds with one number are on one needle; those
/// without numbers are grouped by lines along their axes, or along the template's axis if they have
/// none.
pub fn import(
    path: &Path,
    file: SeedFile,
    patient: &PatientFrame,
    template: Template,
    source: &str,
    prescription_gy: f64,
) -> Result<ImplantPlan, PlanError> {
    // A plan names holes of its own template, and its needles may be curved.
    let is_table = file.declared.is_none();
    let rows = file.rows;
    if let Some(problem) = PlanProblem::of_seeds(rows.len()) {
        return Err(PlanError::of_file(path, problem));
    }
    let mut needles: Vec<(Option<u32>, Needle)> = Vec::new();
    let mut problems = Vec::new();
    for row in &rows {
        let place_m = patient.scene_from_patient(row.position_m);
        let direction = row.axis.map_or(template.inwards, |a| {
            inwards(&template, patient.scene_from_patient_direction(a))
        });
        let is_its = |(number, needle): &(Option<u32>, Needle)| {
            *number == row.needle && (is_table && number.is_some() || is_on_line(needle, place_m, direction))
        };
        let at = needles.iter().position(is_its).unwrap_or_else(|| {
            needles.push((row.needle, through(&template, place_m, direction)));
            needles.len() - 1
        });
        let (number, needle) = &mut needles[at];
        let hole = Some(row.hole.as_str()).filter(|hole| is_table && !hole.is_empty());
        if let Err(problem) = fits(needle, hole, place_m, direction, &template) {
            problems.push(match *number {
                None => problem,
                Some(number) => SeedsProblem::Needle {
                    number,
                    problem: Box::new(problem),
                },
            });
        }
        let along_m = needle.along_m(place_m);
        needle.seeds.push(NeedleSeed {
            along_m,
            strength_u: row.strength_u,
        });
    }
    problems.dedup();
    ProblemList::check(problems).map_err(|e| PlanError::of_file(path, e))?;
    Ok(ImplantPlan {
        template,
        source: source.to_owned(),
        prescription_gy,
        needles: needles.into_iter().map(|(_, needle)| needle.in_order()).collect(),
    })
}

fn is_on_line(needle: &Needle, place_m: [f64; 3], direction: [f64; 3]) -> bool {
    let off = Vector3::from(place_m) - Vector3::from(needle.at_m(needle.along_m(place_m)));
    off.norm() < SAME_LINE_M && Vector3::from(needle.direction).dot(&Vector3::from(direction)) > 0.999
}

/// Compares the file's data on a needle with the places of its seeds.
fn fits(
    needle: &Needle,
    hole: Option<&str>,
    place_m: [f64; 3],
    direction: [f64; 3],
    template: &Template,
) -> Result<(), SeedsProblem> {
    if !is_on_line(needle, place_m, direction) {
        return Err(SeedsProblem::NotOnLine);
    }
    let Some(hole) = hole else { return Ok(()) };
    let hole: Hole = hole.parse()?;
    let off_m = (Vector3::from(template.hole_m(hole)) - Vector3::from(needle.entry_m)).norm();
    if off_m < SAME_LINE_M {
        return Ok(());
    }
    let off_mm = off_m * 1e3;
    Err(SeedsProblem::OffHole { off_mm, hole })
}

/// Returns the seed's axis in the direction of the needles; a seed has no front.
fn inwards(template: &Template, axis: [f64; 3]) -> [f64; 3] {
    let along = Vector3::from(axis).dot(&Vector3::from(template.inwards));
    if along < 0.0 { axis.map(|c| -c) } else { axis }
}

/// Returns the needle through a place, from the template's face; through a hole if one is on the
/// line.
pub(super) fn through(template: &Template, place_m: [f64; 3], direction: [f64; 3]) -> Needle {
    let (place, inwards, along) = (
        Vector3::from(place_m),
        Vector3::from(template.inwards),
        Vector3::from(direction),
    );
    let face_m = (place - Vector3::from(template.middle_m)).dot(&inwards) / along.dot(&inwards).max(0.1);
    let entry = place - along * face_m;
    let hole = template.nearest(entry.into());
    let is_through = |h: &Hole| (Vector3::from(template.hole_m(*h)) - entry).norm() < SAME_LINE_M;
    Needle {
        hole: hole.filter(is_through),
        entry_m: entry.into(),
        direction,
        depth_m: 0.0,
        retract_to_m: 0.0,
        loading: Loading::Loose,
        seeds: Vec::new(),
    }
}

#[cfg(test)]
mod tests;
