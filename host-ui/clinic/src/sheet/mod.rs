//! One page of an implant by AAPM TG-137: dose of target, urethra and rectum, indices, effect,
//! sectors; several states side by side.

mod figures;
mod page;
mod sectors;
mod slice;

pub use figures::{NotComputed, Row, rows};
pub use page::page;
pub use sectors::Sector;

use serde_json::{Value, json};
use slice::Slice;
use stylet_anatomy::Organ;
use stylet_dose::edema::Edema;
use stylet_dose::structure::bounds;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Seed, Source, Structure};
use stylet_implant::registration::RigidFit;

/// Margin around seeds and target in which volumes at a dose are searched.
const MARGIN_M: f64 = 0.03;
/// Number of points in that region.
const POINTS_AROUND: f64 = 200_000.0;

/// Data common to all states of an implant.
#[derive(Clone, Debug, PartialEq)]
pub struct Implant {
    /// Name of the page.
    pub title: String,
    /// Model of the seeds.
    pub source: Source,
    /// Prescribed dose, in Gy.
    pub prescription_gy: f64,
    /// Reference day of the strengths, in words.
    pub calibrated: String,
    /// Swelling of the gland for an additional column of each state.
    pub edema: Option<Edema>,
    /// True if the dose covers the whole life of the seeds; effects require that.
    pub is_for_ever: bool,
}

/// State of an implant: as planned, as delivered, on a later day.
#[derive(Clone, Debug)]
pub struct State {
    /// Name: "planned", "day 30".
    pub name: String,
    /// File of the seeds.
    pub file: String,
    /// Origin and frame of the outlines in which the dose is counted.
    pub structures_are: String,
    /// Time after the implant of these positions, in s.
    pub seen_s: f64,
    /// The seeds, in the frame of the structures.
    pub seeds: Vec<Seed>,
    /// The structures.
    pub structures: Vec<Structure>,
    /// Index of the target among them.
    pub target: usize,
    /// Fit of the seeds to those of the plan.
    pub fit: Option<RigidFit>,
}

/// A state with its dose.
#[derive(Clone, Debug)]
pub struct Column {
    /// The state.
    pub state: State,
    /// Name, with the effects considered.
    pub name: String,
    /// Histogram of each structure; `None` for one without volume.
    pub histograms: Vec<Option<Dvh>>,
    /// Whole volume at the prescription, in m³: the basis of indices.
    pub at_prescription_m3: Result<f64, NotComputed>,
    /// Sectors of the target.
    pub sectors: Vec<Sector>,
    /// Middle plane of the target; `None` for one without points.
    pub slice: Option<Slice>,
    /// True if the dose is that of a gland that swells.
    pub swells: bool,
}

impl Column {
    /// Computes the dose of a state, with its edema if one is given.
    pub fn of(implant: &Implant, kernel: &DoseKernel, state: State, edema: Option<Edema>) -> Self {
        let dose_gy = |points: &DosePoints| match edema {
            Some(edema) => {
                let half_life_s = implant.source.half_life_s;
                edema.dose_gy(kernel, half_life_s, state.seen_s, &state.seeds, points)
            }
            None => points.of_seeds_gy(kernel, &state.seeds),
        };
        let (mut histograms, mut sectors) = (Vec::new(), Vec::new());
        for (n, structure) in state.structures.iter().enumerate() {
            let dose_gy = dose_gy(&DosePoints::new(&structure.points_m));
            if n == state.target {
                sectors = sectors::of(structure, &dose_gy, implant.prescription_gy);
            }
            histograms.push(Dvh::new(&dose_gy, &structure.volumes_m3));
        }
        Self {
            name: match edema {
                Some(_) => format!("{}, edema", state.name),
                None => state.name.clone(),
            },
            at_prescription_m3: match edema {
                Some(_) => Err("with edema the surroundings do not move with the gland".into()),
                None => at_prescription_m3(implant, kernel, &state),
            },
            swells: edema.is_some(),
            slice: Slice::of(
                &state.structures,
                state.target,
                &state.seeds,
                implant.prescription_gy,
                &dose_gy,
            ),
            histograms,
            sectors,
            state,
        }
    }

    /// Returns the histogram of the target.
    pub fn target(&self) -> Option<&Dvh> {
        self.histograms.get(self.state.target)?.as_ref()
    }

