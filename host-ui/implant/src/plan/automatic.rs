//! A first plan by modified peripheral loading: many needles near the edge of the gland, fewer
//! inside, none near the urethra.
//!
//! The strength of a seed follows. Dose is linear in it, so one sum of doses of 1 U gives the
//! strength at which the required share of the gland gets the prescription.

use super::check::SPARED_MARGIN_M;
use super::{Anatomy, Hole, ImplantPlan, Loading, Needle, NeedleSeed, PlanError, SEED_LENGTH_M, SPACER_M, Template};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Seed};

/// Aims of a first plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aims {
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Share of the target that must get the prescription.
    pub covered: f64,
    /// Distance of needles from spared structures, in addition to their margin.
    pub spared_m: f64,
    /// Usual number of needles for a whole gland.
    pub needles: [usize; 2],
    /// Usual strengths of ordered seeds.
    pub strengths_u: [f64; 2],
}

impl Aims {
    /// Returns the usual aims for a prescription, Gy.
    pub fn new(prescription_gy: f64) -> Self {
        Self {
            prescription_gy,
            covered: 0.96,
            spared_m: 2e-3,
            needles: [20, 25],
            strengths_u: [0.25, 0.6],
        }
    }
}

/// Pattern for loading a gland; several are tried, and the one that overdoses least is used.
#[derive(Clone, Copy, Debug)]
struct Pattern {
    /// Every second hole, as on a chessboard, or all.
    parity: Option<u8>,
    /// Distance from the edge of the target within which needles count as peripheral.
    rim_m: f64,
    /// Smallest distance of two needles at the rim, and of two others.
    rim_apart_m: f64,
    inside_apart_m: f64,
    /// Distance of the outermost seeds of a needle from the edge of the target.
    inset_m: f64,
    /// True if needles inside have seeds at their ends only.
    thinned: bool,
}

fn patterns() -> impl Iterator<Item = Pattern> {
    let parities = [None, Some(0), Some(1)];
    let apart = [(6.9e-3, 6.9e-3), (6.9e-3, 9.9e-3), (6.9e-3, 13.9e-3), (9.9e-3, 9.9e-3)];
    parities.into_iter().flat_map(move |parity| {
        [7e-3, 10e-3, 13e-3].into_iter().flat_map(move |rim_m| {
            apart.into_iter().flat_map(move |(rim_apart_m, inside_apart_m)| {
                [(1.5e-3, true), (2.5e-3, true), (1.5e-3, false), (2.5e-3, false)].map(|(inset_m, thinned)| Pattern {
                    parity,
                    rim_m,
                    rim_apart_m,
                    inside_apart_m,
                    inset_m,
                    thinned,
                })
            })
        })
    })
}

const UNIT_U: f64 = 1.0;
const PITCH_M: f64 = SEED_LENGTH_M + SPACER_M;
/// Tolerance within which seeds at the distance of a strand's are ordered as a strand.
const NEARLY_M: f64 = 1e-3;
/// Shortest piece of target that gets a needle, and distance of needles from its edge: tissue there
/// gives way before it is pierced.
const SHORTEST_M: f64 = 15e-3;
const NEAREST_RIM_M: f64 = 2.5e-3;
const DOSE_PITCH_M: f64 = 1e-3;
/// Pitch for comparing patterns; coarse is enough.
const TRIAL_PITCH_M: f64 = 2e-3;
/// Number of seeds that a thinned needle keeps at each end.
const KEPT_AT_END: usize = 1;

/// Hole that a needle can use, and the piece of target behind it.
struct Way {
    hole: Hole,
    piece_m: [f64; 2],
    /// Distance to the nearest place outside the target across the needle, halfway down.
    rim_m: f64,
}

