//! The figures of the page, row by row: each a number, or the reason why there is none.

use super::{Column, Implant};
use stylet_anatomy::Organ;
use stylet_dose::criteria::{DoseStructure, Limit};
use stylet_dose::effect::Response;
use stylet_dose::metric::Value;
use stylet_dose::{Dvh, Metric};

/// Definitions of the figures, for the foot of the page.
pub const DEFINITIONS: [&str; 6] = [
    "D: dose that a share of the structure gets at least. V: share or volume with at least that percentage of the prescription.",
    "Conformity (van 't Riet 1997; COIN without organs, Baltas 1998): share of the target at the prescription, times the target's share of \
     all that is.",
    "Homogeneity (Wu 1988): (V100 - V150)/V100 of the target. Non-uniformity: V150/V100. External volume: what gets the prescription \
     outside of the target, over the target's volume.",
    "BED (Dale 1989, as in TG-137): D(T) [1 + 2 d0 λ/(μ-λ) (β/α) κ(T)] - ln2 T/(α Tp); EQD2 = BED/(1 + 2/(α/β)).",
    "Edema (Chen 2000): V(t) = V (1 + M exp(-λe t)); seeds and tissue move together, the dose is the integral over time.",
    "D100 is the lowest of the points that the structure is made of, so it depends on their number.",
];

/// Figure of every state.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Group: "target".
    pub group: &'static str,
    /// Name: "D90".
    pub name: String,
    /// Unit; empty for a number.
    pub unit: &'static str,
    /// Number of digits after the point.
    pub digits: usize,
    /// Limit, if it has one.
    pub limit: Option<Limit>,
    /// Value in each column, or the reason why there is none.
    pub values: Vec<Result<f64, NotComputed>>,
}

type Cell = Result<f64, NotComputed>;

/// Reason why a figure cannot be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotComputed(String);

impl From<String> for NotComputed {
    fn from(why: String) -> Self {
        Self(why)
    }
}

impl From<&str> for NotComputed {
    fn from(why: &str) -> Self {
        Self(why.to_owned())
    }
}

/// Returns all rows, in the order of the page.
pub fn rows(implant: &Implant, columns: &[Column]) -> Vec<Row> {
    let mut all = Vec::new();
    let mut row = |group: &'static str, name: &str, unit: &'static str, digits: usize, of: &dyn Fn(&Column) -> Cell| {
        all.push(Row {
            group,
            name: name.to_owned(),
            unit,
            digits,
            limit: limit(group, name, unit, implant.prescription_gy),
            values: columns.iter().map(of).collect(),
        });
    };
    let total_u = |c: &Column| c.state.seeds.iter().map(|s| s.strength_u).sum::<f64>();
    row("implant", "seeds", "", 0, &|c| Ok(c.state.seeds.len() as f64));
    row("implant", "strength of a seed, mean", "U", 3, &|c| {
        Ok(total_u(c) / c.state.seeds.len().max(1) as f64)
    });
    row("implant", "strength, total", "U", 2, &|c| Ok(total_u(c)));
    row("implant", "strength over target volume", "U/cc", 3, &|c| {
        Ok(total_u(c) / (target(c)?.volume_m3() * 1e6))
    });
    row("target", "volume", "cc", 2, &|c| Ok(target(c)?.volume_m3() * 1e6));
    let rx = implant.prescription_gy;
    for name in ["D100", "D90"] {
        row("target", name, "Gy", 1, &|c| figure(target(c)?, name, rx));
    }
    row("target", "D90", "% of prescription", 1, &|c| {
        Ok(figure(target(c)?, "D90", rx)? / rx * 100.0)
    });
    for name in ["V90", "V100", "V150", "V200"] {
        row("target", name, "%", 1, &|c| figure(target(c)?, name, rx));
    }
    for name in ["D5", "D10", "D30"] {
        row("urethra", name, "Gy", 1, &|c| {
            figure(organ(c, Organ::Urethra)?, name, rx)
        });
    }
    row("urethra", "V150", "cc", 3, &|c| {
        cc(organ(c, Organ::Urethra)?, "V150", rx)
    });
    row("rectum", "V100", "cc", 3, &|c| cc(organ(c, Organ::Rectum)?, "V100", rx));
    for name in ["D2cc", "D0.1cc"] {
        row("rectum", name, "Gy", 1, &|c| figure(organ(c, Organ::Rectum)?, name, rx));
    }
    row("indices", "conformity", "", 3, &|c| {
        let (inside, all) = (target(c)?.at_least_m3(rx), c.at_prescription_m3.clone()?);
        // The two volumes come from different points, so the share may slightly exceed 1.
        Ok(inside / target(c)?.volume_m3() * if all > 0.0 { (inside / all).min(1.0) } else { 0.0 })
    });
    row("indices", "homogeneity", "", 3, &|c| Ok(1.0 - non_uniformity(c, rx)?));
    row("indices", "non-uniformity", "", 3, &|c| non_uniformity(c, rx));
    row("indices", "external volume", "", 3, &|c| {
        Ok((c.at_prescription_m3.clone()? - target(c)?.at_least_m3(rx)).max(0.0) / target(c)?.volume_m3())
    });
    let half_life_s = implant.source.half_life_s;
    let effect = |c: &Column, response: &Response, dose_gy: Cell, is_eqd2: bool| -> Cell {
        if c.swells {
            return Err("with edema the dose rate does not decay with the source alone".into());
        }
        if !implant.is_for_ever {
            return Err("the dose is that of a part of the time".into());
        }
        let bed_gy = response.bed_gy(dose_gy?, half_life_s);
        Ok(if is_eqd2 { response.eqd2_gy(bed_gy) } else { bed_gy })
    };
    let of_target = |c: &Column| figure(target(c)?, "D90", rx);
    row("effect", "BED of target D90", "Gy", 1, &|c| {
        effect(c, &Response::PROSTATE, of_target(c), false)
    });
    row("effect", "EQD2 of target D90", "Gy", 1, &|c| {
        effect(c, &Response::PROSTATE, of_target(c), true)
    });
    for (name, organ_is, of) in [("urethra", Organ::Urethra, "D10"), ("rectum", Organ::Rectum, "D2cc")] {
        let dose = |c: &Column| figure(organ(c, organ_is)?, of, rx);
        row("effect", &format!("EQD2 of {name} {of}"), "Gy", 1, &|c| {
            effect(c, &Response::LATE, dose(c), true)
        });
    }
    all
}

