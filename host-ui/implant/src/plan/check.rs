//! Problems of a plan, all of them at once.

use super::anatomy::Body;
use super::{Anatomy, ImplantPlan, Loading, Needle, NeedleSeed, SEED_LENGTH_M};
use nalgebra::Vector3;
use stylet_shm_schema::MAX_SEEDS;

/// Reach of a 20 cm needle's tip beyond the template's face.
const REACH_M: f64 = 0.20;
/// Depth of the deepest seed's middle at that reach.
pub const DEEPEST_SEED_M: f64 = REACH_M - 0.5 * SEED_LENGTH_M;
/// Smallest distance of a needle from spared structures.
pub const SPARED_MARGIN_M: f64 = 1e-3;
/// Distance outside the target up to which a seed is allowed: seeds at its edge are planned there.
const EDGE_M: f64 = 1e-3;
/// Difference below which two lengths are equal.
const SAME_M: f64 = 1e-6;
/// Range of strengths on sale.
pub const STRENGTHS_U: [f64; 2] = [0.05, 10.0];

/// Problem, in words, with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Index of the needle, from 0; `None` for the plan as a whole.
    pub needle: Option<usize>,
    /// Index of the seed on its needle, deepest first.
    pub seed: Option<usize>,
    /// Problem and remedy.
    pub what: String,
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.needle, self.seed) {
            (Some(needle), Some(seed)) => write!(f, "needle {}, seed {}: {}", needle + 1, seed + 1, self.what),
            (Some(needle), None) => write!(f, "needle {}: {}", needle + 1, self.what),
            _ => f.write_str(&self.what),
        }
    }
}

/// Returns every problem, in the order of needles.
pub fn problems(plan: &ImplantPlan, anatomy: &Anatomy) -> Vec<Problem> {
    let mut found = Found::default();
    if plan.needles.is_empty() {
        found.add("the plan has no needle; add one");
    }
    if plan.seed_count() > MAX_SEEDS {
        let what = format!("{} seeds; at most {MAX_SEEDS} can be placed", plan.seed_count());
        found.add(&what);
    }
    for (number, needle) in plan.needles.iter().enumerate() {
        found.needle = Some(number);
        way(&mut found, needle, anatomy);
        if let Some(other) = same_hole(plan, number) {
            let what = format!("it goes through the hole of needle {}; move one of them", other + 1);
            found.add(&what);
        }
        for (seed, place) in needle.seeds_m().enumerate() {
            found.seed = Some(seed);
            seed_alone(&mut found, needle, seed, place, anatomy);
        }
        found.seed = None;
        strand(&mut found, needle);
    }
    found.needle = None;
    too_close(&mut found, plan);
    found.problems
}

#[derive(Default)]
struct Found {
    needle: Option<usize>,
    seed: Option<usize>,
    problems: Vec<Problem>,
}

impl Found {
    fn add(&mut self, what: &str) {
        self.problems.push(Problem {
            needle: self.needle,
            seed: self.seed,
            what: what.to_owned(),
        });
    }
}

fn way(found: &mut Found, needle: &Needle, anatomy: &Anatomy) {
    let numbers = [needle.entry_m, needle.direction].concat();
    let finite = numbers
        .iter()
        .chain([&needle.depth_m, &needle.retract_to_m])
        .all(|v| v.is_finite());
    if !finite || (Vector3::from(needle.direction).norm() - 1.0).abs() > 1e-3 {
        return found.add("its entry, direction or depth is not a number, or the direction is not a unit vector");
    }
    if needle.seeds.is_empty() {
        found.add("it has no seed; load or remove it");
    }
    let tip_m = needle.tip_m();
    if tip_m > REACH_M {
        let (tip_mm, reach_mm) = (tip_m * 1e3, REACH_M * 1e3);
        found.add(&format!(
            "its tip goes {tip_mm:.1} mm deep; the needle reaches {reach_mm:.0} mm"
        ));
    }
    if !(needle.depth_m >= 0.0 && (0.0..=needle.depth_m).contains(&needle.retract_to_m)) {
        found.add("its depth is negative, or it is drawn back to a place that is not between entry and depth");
        return;
    }
    let tip_m = tip_m.min(REACH_M);
    if let Some(body) = anatomy.spared_in_the_way(needle.entry_m, needle.direction, tip_m, SPARED_MARGIN_M) {
        found.add(&format!("it goes through {}, which is to be spared", body.name));
    }
    let piece = |body: &&Body| !body.pieces_m(needle.entry_m, needle.direction, tip_m).is_empty();
    if let Some(bone) = anatomy.bone.iter().find(piece) {
        found.add(&format!(
            "it goes through {}, which is bone; choose another hole",
            bone.name
        ));
    }
}