/// Plans needles, seeds and their strength; returns an error if no needle fits. `report` gets the
/// completed share; if it breaks, the search is cancelled.
pub fn plan(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &str,
    aims: &Aims,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<ImplantPlan, PlanError> {
    let ways = ways(&template, anatomy, aims);
    let target = anatomy.target.structure(TRIAL_PITCH_M);
    let points = DosePoints::new(&target.points_m);
    let patterns: Vec<Pattern> = patterns().collect();
    let mut best: Option<(f64, ImplantPlan)> = None;
    for (done, pattern) in patterns.iter().enumerate() {
        if report(done as f32 / patterns.len() as f32).is_break() {
            return Err(PlanError::Cancelled);
        }
        let plan = load(&template, &ways, pattern, source, aims);
        let dose_gy = points.of_seeds_gy(kernel, &plan.seeds());
        let dvh = Dvh::new(&dose_gy, &target.volumes_m3);
        if let Some(found) = dvh.and_then(|dvh| shortfall(&plan, &dvh, aims))
            && best.as_ref().is_none_or(|(least, _)| found < *least)
        {
            best = Some((found, plan));
        }
    }
    let (_, plan) = best.ok_or(PlanError::NoWay)?;
    let strength_u = strength_u(&plan, anatomy, kernel, aims)?;
    Ok(plan.with_strength(strength_u))
}

/// Places seeds of 1 U by one pattern.
fn load(template: &Template, ways: &[Way], pattern: &Pattern, source: &str, aims: &Aims) -> ImplantPlan {
    let mut needles: Vec<Needle> = chosen(template, ways, pattern)
        .into_iter()
        .map(|(way, is_rim)| needle(template, way, is_rim, pattern))
        .collect();
    // From anterior to posterior, as in practice: the part behind stays visible to the probe.
    needles.sort_by(|a, b| {
        b.hole
            .map(Hole::row)
            .cmp(&a.hole.map(Hole::row))
            .then(a.hole.cmp(&b.hole))
    });
    ImplantPlan {
        template: *template,
        source: source.to_owned(),
        prescription_gy: aims.prescription_gy,
        needles,
    }
}

/// Returns the percent of the target above 150 % of the prescription. Each needle and each tenth of
/// strength outside the usual range adds one; `None` without dose.
fn shortfall(plan: &ImplantPlan, of_one_u: &Dvh, aims: &Aims) -> Option<f64> {
    let reached_gy = of_one_u
        .dose_of_gy(aims.covered * of_one_u.volume_m3())
        .filter(|gy| *gy > 0.0)?;
    let v150 = of_one_u.at_least_m3(1.5 * reached_gy) / of_one_u.volume_m3() * 100.0;
    let strength_u = aims.prescription_gy / reached_gy;
    let [few, many] = aims.needles.map(|n| n as f64);
    let needles = plan.needles.len() as f64;
    let [weak, strong] = aims.strengths_u;
    let unusual = (few - needles).max(needles - many).max(0.0)
        + (weak / strength_u).max(strength_u / strong).ln().max(0.0) * 10.0;
    Some(v150 * (1.0 + 0.2 * unusual))
}

/// Returns the strength at which `aims.covered` of the target gets the prescription.
pub fn strength_u(plan: &ImplantPlan, anatomy: &Anatomy, kernel: &DoseKernel, aims: &Aims) -> Result<f64, PlanError> {
    let target = anatomy.target.structure(DOSE_PITCH_M);
    let of_one_u: Vec<Seed> = plan.with_strength(UNIT_U).seeds();
    let dose_gy = DosePoints::new(&target.points_m).of_seeds_gy(kernel, &of_one_u);
    let dvh = Dvh::new(&dose_gy, &target.volumes_m3);
    let reached = dvh.and_then(|d| d.dose_of_gy(aims.covered * d.volume_m3()));
    let reached_gy = reached.filter(|gy| *gy > 0.0).ok_or(PlanError::NoDose)?;
    Ok(aims.prescription_gy / reached_gy * UNIT_U)
}

fn ways(template: &Template, anatomy: &Anatomy, aims: &Aims) -> Vec<Way> {
    let (low, high) = anatomy.target.bounds_m();
    let length_m = farthest_m(template, low, high);
    let way = |hole: Hole| {
        let entry_m = template.hole_m(hole);
        let pieces = anatomy.target.pieces_m(entry_m, template.inwards, length_m);
        let piece_m = pieces
            .into_iter()
            .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
        let margin_m = SPARED_MARGIN_M + aims.spared_m;
        let is_blocked = anatomy
            .spared_in_the_way(entry_m, template.inwards, piece_m[1], margin_m)
            .is_some();
        let middle_m = (piece_m[0] + piece_m[1]) / 2.0;
        let place_m = [0, 1, 2].map(|a| entry_m[a] + template.inwards[a] * middle_m);
        let rim_m = rim_m(template, anatomy, place_m);
        let is_deep = piece_m[1] - piece_m[0] >= SHORTEST_M && rim_m >= NEAREST_RIM_M;
        (is_deep && !is_blocked).then_some(Way { hole, piece_m, rim_m })
    };
    Hole::all().filter_map(way).collect()
}

fn farthest_m(template: &Template, low: [f64; 3], high: [f64; 3]) -> f64 {
    (0..8)
        .map(|corner| {
            let at = |a: usize| if corner >> a & 1 == 0 { low[a] } else { high[a] };
            (0..3)
                .map(|a| (at(a) - template.middle_m[a]) * template.inwards[a])
                .sum::<f64>()
        })
        .fold(0.0, f64::max)
}

/// Returns the distance from a place in the target straight out across the needles, the shortest of
/// 16 directions.
fn rim_m(template: &Template, anatomy: &Anatomy, place_m: [f64; 3]) -> f64 {
    const STEP_M: f64 = 0.5e-3;
    let out_m = |direction: usize| {
        let (sine, cosine) = (direction as f64 * std::f64::consts::PI / 8.0).sin_cos();
        let across = [0, 1, 2].map(|a| template.columns[a] * cosine + template.rows[a] * sine);
        let steps = (0..200).take_while(|&step| {
            let by_m = f64::from(step) * STEP_M;
            anatomy
                .target
                .contains([0, 1, 2].map(|a| place_m[a] + across[a] * by_m))
        });
        steps.count() as f64 * STEP_M
    };
    (0..16).map(out_m).fold(f64::INFINITY, f64::min)
}

/// Returns the rim first, its outermost holes before the others; then inside, from the outside
/// inwards.
fn chosen<'a>(template: &Template, ways: &'a [Way], pattern: &Pattern) -> Vec<(&'a Way, bool)> {
    let is_on = |w: &&Way| pattern.parity.is_none_or(|p| (w.hole.column() + w.hole.row()) % 2 == p);
    let mut ways: Vec<&Way> = ways.iter().filter(is_on).collect();
    ways.sort_by(|a, b| a.rim_m.total_cmp(&b.rim_m).then(a.hole.cmp(&b.hole)));
    let mut taken: Vec<(&Way, bool)> = Vec::new();
    for way in ways {
        let is_rim = way.rim_m <= pattern.rim_m;
        let apart_m = if is_rim {
            pattern.rim_apart_m
        } else {
            pattern.inside_apart_m
        };
        let is_free = taken.iter().all(|(other, _)| {
            let (a, b) = (template.hole_m(way.hole), template.hole_m(other.hole));
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt() >= apart_m
        });
        if is_free {
            taken.push((way, is_rim));
        }
    }
    taken
}

