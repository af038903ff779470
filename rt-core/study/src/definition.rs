//! STUDY.toml: read strictly, with every problem of its values at once.

use crate::corners;
use crate::error::StudyError;
use crate::plan::{self, Plan};
use crate::problem::{GlandProblem, LONGEST_NAME, MOST_IMPLANTS, QuantityProblem, StudyProblem};
use crate::quantity::{self, QUANTITIES};
use crate::spread::Spread;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::path::Path;
use stylet_shm_schema::{BUILTIN_SCENES, ParameterSpec, ProblemList};
use stylet_sim::scene::TissueKind;
use toml::Table;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    name: String,
    seed: Option<u64>,
    implants: u32,
    tissue: Option<String>,
    #[serde(default)]
    linear: bool,
    #[serde(default, rename = "gland")]
    glands: Vec<GlandFile>,
    #[serde(default)]
    vary: Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GlandFile {
    scene: String,
    /// File of the plan, relative to the study.
    plan: String,
}

/// A study, validated.
#[derive(Clone, Debug)]
pub struct Study {
    /// First part of every id.
    pub name: String,
    /// Every random number follows from it and an id.
    pub seed: u64,
    /// Draws of each gland.
    pub implants: u32,
    /// Tissue model.
    pub tissue: TissueKind,
    /// Tissue near the tip stays linear, which changes neither seeds nor forces.
    pub is_linear: bool,
    /// Glands to implant.
    pub glands: Vec<Gland>,
    /// Quantities in the order of `QUANTITIES`.
    pub quantities: Vec<Spread>,
    /// Parameters that differ from their defaults, in the unit of the table.
    pub parameters: Vec<(&'static ParameterSpec, Spread)>,
    /// SHA-256 of the definition, its plans and the version of the program, in hexadecimal.
    pub fingerprint: String,
    /// The text of the file.
    pub text: String,
}

/// A scene with a plan for it.
#[derive(Clone, Debug)]
pub struct Gland {
    /// Name of a built-in scene.
    pub scene: String,
    /// Name of the plan: its file without the ending.
    pub plan_name: String,
    /// Its needles.
    pub plan: Plan,
}

impl Study {
    /// Reads a study file and its plans.
    ///
    /// # Errors
    /// Everything that is wrong with them.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let text = std::fs::read_to_string(path).map_err(|source| StudyError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::of_text(&text, path.parent().unwrap_or(Path::new(""))).map_err(|problems| StudyError::Invalid {
            path: path.to_owned(),
            problems,
        })
    }

    /// Reads a study as [`read`](Self::read) does; the plans are searched in `folder`.
    pub(crate) fn of_text(text: &str, folder: &Path) -> Result<Self, ProblemList<StudyProblem>> {
        let file: StudyFile = toml::from_str(text).map_err(StudyProblem::Toml)?;
        let table: Table = text.parse().map_err(StudyProblem::Toml)?;
        let mut problems = Vec::new();
        let is_of_id = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if !(1..=LONGEST_NAME).contains(&file.name.len()) || !file.name.chars().all(is_of_id) {
            problems.push(StudyProblem::Name(file.name.clone()));
        }
        if !(1..=MOST_IMPLANTS).contains(&file.implants) {
            problems.push(StudyProblem::Implants(file.implants));
        }
        let tissue = tissue(file.tissue, &mut problems);
        let mut sum = Sha256::new();
        sum.update(env!("CARGO_PKG_VERSION"));
        sum.update(table.to_string());
        if file.glands.is_empty() {
            problems.push(StudyProblem::NoGland);
        }
        let glands = glands(&file.glands, folder, &mut sum, &mut problems);
        let (quantities, parameters) = vary(&file.vary, tissue, &mut problems);
        if problems.is_empty() {
            problems.extend(corners::problem(&parameters, tissue));
        }
        ProblemList::check(problems)?;
        Ok(Self {
            name: file.name,
            seed: file.seed.unwrap_or(1),
            implants: file.implants,
            tissue,
            is_linear: file.linear,
            glands,
            quantities,
            parameters,
            fingerprint: sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
            text: text.to_owned(),
        })
    }

    /// Names of the columns of what is drawn.
    pub fn columns(&self) -> Vec<String> {
        let quantities = QUANTITIES.iter().map(|q| q.key.to_owned());
        quantities
            .chain(self.parameters.iter().map(|(spec, _)| quantity::column(spec)))
            .collect()
    }

    /// Implants of all glands.
    pub fn implant_count(&self) -> usize {
        self.glands.len() * self.implants as usize
    }
}

