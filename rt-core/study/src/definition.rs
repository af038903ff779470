//! STUDY.toml: read strictly, with every problem at once.

use crate::corners;
use crate::error::{Problems, StudyError};
use crate::plan::{self, Plan};
use crate::quantity::{self, QUANTITIES};
use crate::spread::Spread;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use stylet_shm_schema::{BUILTIN_SCENES, ParameterSpec};
use stylet_sim::scene::TissueKind;
use toml::{Table, Value};

const KEYS: [&str; 6] = ["name", "seed", "implants", "tissue", "gland", "vary"];
const GLAND_KEYS: [&str; 2] = ["scene", "plan"];
const MOST_IMPLANTS: i64 = 1_000_000;
const LONGEST_NAME: usize = 60;

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
    pub(crate) fn of_text(text: &str, folder: &Path) -> Result<Self, Problems> {
        let table: Table = text
            .parse()
            .map_err(|e: toml::de::Error| Problems(vec![format!("it is no TOML: {e}")]))?;
        let mut problems = Vec::new();
        unknown(&table, "", &KEYS, &mut problems);
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
        if !problems.is_empty() {
            return Err(Problems(problems));
        }
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

fn unknown(table: &Table, place: &str, known: &[&str], problems: &mut Vec<String>) {
    for key in table.keys().filter(|key| !known.contains(&key.as_str())) {
        problems.push(format!(
            "{place}{key}: there is no such key; there are {}",
            known.join(", ")
        ));
    }
}

fn name(table: &Table, problems: &mut Vec<String>) -> String {
    let fits = |name: &&str| {
        let letters = name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
        letters && (1..=LONGEST_NAME).contains(&name.len())
    };
    match table.get("name").map(|name| name.as_str().filter(fits)) {
        Some(Some(name)) => return name.to_owned(),
        Some(None) => problems.push(format!(
            "name is {}; give 1 to {LONGEST_NAME} letters, digits, '-', '_' or '.'",
            table["name"]
        )),
        None => problems.push("name is missing: it begins the id of every insertion".to_owned()),
    }
    String::new()
}

fn whole(table: &Table, key: &str, [least, most]: [i64; 2], default: Option<i64>, problems: &mut Vec<String>) -> i64 {
    match (table.get(key), default) {
        (None, Some(default)) => return default,
        (None, None) => problems.push(format!("{key} is missing: a whole number from {least} to {most}")),
        (Some(value), _) => match value.as_integer().filter(|n| (least..=most).contains(n)) {
            Some(n) => return n,
            None => problems.push(format!(
                "{key} is {value}; it must be a whole number from {least} to {most}"
            )),
        },
    }
    0
}

fn tissue(table: &Table, problems: &mut Vec<String>) -> TissueKind {
    let Some(value) = table.get("tissue") else {
        return TissueKind::default();
    };
    value.as_str().and_then(TissueKind::of_name).unwrap_or_else(|| {
        let names = TissueKind::ALL.map(TissueKind::name).join(", ");
        problems.push(format!("tissue is {value}; there are {names}"));
        TissueKind::default()
    })
}

fn glands(table: &Table, folder: &Path, sum: &mut Sha256, problems: &mut Vec<String>) -> Vec<Gland> {
    let list = table
        .get("gland")
        .and_then(Value::as_array)
        .filter(|list| !list.is_empty());
    let Some(list) = list else {
        problems.push("gland is missing: give [[gland]] with scene and plan once or several times".to_owned());
        return Vec::new();
    };
    let mut glands: Vec<Gland> = Vec::new();
    for (n, gland) in list.iter().enumerate() {
        let place = format!("gland {}: ", n + 1);
        let Some(gland) = gland.as_table() else {
            problems.push(format!("{place}it must be a table: [[gland]]"));
            continue;
        };
        unknown(gland, &place, &GLAND_KEYS, problems);
        let scene = gland.get("scene").and_then(Value::as_str).unwrap_or_default();
        if !BUILTIN_SCENES.contains(&scene) {
            problems.push(format!(
                "{place}scene is \"{scene}\"; there are {}",
                BUILTIN_SCENES.join(", ")
            ));
        }
        let Some(file) = gland.get("plan").and_then(Value::as_str) else {
            problems.push(format!(
                "{place}plan is missing: a file of `host-ui plan`, relative to this one"
            ));
            continue;
        };
        let path = folder.join(file);
        let Some(plan) = read_plan(&path, &place, sum, problems) else {
            continue;
        };
        let stem = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_default();
        let same = |other: &&Gland| other.scene == scene && other.plan_name == stem;
        if glands.iter().any(|other| same(&other)) {
            problems.push(format!(
                "{place}there is a gland of scene {scene} with plan {stem} already: their ids would be the same"
            ));
        }
        glands.push(Gland {
            scene: scene.to_owned(),
            plan_name: stem,
            plan,
        });
    }
    glands
}

fn read_plan(path: &PathBuf, place: &str, sum: &mut Sha256, problems: &mut Vec<String>) -> Option<Plan> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(why) => {
            problems.push(format!("{place}plan {}: it cannot be read ({why})", path.display()));
            return None;
        }
    };
    sum.update(&text);
    let listed = |Problems(found): Problems| {
        problems.extend(
            found
                .into_iter()
                .map(|what| format!("{place}plan {}: {what}", path.display())),
        );
    };
    plan::of_text(&text).map_err(listed).ok()
}

type Spreads = (Vec<Spread>, Vec<(&'static ParameterSpec, Spread)>);

fn vary(table: &Table, tissue: TissueKind, problems: &mut Vec<String>) -> Spreads {
    let mut quantities: Vec<Spread> = QUANTITIES.iter().map(|q| Spread::Fixed(q.default)).collect();
    let mut parameters = Vec::new();
    let empty = Table::new();
    let given = match table.get("vary") {
        None => &empty,
        Some(Value::Table(given)) => given,
        Some(other) => {
            problems.push(format!("vary is {other}; it must be a table: [vary]"));
            &empty
        }
    };
    for (key, value) in given {
        let known = QUANTITIES.iter().position(|q| q.key == key);
        let spec = quantity::parameter(key);
        let limits = known.map(|n| QUANTITIES[n].limits).or(spec.map(quantity::limits));
        let Some(limits) = limits else {
            let all: Vec<&str> = quantity::keys().collect();
            problems.push(format!(
                "vary.{key}: there is no such quantity; there are {}",
                all.join(", ")
            ));
            continue;
        };
        let spread = match Spread::of_toml(value) {
            Ok(spread) => spread,
            Err(why) => {
                problems.push(format!("vary.{key}: {why}"));
                continue;
            }
        };
        let ([least, most], [low, high]) = (spread.bounds(), limits);
        // Limits that were scaled to a person's unit differ in their last bit.
        let slack = 1e-12 * low.abs().max(high.abs());
        if least < low - slack || most > high + slack {
            problems.push(format!(
                "vary.{key}: it reaches from {least} to {most}; the limits are {low} to {high}"
            ));
        }
        if let Some(n) = known {
            quantities[n] = spread;
        } else if let Some(spec) = spec {
            if quantity::has_no_part(spec, tissue) {
                problems.push(format!(
                    "vary.{key}: it does nothing in tissue \"{}\", where needles slip by force; leave it out, or take tissue = \"paper\"",
                    tissue.name()
                ));
            }
            parameters.push((spec, spread));
        }
    }
    (quantities, parameters)
}