/// Places seeds about 10 mm apart from end to end of the piece; inside the gland only at its ends.
fn needle(template: &Template, way: &Way, is_rim: bool, pattern: &Pattern) -> Needle {
    let [from_m, to_m] = way.piece_m;
    let room_m = (to_m - from_m - 2.0 * pattern.inset_m).max(0.0);
    let count = (room_m / PITCH_M).round() as usize + 1;
    let middle_m = (from_m + to_m) / 2.0;
    let evenly_m = if count > 1 {
        room_m / (count - 1) as f64
    } else {
        PITCH_M
    };
    let is_strand = (evenly_m - PITCH_M).abs() < NEARLY_M;
    let pitch_m = if is_strand { PITCH_M } else { evenly_m };
    let first_m = middle_m + (count - 1) as f64 * pitch_m / 2.0;
    let mut seeds: Vec<NeedleSeed> = Needle::strand(count, first_m, pitch_m - SEED_LENGTH_M, UNIT_U);
    let is_thinned = pattern.thinned && !is_rim && count > 2 * KEPT_AT_END;
    if is_thinned {
        seeds.drain(KEPT_AT_END..count - KEPT_AT_END);
    }
    Needle {
        hole: Some(way.hole),
        entry_m: template.hole_m(way.hole),
        direction: template.inwards,
        depth_m: first_m,
        retract_to_m: 0.0,
        loading: if is_thinned || !is_strand || count == 1 {
            Loading::Loose
        } else {
            Loading::Stranded { spacer_m: SPACER_M }
        },
        seeds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::anatomy::ball;
    use crate::plan::check::problems;
    use stylet_anatomy::PatientFrame;
    use stylet_dose::decay::Interval;
    use stylet_dose::{Metric, Source};

    const TEMPLATE: Template = Template {
        middle_m: [0.05, 0.05, -0.01],
        columns: [-1.0, 0.0, 0.0],
        rows: [0.0, 1.0, 0.0],
        inwards: [0.0, 0.0, 1.0],
        pitch_m: 5e-3,
    };

    fn iodine() -> (Source, DoseKernel) {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sources/i125_6711.toml");
        let source = Source::read(&file).unwrap();
        let kernel = DoseKernel::new(&source, Interval::ALL);
        (source, kernel)
    }

    fn gland(half_m: [f64; 3]) -> Anatomy {
        let middle_m = [0.05, 0.05, 0.06];
        Anatomy {
            target: ball("gland", middle_m, half_m),
            spared: vec![ball("urethra", middle_m, [0.003, 0.003, 0.03])],
            bone: Vec::new(),
            lower_m: [0.0; 3],
            upper_m: [0.1; 3],
            patient: PatientFrame::default(),
        }
    }

    #[test]
    fn a_search_reports_its_share_and_ends_when_it_is_cancelled() {
        let (source, kernel) = iodine();
        let anatomy = gland([0.02, 0.0165, 0.018]);
        let reported = std::cell::RefCell::new(Vec::new());
        let report = |share: f32| {
            reported.borrow_mut().push(share);
            match reported.borrow().len() {
                4 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let ended = plan(TEMPLATE, &anatomy, &kernel, &source.model, &Aims::new(145.0), report);
        assert!(matches!(ended, Err(PlanError::Cancelled)));
        let all = patterns().count() as f32;
        assert_eq!(*reported.borrow(), [0.0, 1.0 / all, 2.0 / all, 3.0 / all]);
    }

    /// Tests a gland of 49 cc and one of 25 cc, neither of them the paper's.
    #[test]
    fn a_first_plan_covers_the_gland_and_has_no_problem() {
        let (source, kernel) = iodine();
        for (half_m, most_v150) in [([0.0255, 0.0205, 0.0225], 65.0), ([0.02, 0.0165, 0.018], 65.0)] {
            let anatomy = gland(half_m);
            let aims = Aims::new(145.0);
            let plan = plan(TEMPLATE, &anatomy, &kernel, &source.model, &aims, |_| {
                ControlFlow::Continue(())
            })
            .unwrap();
            let found = problems(&plan, &anatomy);
            assert!(found.is_empty(), "{found:?}");
            let target = anatomy.target.structure(1e-3);
            let dose = DosePoints::new(&target.points_m).of_seeds_gy(&kernel, &plan.seeds());
            let dvh = Dvh::new(&dose, &target.volumes_m3).unwrap();
            let value = |name: &str| Metric::parse(name).unwrap().of(&dvh, 145.0).main().unwrap();
            let (v100, v150, d90) = (value("V100"), value("V150"), value("D90"));
            println!(
                "{} needles, {} seeds of {:.3} U: V100 {v100:.2} %, V150 {v150:.1} %, D90 {d90:.1} Gy",
                plan.needles.len(),
                plan.seed_count(),
                plan.needles[0].seeds[0].strength_u
            );
            assert!((v100 - 100.0 * aims.covered).abs() < 0.2, "V100 {v100}");
            assert!(d90 > 145.0 && v150 < most_v150, "D90 {d90}, V150 {v150}");
        }
    }
}
