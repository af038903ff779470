//! Evaluation of a plan: measures of each structure, homogeneity and conformity of the target.

use super::Dvh;
use super::criteria::{Figure, figures};
use super::criterion::Criterion;
use super::edema::Swelling;
use super::error::DoseError;
use super::grid::DoseGrid;
use super::kernel::DoseKernel;
use super::metric::{Metric, Value};
use super::points::DosePoints;
use super::seed::Seed;
use super::structure::{Structure, bounds};
use serde_json::{Value as Json, json};
use stylet_anatomy::{Organ, target_among};

/// Margin around seeds and target in which the volume at the prescription is searched.
const MARGIN_M: f64 = 0.03;

/// Structures, prepared for evaluation under any set of seeds.
pub struct Judge {
    structures: Vec<Judged>,
    target: usize,
    around: SearchBox,
    prescription_gy: f64,
}

struct Judged {
    name: String,
    metrics: Vec<Metric>,
    points: DosePoints,
    volumes_m3: Vec<f64>,
}

/// Box around the whole region where the dose may reach the prescription.
struct SearchBox {
    points: DosePoints,
    point_m3: f64,
    /// Points next to a face of the box.
    outermost: Vec<usize>,
}

/// Quality of the dose distribution around the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Dose homogeneity index (V100 - V150) / V100 of the target (Wu, Ulin, Sternick, Med. Phys.
    /// 15, 104, 1988); `None` at V100 = 0.
    pub homogeneity: Option<f64>,
    /// COIN (Baltas et al., Int. J. Radiat. Oncol. 40, 515, 1998). It is the share of the target at
    /// the prescription, times the target's share of the whole volume at it; `None` if that volume
    /// leaves the box.
    pub conformity: Option<f64>,
    /// Whole volume at the prescription (m³).
    pub at_prescription_m3: Option<f64>,
}

/// Result of one set of seeds.
pub struct Verdict {
    /// One histogram for each structure.
    pub dvhs: Vec<Dvh>,
    /// Quality of the dose distribution around the target.
    pub fit: Fit,
}

impl Judge {
    /// Creates a judge. The target is `target` by name, or the structure named like one, or the
    /// first; `extra` metrics apply to every structure.
    pub fn new(
        structures: Vec<Structure>,
        target: Option<&str>,
        extra: &[Metric],
        prescription_gy: f64,
        seeds: &[Seed],
        most_points: usize,
    ) -> Result<Self, DoseError> {
        let names: Vec<&str> = structures.iter().map(|s| s.name.as_str()).collect();
        let target = choose_target(&names, target)?;
        let mut corners: Vec<[f64; 3]> = seeds.iter().map(|s| s.position_m).collect();
        corners.extend(<[[f64; 3]; 2]>::from(structures[target].bounds_m()));
        let around = SearchBox::new(&corners, most_points);
        let structures = structures
            .into_iter()
            .enumerate()
            .map(|(i, s)| Judged {
                metrics: metrics(&s.name, i == target, extra),
                points: DosePoints::new(&s.points_m),
                volumes_m3: s.volumes_m3,
                name: s.name,
            })
            .collect();
        Ok(Self {
            structures,
            target,
            around,
            prescription_gy,
        })
    }

    /// Evaluates one set of seeds.
    pub fn judge(&self, kernel: &DoseKernel, seeds: &[Seed]) -> Verdict {
        self.judge_reporting(kernel, seeds, &|_| ())
    }

    /// Like [`Judge::judge`], in a gland that swells at the implant if a swelling is given;
    /// `kernel` is then for all time.
    pub fn judge_swollen(&self, kernel: &DoseKernel, seeds: &[Seed], swelling: Option<Swelling>) -> Verdict {
        match swelling {
            Some(swelling) => self.judge_by(&|points| swelling.dose_gy(kernel, seeds, points)),
            None => self.judge(kernel, seeds),
        }
    }

    /// Returns the number of points at which the dose is computed.
    pub fn points(&self) -> u64 {
        let in_structures = self.structures.iter().map(|s| s.volumes_m3.len());
        (in_structures.sum::<usize>() + self.around.points.dose_gy().len()) as u64
    }

    /// Like [`Judge::judge`]; calls `done` with the number of points done since, from any thread.
    pub fn judge_reporting(&self, kernel: &DoseKernel, seeds: &[Seed], done: &(dyn Fn(u64) + Sync)) -> Verdict {
        self.judge_by(&|points| points.of_seeds_reporting(kernel, seeds, done))
    }