/// Returns the limit of a figure in this unit, of target, urethra or rectum.
fn limit(group: &str, name: &str, unit: &str, rx_gy: f64) -> Option<Limit> {
    let structure = match group {
        "target" => DoseStructure::Target,
        "urethra" => DoseStructure::Urethra,
        "rectum" => DoseStructure::Rectum,
        _ => return None,
    };
    let is_it = |metric: &Metric| {
        let own = if metric.unit() == "gy" { "Gy" } else { "%" };
        metric.to_string() == name && own == unit
    };
    let limited = structure.metrics(rx_gy).into_iter().find(|(metric, _)| is_it(metric));
    limited.and_then(|(_, limit)| limit)
}

fn target(column: &Column) -> Result<&Dvh, NotComputed> {
    column.target().ok_or_else(|| "the target has no volume".into())
}

fn organ(column: &Column, organ: Organ) -> Result<&Dvh, NotComputed> {
    let name = match organ {
        Organ::Urethra => "urethra",
        _ => "rectum",
    };
    column
        .organ(organ)
        .ok_or_else(|| format!("no structure is called {name}").into())
}

fn non_uniformity(column: &Column, rx_gy: f64) -> Cell {
    let v100 = target(column)?.at_least_m3(rx_gy);
    match v100 > 0.0 {
        true => Ok(target(column)?.at_least_m3(1.5 * rx_gy) / v100),
        false => Err("V100 is 0".into()),
    }
}

fn value(dvh: &Dvh, name: &str, rx_gy: f64) -> Result<Value, NotComputed> {
    match Metric::parse(name).map_err(|why| why.to_string())?.of(dvh, rx_gy) {
        Value::TooSmall { cc } => Err(format!("the structure has only {cc:.3} cc").into()),
        value => Ok(value),
    }
}

/// Returns a dose in Gy, or a volume in percent.
fn figure(dvh: &Dvh, name: &str, rx_gy: f64) -> Cell {
    let figure = value(dvh, name, rx_gy)?.main();
    figure.ok_or_else(|| format!("{name} has no value").into())
}

fn cc(dvh: &Dvh, name: &str, rx_gy: f64) -> Cell {
    match value(dvh, name, rx_gy)? {
        Value::Volume { cc, .. } => Ok(cc),
        _ => Err(format!("{name} is not a volume").into()),
    }
}