/// Returns the first needle before this one that goes through the same hole.
fn same_hole(plan: &ImplantPlan, number: usize) -> Option<usize> {
    let hole = plan.needles[number].hole?;
    plan.needles[..number].iter().position(|n| n.hole == Some(hole))
}

fn seed_alone(found: &mut Found, needle: &Needle, seed: usize, place_m: [f64; 3], anatomy: &Anatomy) {
    let NeedleSeed { along_m, strength_u } = needle.seeds[seed];
    if !along_m.is_finite() || along_m < 0.0 || along_m > needle.depth_m + SAME_M {
        let (along, depth) = (along_m * 1e3, needle.depth_m * 1e3);
        found.add(&format!(
            "it is {along:.1} mm along its needle, which extends from 0 to {depth:.1} mm"
        ));
    } else if !is_in_target(anatomy, place_m, needle.direction) {
        found.add(&format!("it lies outside {}", anatomy.target.name));
    }
    let [least, most] = STRENGTHS_U;
    if !(least..=most).contains(&strength_u) {
        found.add(&format!(
            "its strength is {strength_u} U; seeds have {least} to {most} U"
        ));
    }
    let deeper = seed.checked_sub(1).map(|s| needle.seeds[s].along_m);
    if let Some(deeper_m) = deeper
        && !(SEED_LENGTH_M - SAME_M..).contains(&(deeper_m - along_m))
    {
        let apart = (deeper_m - along_m) * 1e3;
        let length = SEED_LENGTH_M * 1e3;
        found.add(&format!(
            "it is {apart:.1} mm behind the previous one, closer than its length of {length} mm"
        ));
    }
}

pub(super) fn is_in_target(anatomy: &Anatomy, place_m: [f64; 3], direction: [f64; 3]) -> bool {
    let shifted = |by_m: f64| [0, 1, 2].map(|a| place_m[a] + direction[a] * by_m);
    [0.0, EDGE_M, -EDGE_M]
        .into_iter()
        .any(|by| anatomy.target.is_near(shifted(by), direction, EDGE_M))
}

fn strand(found: &mut Found, needle: &Needle) {
    let Loading::Stranded { spacer_m } = needle.loading else {
        return;
    };
    if !(spacer_m > 0.0 && spacer_m <= 0.05) {
        return found.add("the spacer of its strand must be above 0 and at most 50 mm");
    }
    let pitch_m = SEED_LENGTH_M + spacer_m;
    let off = |pair: &[NeedleSeed]| (pair[0].along_m - pair[1].along_m - pitch_m).abs();
    if needle.seeds.windows(2).any(|pair| !(..=SAME_M).contains(&off(pair))) {
        let pitch = pitch_m * 1e3;
        found.add(&format!(
            "the seeds of its strand must lie {pitch:.1} mm apart; make it loose or load it again"
        ));
    }
}

/// Reports seeds of different needles that would overlap.
fn too_close(found: &mut Found, plan: &ImplantPlan) {
    let of_needle = |(n, needle): (usize, &Needle)| {
        needle
            .seeds_m()
            .enumerate()
            .map(move |(s, p)| (n, s, p))
            .collect::<Vec<_>>()
    };
    let all: Vec<(usize, usize, [f64; 3])> = plan.needles.iter().enumerate().flat_map(of_needle).collect();
    for (i, (needle, seed, place)) in all.iter().enumerate() {
        for (other, other_seed, there) in all[..i].iter().filter(|o| o.0 != *needle) {
            let apart_m = (Vector3::from(*place) - Vector3::from(*there)).norm();
            if apart_m < SEED_LENGTH_M / 2.0 {
                (found.needle, found.seed) = (Some(*needle), Some(*seed));
                found.add(&format!(
                    "it is {:.1} mm from seed {} of needle {}",
                    apart_m * 1e3,
                    other_seed + 1,
                    other + 1
                ));
            }
        }
    }
    (found.needle, found.seed) = (None, None);
}