    /// Evaluates the dose of a grid; beyond it the dose of the nearest voxel counts.
    pub fn judge_grid(&self, grid: &DoseGrid) -> Verdict {
        self.judge_by(&|points| points.of_grid_gy(grid))
    }

    fn judge_by(&self, dose_gy: &dyn Fn(&DosePoints) -> Vec<f64>) -> Verdict {
        let dvhs: Vec<Dvh> = self
            .structures
            .iter()
            .filter_map(|s| Dvh::new(&dose_gy(&s.points), &s.volumes_m3))
            .collect();
        let fit = self.fit(&dvhs[self.target], &dose_gy(&self.around.points));
        Verdict { dvhs, fit }
    }

    fn fit(&self, target: &Dvh, dose: &[f64]) -> Fit {
        let (v100, v150) = (
            target.at_least_m3(self.prescription_gy),
            target.at_least_m3(1.5 * self.prescription_gy),
        );
        let reached = |d: &f64| *d >= self.prescription_gy;
        let inside = !self.around.outermost.iter().any(|&i| reached(&dose[i]));
        let at_prescription_m3 =
            inside.then(|| dose.iter().filter(|d| reached(d)).count() as f64 * self.around.point_m3);
        Fit {
            homogeneity: (v100 > 0.0).then(|| (v100 - v150) / v100),
            conformity: at_prescription_m3.map(|all| {
                // The two volumes come from different points, so the share may slightly exceed 1.
                let share = if all > 0.0 { (v100 / all).min(1.0) } else { 0.0 };
                v100 / target.volume_m3() * share
            }),
            at_prescription_m3,
        }
    }

    /// Returns name, unit and value of every measure, in an order independent of the seeds.
    pub fn values(&self, verdict: &Verdict) -> Vec<(String, Option<f64>)> {
        let mut all = Vec::new();
        for (s, dvh) in self.structures.iter().zip(&verdict.dvhs) {
            for &m in &s.metrics {
                all.push((
                    format!("{} {m} [{}]", s.name, m.unit()),
                    m.of(dvh, self.prescription_gy).main(),
                ));
            }
        }
        let name = &self.structures[self.target].name;
        all.push((format!("{name} homogeneity [1]"), verdict.fit.homogeneity));
        all.push((format!("{name} conformity [1]"), verdict.fit.conformity));
        all
    }

    /// Returns the names of the structures, in the order of the histograms.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.structures.iter().map(|s| s.name.as_str())
    }

    /// Returns the criteria of [`Criterion::of_structure`] for the structures with a role.
    pub fn criteria(&self) -> Vec<Criterion> {
        let of = |(i, s): (usize, &Judged)| Criterion::of_structure(&s.name, i == self.target, self.prescription_gy);
        self.structures.iter().enumerate().flat_map(of).collect()
    }

    /// Returns the figures that have limits, or are shown with them.
    pub fn figures(&self, verdict: &Verdict) -> Vec<Figure> {
        figures(self.names().zip(&verdict.dvhs), self.target, self.prescription_gy)
    }

    /// Returns the name of the target.
    pub fn target_name(&self) -> &str {
        &self.structures[self.target].name
    }

    /// Returns the measures as JSON; doses in Gy, volumes in cm³.
    pub fn to_json(&self, verdict: &Verdict) -> Json {
        let structures: Vec<Json> = self
            .structures
            .iter()
            .zip(&verdict.dvhs)
            .map(|(s, dvh)| {
                let metrics: serde_json::Map<String, Json> = s
                    .metrics
                    .iter()
                    .map(|&m| (m.to_string(), value_json(m.of(dvh, self.prescription_gy))))
                    .collect();
                json!({ "name": s.name, "volume_cc": dvh.volume_m3() * 1e6, "metrics": metrics })
            })
            .collect();
        let fit = &verdict.fit;
        json!({
            "prescription_gy": self.prescription_gy,
            "structures": structures,
            "target": {
                "name": self.structures[self.target].name,
                "homogeneity": fit.homogeneity,
                "homogeneity_is": "(V100 - V150) / V100, Wu, Ulin and Sternick 1988",
                "conformity": fit.conformity,
                "conformity_is": "COIN, Baltas et al. 1998; null where the prescription isodose leaves the box of 30 mm around target and seeds",
                "volume_at_prescription_cc": fit.at_prescription_m3.map(|v| v * 1e6),
            },
        })
    }

    /// Returns the measures as a table for display.
    pub fn table(&self, verdict: &Verdict) -> String {
        let mut text = String::new();
        for (s, dvh) in self.structures.iter().zip(&verdict.dvhs) {
            text += &format!("{} ({:.2} cc)\n", s.name, dvh.volume_m3() * 1e6);
            for &m in &s.metrics {
                text += &format!(
                    "  {:<8} {}\n",
                    m.to_string(),
                    value_text(m.of(dvh, self.prescription_gy))
                );
            }
        }
        let number = |v: Option<f64>| v.map_or_else(|| "not defined".to_owned(), |v| format!("{v:.3}"));
        text + &format!(
            "homogeneity {}, conformity {} of {}\n",
            number(verdict.fit.homogeneity),
            number(verdict.fit.conformity),
            self.structures[self.target].name
        )
    }
}

