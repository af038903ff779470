//! Figures of Stylet that have a published counterpart, at the defaults of every parameter.

use super::budget::{paper, stage};
use super::study;
use stylet_insertions::{Insertion, Seed, Table};
use stylet_runtime::rehearse::Stage;
use stylet_shm_schema::{ParameterId, ParameterSet};
use stylet_sim::scene::{Scene, TissueKind};

/// Share of the needle's force that the hand feels.
const FORCE_SCALE: f64 = 0.9;

/// A figure by the name that the published one has.
pub struct Own {
    pub what: &'static str,
    pub value: f64,
    pub how: String,
}

/// Returns the beginning of the section: where the figures come from.
pub fn about() -> String {
    let study = study("validation.toml");
    let needles: usize = study.glands.iter().map(|gland| gland.plan.needles.len()).sum();
    format!(
        "\
## Against patients

Stylet's figures are of [`validation.toml`](study/validation.toml): {} insertions of strands into `pelvis`, each into
tissue at rest, every parameter at its default. The entry is off by 1 mm and 0.5 degrees (standard deviation of each
direction across), the stiffness by a factor of 1.6 (68 %). Deflection is of `paper`, with bending turned on. Rows on seeds
count strands of two and more: the published seeds are in strands, and the plan has no single seed in front.

",
        study.implants as usize * needles
    )
}

/// A seed of a strand.
pub struct Placed {
    planned_mm: [f64; 3],
    off_mm: [f64; 3],
}

impl Placed {
    fn of(seed: &Seed) -> Option<Self> {
        let rest = seed.rest?;
        Some(Self {
            planned_mm: seed.planned_mm,
            off_mm: [0, 1, 2].map(|a| rest.at_mm[a] - seed.planned_mm[a]),
        })
    }

    fn total_mm(&self) -> f64 {
        self.off_mm.iter().map(|c| c * c).sum::<f64>().sqrt()
    }
}

/// Returns the needles with strands, and those with a single seed.
fn by_seeds(table: &Table) -> (Vec<&Insertion>, Vec<&Insertion>) {
    table.rows.iter().partition(|row| row.seeds.len() > 1)
}

/// Returns the seeds that rest in strands.
pub fn in_strands(table: &Table) -> Vec<Placed> {
    let seeds = by_seeds(table).0.into_iter().flat_map(|row| &row.seeds);
    seeds.filter_map(Placed::of).collect()
}

/// Returns the mean misplacement, then its mean absolute part to the side, up or down, and along the needle.
pub fn mean_parts_mm(seeds: &[Placed]) -> [f64; 4] {
    let along = |axis: usize| mean(seeds.iter().map(|seed| seed.off_mm[axis].abs()));
    [mean(seeds.iter().map(Placed::total_mm)), along(0), along(1), along(2)]
}

pub fn failed(table: &Table) -> usize {
    table.rows.iter().filter(|row| row.outcome.is_err()).count()
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values
        .into_iter()
        .fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    sum / count
}

/// Returns the mean total misplacement of one group of seeds over that of another one.
fn ratio(seeds: &[Placed], of: impl Fn(&Placed) -> bool, over: impl Fn(&Placed) -> bool) -> f64 {
    let of = mean(seeds.iter().filter(|seed| of(seed)).map(Placed::total_mm));
    of / mean(seeds.iter().filter(|seed| over(seed)).map(Placed::total_mm))
}

fn misplacement_mm(row: &Insertion) -> Option<f64> {
    let seeds: Vec<f64> = row
        .seeds
        .iter()
        .filter_map(Placed::of)
        .map(|seed| seed.total_mm())
        .collect();
    (!seeds.is_empty()).then(|| mean(seeds))
}

pub fn of_stylet(table: &Table) -> Vec<Own> {
    let (low, high) = Scene::builtin("pelvis").expect("built in").target_bounds_m();
    let share = |seed: &Placed, axis: usize| (1e-3 * seed.planned_mm[axis] - low[axis]) / (high[axis] - low[axis]);
    let (strands, single) = by_seeds(table);
    let seeds = in_strands(table);
    let [total_mm, side_mm, up_mm, along_mm] = mean_parts_mm(&seeds);
    let single_mm = mean(single.iter().filter_map(|row| misplacement_mm(row)));
    let motions: Vec<_> = table.rows.iter().filter_map(|row| row.outcome.as_ref().ok()).collect();
    let failed = failed(table);
    let speed = table
        .quantities
        .iter()
        .position(|name| name.starts_with("insert_mm"))
        .expect("is drawn");
    let mut needles: Vec<(f64, f64)> = strands
        .iter()
        .filter_map(|row| Some((row.drawn[speed], misplacement_mm(row)?)))
        .collect();
    needles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (slow, fast) = needles.split_at(needles.len() / 2);
    let of_half = |half: &[(f64, f64)]| mean(half.iter().map(|needle| needle.1));
    let largest = |of: fn(&stylet_insertions::Motion) -> f64| motions.iter().map(|m| of(m)).fold(0.0, f64::max);
    let shift_mm = mean(motions.iter().map(|m| m.target_shift_mm));
    let many = format!("mean of {} seeds in strands", seeds.len());
    let own = |what, value, how: &str| Own {
        what,
        value,
        how: how.to_owned(),
    };
    vec![
        own(
            "seed misplacement",
            total_mm,
            &format!(
                "{many}, {single_mm:.1} of single ones; {failed} of {} needles failed",
                table.rows.len()
            ),
        ),
        own("seed misplacement, to the side", side_mm, &many),
        own("seed misplacement, up or down", up_mm, &many),
        own("seed misplacement, along the needle", along_mm, &many),
        own(
            "misplacement at the base over midgland",
            ratio(
                &seeds,
                |s| share(s, 2) > 2.0 / 3.0,
                |s| (1.0 / 3.0..2.0 / 3.0).contains(&share(s, 2)),
            ),
            "thirds of the gland",
        ),
        own(
            "misplacement in front over behind",
            ratio(&seeds, |s| share(s, 1) > 0.5, |s| share(s, 1) < 0.5),
            "halves of the gland",
        ),
        own(
            "misplacement of fast needles over slow ones",
            of_half(fast) / of_half(slow),
            "halves of the needles by speed, 20 to 120 mm/s",
        ),
        own(
            "shift, needle pushed by hand",
            shift_mm,
            &format!("largest {:.1} mm", largest(|m| m.target_shift_mm)),
        ),
        own(
            "shift of the base",
            shift_mm,
            "of the whole gland, one needle in; at most four may stay in",
        ),
        own(
            "displacement of the target, biopsy",
            mean(motions.iter().map(|m| m.largest_displacement_mm)),
            "of the tissue at the tip",
        ),
        own(
            "force of an 18 G needle",
            mean(motions.iter().map(|m| m.peak_force_n)) / FORCE_SCALE,
            "at the needle, mean of the peaks",
        ),
        own(
            "deflection of the tip, transrectal",
            deflection_mm(&mut stage(&paper(), TissueKind::ChainMail)),
            "18 G, one needle on the axis of `paper`, bevel 0.7; off by default",
        ),
    ]
}

fn deflection_mm(stage: &mut Stage) -> f64 {
    let mut set = ParameterSet::default();
    set.set(ParameterId::BendingStiffness, 0.016);
    1e3 * super::budget::default_procedure(stage, &set).deflection_m
}
