//! STUDY.toml: read strictly, with every problem at once.

use crate::corners;
use crate::error::StudyError;
use crate::plan::{self, Plan};
use crate::problem::{GLAND_KEYS, GlandProblem, KEYS, LONGEST_NAME, QuantityProblem, StudyProblem};
use crate::quantity::{self, QUANTITIES};
use crate::spread::Spread;
use sha2::{Digest, Sha256};
use std::path::Path;
use stylet_shm_schema::{BUILTIN_SCENES, ParameterSpec, ProblemList};
use stylet_sim::scene::TissueKind;
use toml::{Table, Value};

const MOST_IMPLANTS: i64 = 1_000_000;

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
        let table: Table = text.parse().map_err(StudyProblem::Toml)?;
        let mut problems = Vec::new();
        problems.extend(unknown(&table, &KEYS).map(StudyProblem::UnknownKey));
        let name = name(&table, &mut problems);
        let seed = whole(&table, "seed", [0, i64::MAX], Some(1), &mut problems) as u64;
        let implants = whole(&table, "implants", [1, MOST_IMPLANTS], None, &mut problems) as u32;
        let tissue = tissue(&table, &mut problems);
        let mut sum = Sha256::new();
        sum.update(env!("CARGO_PKG_VERSION"));
        // Without comments, and in the order of the keys.
        sum.update(table.to_string());
        let glands = glands(&table, folder, &mut sum, &mut problems);
        let (quantities, parameters) = vary(&table, tissue, &mut problems);
        // Each by itself first: a corner that is out of range would be reported twice.
        if problems.is_empty() {
            problems.extend(corners::problem(&parameters, tissue));
        }
        ProblemList::check(problems)?;
        Ok(Self {
            name,
            seed,
            implants,
            tissue,
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

fn unknown(table: &Table, known: &[&str]) -> impl Iterator<Item = String> {
    table.keys().filter(|key| !known.contains(&key.as_str())).cloned()
}

fn name(table: &Table, problems: &mut Vec<StudyProblem>) -> String {
    let fits = |name: &&str| {
        let letters = name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
        letters && (1..=LONGEST_NAME).contains(&name.len())
    };
    match table.get("name").map(|name| name.as_str().filter(fits)) {
        Some(Some(name)) => return name.to_owned(),
        Some(None) => problems.push(StudyProblem::Name(table["name"].clone())),
        None => problems.push(StudyProblem::NoName),
    }
    String::new()
}

fn whole(
    table: &Table,
    key: &'static str,
    [least, most]: [i64; 2],
    default: Option<i64>,
    problems: &mut Vec<StudyProblem>,
) -> i64 {
    match (table.get(key), default) {
        (None, Some(default)) => return default,
        (None, None) => problems.push(StudyProblem::NoNumber { key, least, most }),
        (Some(value), _) => match value.as_integer().filter(|n| (least..=most).contains(n)) {
            Some(n) => return n,
            None => problems.push(StudyProblem::Number {
                key,
                value: value.clone(),
                least,
                most,
            }),
        },
    }
    0
}

fn tissue(table: &Table, problems: &mut Vec<StudyProblem>) -> TissueKind {
    let Some(value) = table.get("tissue") else {
        return TissueKind::default();
    };
    value.as_str().and_then(TissueKind::of_name).unwrap_or_else(|| {
        problems.push(StudyProblem::Tissue(value.clone()));
        TissueKind::default()
    })
}

fn glands(table: &Table, folder: &Path, sum: &mut Sha256, problems: &mut Vec<StudyProblem>) -> Vec<Gland> {
    let list = table
        .get("gland")
        .and_then(Value::as_array)
        .filter(|list| !list.is_empty());
    let Some(list) = list else {
        problems.push(StudyProblem::NoGland);
        return Vec::new();
    };
    let mut glands: Vec<Gland> = Vec::new();
    for (n, gland) in list.iter().enumerate() {
        let number = n + 1;
        let mut report = |problem| problems.push(StudyProblem::Gland { number, problem });
        let Some(gland) = gland.as_table() else {
            report(GlandProblem::NoTable);
            continue;
        };
        unknown(gland, &GLAND_KEYS)
            .map(GlandProblem::UnknownKey)
            .for_each(&mut report);
        let scene = gland.get("scene").and_then(Value::as_str).unwrap_or_default();
        if !BUILTIN_SCENES.contains(&scene) {
            report(GlandProblem::Scene(scene.to_owned()));
        }
        let Some(file) = gland.get("plan").and_then(Value::as_str) else {
            report(GlandProblem::NoPlan);
            continue;
        };
        let path = folder.join(file);
        let Some(plan) = read_plan(&path, sum, &mut report) else {
            continue;
        };
        let stem = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_default();
        let same = |other: &&Gland| other.scene == scene && other.plan_name == stem;
        if glands.iter().any(|other| same(&other)) {
            let (scene, plan) = (scene.to_owned(), stem.clone());
            report(GlandProblem::Twice { scene, plan });
        }
        glands.push(Gland {
            scene: scene.to_owned(),
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

fn vary(table: &Table, tissue: TissueKind, problems: &mut Vec<StudyProblem>) -> Spreads {
    let mut quantities: Vec<Spread> = QUANTITIES.iter().map(|q| Spread::Fixed(q.default)).collect();
    let mut parameters = Vec::new();
    let empty = Table::new();
    let given = match table.get("vary") {
        None => &empty,
        Some(Value::Table(given)) => given,
        Some(other) => {
            problems.push(StudyProblem::NoTable(other.clone()));
            &empty
        }
    };
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