    /// Returns the histogram of the first structure named like an organ; the wall of the rectum
    /// replaces it if it is drawn alone.
    pub fn organ(&self, organ: Organ) -> Option<&Dvh> {
        let called = |organ: Organ| {
            let mut all = self.state.structures.iter().zip(&self.histograms);
            all.find_map(|(s, dvh)| dvh.as_ref().filter(|_| organ.is_mentioned_in(&s.name)))
        };
        let wall = || (organ == Organ::Rectum).then(|| called(Organ::RectalWall)).flatten();
        called(organ).or_else(wall)
    }
}

/// Returns the volume at the prescription in the region around seeds and target.
fn at_prescription_m3(implant: &Implant, kernel: &DoseKernel, state: &State) -> Result<f64, NotComputed> {
    let mut corners: Vec<[f64; 3]> = state.seeds.iter().map(|s| s.position_m).collect();
    corners.extend(
        state
            .structures
            .get(state.target)
            .map(|t| <[[f64; 3]; 2]>::from(t.bounds_m()))
            .into_iter()
            .flatten(),
    );
    let (low, high) = bounds(&corners);
    let (low, high) = (low.map(|v| v - MARGIN_M), high.map(|v| v + MARGIN_M));
    let volume: f64 = (0..3).map(|a| high[a] - low[a]).product();
    let pitch_m = (volume / POINTS_AROUND).cbrt();
    let room = Structure::of_box("around", low, high, pitch_m);
    let dose_gy = DosePoints::new(&room.points_m).of_seeds_gy(kernel, &state.seeds);
    let at_face = |p: &[f64; 3]| (0..3).any(|a| p[a] < low[a] + pitch_m || p[a] > high[a] - pitch_m);
    let on_faces = room
        .points_m
        .iter()
        .zip(&dose_gy)
        .filter(|(p, _)| at_face(p))
        .map(|(_, gy)| *gy);
    let leaves_gy = on_faces.fold(0.0, f64::max);
    let point_m3 = room.volumes_m3.first().copied().unwrap_or(0.0);
    let reached = dose_gy.iter().filter(|gy| **gy >= implant.prescription_gy).count() as f64 * point_m3;
    match leaves_gy < implant.prescription_gy {
        true => Ok(reached),
        false => Err("the prescription isodose leaves the 30 mm around seeds and target".into()),
    }
}

/// Returns the figures of all states as JSON; a missing one gives its reason.
pub fn to_json(implant: &Implant, columns: &[Column]) -> Value {
    let of_column = |n: usize, column: &Column| {
        let cell = |row: &Row| match &row.values[n] {
            Ok(value) => json!(value),
            Err(why) => json!({ "not_computed": why.to_string() }),
        };
        let figures = rows(implant, columns);
        let figures = figures
            .iter()
            .map(|row| (format!("{} {} [{}]", row.group, row.name, row.unit), cell(row)));
        let sectors = column.sectors.iter().map(|s| {
            json!({ "name": s.name, "volume_cc": s.volume_m3 * 1e6, "d90_gy": s.d90_gy, "v100_percent": s.v100.map(|v| v * 100.0) })
        });
        let fit = column.state.fit.as_ref().map(|fit| {
            let [mean, square, worst] = fit.residual_figures_m().map(|m| m * 1e3);
            json!({
                "pairs": fit.residuals_m.len(),
                "counted": fit.counted,
                "turn_deg": fit.turn_deg(),
                "shift_mm": fit.shift_m.as_slice().iter().map(|m| m * 1e3).collect::<Vec<_>>(),
                "mean_mm": mean,
                "root_mean_square_mm": square,
                "worst_mm": worst,
                "stretch": fit.stretch,
                "residuals_mm": fit.residuals_m.iter().map(|m| m * 1e3).collect::<Vec<_>>(),
            })
        });
        json!({
            "state": column.name,
            "seeds_file": column.state.file,
            "structures": column.state.structures_are,
            "figures": figures.collect::<serde_json::Map<_, _>>(),
            "sectors": sectors.collect::<Vec<_>>(),
            "fit": fit,
        })
    };
    json!({
        "prescription_gy": implant.prescription_gy,
        "source": { "model": implant.source.model, "nuclide": implant.source.nuclide },
        "calibrated": implant.calibrated,
        "edema": implant.edema.map(|e| json!({ "magnitude_percent": e.magnitude * 100.0, "half_life_days": stylet_dose::decay::s_to_days(e.half_life_s) })),
        "definitions": figures::DEFINITIONS,
        "states": columns.iter().enumerate().map(|(n, c)| of_column(n, c)).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests;