fn tissue(name: Option<String>, problems: &mut Vec<StudyProblem>) -> TissueKind {
    let Some(name) = name else {
        return TissueKind::default();
    };
    TissueKind::of_name(&name).unwrap_or_else(|| {
        problems.push(StudyProblem::Tissue(name));
        TissueKind::default()
    })
}

fn glands(list: &[GlandFile], folder: &Path, sum: &mut Sha256, problems: &mut Vec<StudyProblem>) -> Vec<Gland> {
    let mut glands: Vec<Gland> = Vec::new();
    for (n, GlandFile { scene, plan }) in list.iter().enumerate() {
        let number = n + 1;
        let mut report = |problem| problems.push(StudyProblem::Gland { number, problem });
        if !BUILTIN_SCENES.contains(&scene.as_str()) {
            report(GlandProblem::Scene(scene.clone()));
        }
        let path = folder.join(plan);
        let Some(plan) = read_plan(&path, sum, &mut report) else {
            continue;
        };
        let stem = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_default();
        if glands
            .iter()
            .any(|other| other.scene == *scene && other.plan_name == stem)
        {
            let (scene, plan) = (scene.clone(), stem.clone());
            report(GlandProblem::Twice { scene, plan });
        }
        glands.push(Gland {
            scene: scene.clone(),
            plan_name: stem,
            plan,
        });
    }
    glands
}

fn read_plan(path: &Path, sum: &mut Sha256, report: &mut impl FnMut(GlandProblem)) -> Option<Plan> {
    let path = path.to_owned();
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(why) => {
            report(GlandProblem::Unreadable { path, why });
            return None;
        }
    };
    sum.update(&text);
    let listed = |ProblemList(found)| {
        let of_plan = |problem| GlandProblem::Plan {
            path: path.clone(),
            problem,
        };
        found.into_iter().map(of_plan).for_each(report);
    };
    plan::of_text(&text).map_err(listed).ok()
}

type Spreads = (Vec<Spread>, Vec<(&'static ParameterSpec, Spread)>);

fn vary(given: &Table, tissue: TissueKind, problems: &mut Vec<StudyProblem>) -> Spreads {
    let mut quantities: Vec<Spread> = QUANTITIES.iter().map(|q| Spread::Fixed(q.default)).collect();
    let mut parameters = Vec::new();
    for (key, value) in given {
        let mut report = |problem| {
            problems.push(StudyProblem::Quantity {
                key: key.clone(),
                problem,
            });
        };
        let known = QUANTITIES.iter().position(|q| q.key == key);
        let spec = quantity::parameter(key);
        let limits = known.map(|n| QUANTITIES[n].limits).or(spec.map(quantity::limits));
        let Some(limits) = limits else {
            report(QuantityProblem::Unknown);
            continue;
        };
        let spread = match Spread::of_toml(value) {
            Ok(spread) => spread,
            Err(why) => {
                report(why.into());
                continue;
            }
        };
        let ([least, most], [low, high]) = (spread.bounds(), limits);
        // Limits that were scaled to a person's unit differ in their last bit.
        let slack = 1e-12 * low.abs().max(high.abs());
        if least < low - slack || most > high + slack {
            let reach = [least, most];
            report(QuantityProblem::Reach { reach, limits });
        }
        if let Some(n) = known {
            quantities[n] = spread;
        } else if let Some(spec) = spec {
            if quantity::has_no_part(spec, tissue) {
                report(QuantityProblem::NoPart(tissue));
            }
            parameters.push((spec, spread));
        }
    }
    (quantities, parameters)
}