impl SearchBox {
    fn new(corners_m: &[[f64; 3]], most_points: usize) -> Self {
        let (low, high) = bounds(corners_m);
        let (low, high) = (low.map(|v| v - MARGIN_M), high.map(|v| v + MARGIN_M));
        let volume: f64 = (0..3).map(|a| high[a] - low[a]).product();
        let pitch = (volume / most_points as f64).cbrt();
        let cells = Structure::of_box("around", low, high, pitch);
        let at_face = |p: &[f64; 3]| (0..3).any(|a| p[a] < low[a] + pitch || p[a] > high[a] - pitch);
        Self {
            outermost: (0..cells.points_m.len())
                .filter(|&i| at_face(&cells.points_m[i]))
                .collect(),
            point_m3: cells.volumes_m3[0],
            points: DosePoints::new(&cells.points_m),
        }
    }
}

/// Returns the index of the target: by name, or the structure named like a target, or the first.
pub fn choose_target(names: &[&str], wanted: Option<&str>) -> Result<usize, DoseError> {
    if let Some(wanted) = wanted {
        return names
            .iter()
            .position(|n| n.eq_ignore_ascii_case(wanted))
            .ok_or_else(|| {
                let there = names.join(", ");
                DoseError::Target(format!("no structure is called {wanted}; there are {there}"))
            });
    }
    if names.is_empty() {
        return Err(DoseError::Target("there is no structure: every voxel is 0".to_owned()));
    }
    Ok(target_among(names).unwrap_or(0))
}

/// Returns the usual measures of a structure of that name (AAPM TG-137, GEC-ESTRO), then the
/// requested ones.
fn metrics(name: &str, is_target: bool, extra: &[Metric]) -> Vec<Metric> {
    use Metric::{DoseToShare, DoseToVolume, Mean, VolumeAtShare};
    let (cc2, cc01) = (DoseToVolume { m3: 2e-6 }, DoseToVolume { m3: 0.1e-6 });
    let mut all = match () {
        () if is_target => vec![
            DoseToShare(0.9),
            VolumeAtShare(1.0),
            VolumeAtShare(1.5),
            VolumeAtShare(2.0),
        ],
        () if Organ::Urethra.is_mentioned_in(name) => vec![DoseToShare(0.1), DoseToShare(0.3)],
        () if Organ::Rectum.is_mentioned_in(name) => vec![cc2, cc01],
        () => vec![Mean, cc2, cc01],
    };
    all.extend(extra.iter().filter(|m| !all.contains(m)).copied().collect::<Vec<_>>());
    all
}

fn value_json(value: Value) -> Json {
    match value {
        Value::Dose { gy, percent } => json!({ "gy": gy, "percent": percent }),
        Value::Volume { cc, percent } => json!({ "cc": cc, "percent": percent }),
        Value::TooSmall { cc } => json!({ "undefined": format!("the structure has only {cc:.3} cc") }),
    }
}

fn value_text(value: Value) -> String {
    match value {
        Value::Dose { gy, percent } => format!("{gy:9.2} Gy  {percent:8.2} %"),
        Value::Volume { cc, percent } => format!("{cc:9.3} cc  {percent:8.2} %"),
        Value::TooSmall { cc } => format!("not defined: the structure has only {cc:.3} cc"),
    }
}
