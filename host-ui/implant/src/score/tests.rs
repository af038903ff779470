//! Scores of implants with known errors, against a recomputed dose.

use super::*;
use crate::intraoperative::{Agreement, Doses, SeedsFrom, Update};
use crate::plan::ImplantPlan;
use crate::plan::anatomy::ball;
use crate::plan::optimise::Figures;
use crate::plan::optimise::tests::glands::TEMPLATE;
use bytemuck::Zeroable;
use stylet_anatomy::PatientFrame;
use stylet_dose::decay::Interval;
use stylet_dose::{DosePoints, Dvh, Metric, Source};
use stylet_host::moments::MomentKind;

const MIDDLE_M: [f64; 3] = [0.05, 0.05, 0.06];

fn anatomy() -> Anatomy {
    Anatomy {
        target: ball("gland", MIDDLE_M, [0.02, 0.018, 0.018]),
        spared: vec![ball("urethra", MIDDLE_M, [0.003, 0.003, 0.02])],
        bone: Vec::new(),
        lower_m: [0.0; 3],
        upper_m: [0.1; 3],
        patient: PatientFrame::default(),
    }
}

fn kernel() -> DoseKernel {
    DoseKernel::new(&Source::known("6711").unwrap(), Interval::ALL)
}

/// Returns a grid of seeds, those named in `off` deeper by 6 mm.
fn pairs(off: &[usize]) -> Vec<SeedPair> {
    let places = (0..36).map(|i| [i % 3, i / 3 % 3, i / 9].map(f64::from));
    let seed = |(i, at): (usize, [f64; 3])| {
        let position_m = [0, 1, 2].map(|a| MIDDLE_M[a] + (at[a] - [1.0, 1.0, 1.5][a]) * 10e-3);
        let planned = Seed {
            position_m,
            axis: Some([0.0, 0.0, 1.0]),
            strength_u: 0.6,
        };
        let mut delivered = planned;
        if off.contains(&i) {
            delivered.position_m[2] += 6e-3;
        }
        SeedPair {
            needle: i % 9,
            hole: None,
            planned,
            delivered,
        }
    };
    places.enumerate().map(seed).collect()
}

fn score<'a>(off: &[usize], anatomy: &'a Anatomy, kernel: &'a DoseKernel, records: &'a [TickRecord]) -> Score<'a> {
    Score::of(Implant {
        title: "a <test>".to_owned(),
        pairs: pairs(off),
        lost: Vec::new(),
        unplanned: Vec::new(),
        anatomy,
        kernel,
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        motion: Motion::of(records, [0.0, 0.0, 1.0]),
        records,
        moments: vec![Moment {
            time_ns: 2_500_000_000,
            kind: MomentKind::Mark,
            text: "apex <left>".to_owned(),
        }],
        updates: Vec::new(),
    })
    .unwrap()
}

#[test]
fn an_implant_on_plan_has_no_error_and_no_seed_costs_anything() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let score = score(&[], &anatomy, &kernel, &[]);
    assert_eq!(score.errors_m(), [0.0, 0.0]);
    assert_eq!(score.planned.dvhs, score.delivered.dvhs);
    for cost in &score.costs {
        assert!(
            cost.target_d90_gy.abs() < 1e-6 && cost.target_v100_percent.abs() < 1e-6,
            "{cost:?}"
        );
    }
}

#[test]
fn marks_are_on_the_page_and_in_the_figures() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let records = [TickRecord {
        due_ns: 500_000_000,
        ..bytemuck::Zeroable::zeroed()
    }];
    let score = score(&[], &anatomy, &kernel, &records);
    assert_eq!(
        to_json(&score)["moments"][0],
        serde_json::json!({ "at_s": 2.0, "kind": "mark", "text": "apex <left>" })
    );
    let page = page::page(&score).expect("drawn");
    assert!(page.contains("apex &lt;left&gt;"), "the words, escaped");
}

#[test]
fn an_update_is_in_the_debrief_with_its_contour_error() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let records = [<TickRecord as Zeroable>::zeroed()];
    let mut score = score(&[], &anatomy, &kernel, &records);
    let section = |score: &Score| page::page(score).expect("drawn").contains("Updates of the plan");
    assert!(!section(&score));
    let figures = |d90: f64| Figures {
        d90,
        ..Figures::default()
    };
    let doses = Doses {
        now: figures(41.0),
        continued: figures(88.25),
    };
    let plan = ImplantPlan {
        template: TEMPLATE,
        source: String::new(),
        prescription_gy: 145.0,
        needles: Vec::new(),
    };
    score.implant.updates.push(Reviewed {
        update: Update {
            plan,
            begun: 7,
            doses,
            updated: figures(103.0),
        },
        lying: 21,
        seeds_from: SeedsFrom::Marks,
        agreement: Some(Agreement {
            dice: 0.9312,
            mean_m: 0.81e-3,
            hausdorff_m: 3.2e-3,
            volumes_m3: [38.2e-6, 40.1e-6],
        }),
        marked: [19, 1],
        residuals_m: Some([1.24e-3, 3.9e-3]),
        left: [[8, 30], [7, 28]],
        accepted: true,
    });
    let json = &to_json(&score)["updates"][0];
    assert_eq!(json["contour"]["dice"], 0.9312);
    assert_eq!(
        (&json["continued"]["target_d90_percent"], &json["accepted"]),
        (&88.25.into(), &true.into())
    );
    assert_eq!(
        (&json["marked"], &json["left_updated"]["seeds"]),
        (&19.into(), &28.into())
    );
    let page = page::page(&score).expect("drawn");
    for words in [
        "Dice 0.931, surfaces 0.81 mm apart on average and 3.2 mm at most, 38.2 cc of 40.1 cc",
        "Update 1, accepted",
        "19 seeds were marked, 1.2 mm off on average and 3.9 mm at most; marks of no seed: 1",
        "8 needles with 30 seeds remained, 7 with 28 in the update",
    ] {
        assert!(page.contains(words), "{words}");
    }
}

#[test]
fn the_only_misplaced_seed_has_the_whole_cost() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let score = score(&[4], &anatomy, &kernel, &[]);
    assert!((score.implant.pairs[4].offset().along_m - 6e-3).abs() < 1e-12);
    assert!(score.implant.pairs[4].offset().across_m < 1e-12);
    let [mean, worst] = score.errors_m();
    assert!((mean - 6e-3 / 36.0).abs() < 1e-12 && (worst - 6e-3).abs() < 1e-12);
    // Dose of all seeds recomputed with this one on plan: the plan itself.
    let structures = anatomy.structures();
    let value = |one: fn(&SeedPair) -> Seed, structure: usize, name: &str| {
        let seeds: Vec<Seed> = score.implant.pairs.iter().map(one).collect();
        let dose = DosePoints::new(&structures[structure].points_m).of_seeds_gy(&kernel, &seeds);
        let dvh = Dvh::new(&dose, &structures[structure].volumes_m3).unwrap();
        Metric::parse(name).unwrap().of(&dvh, 145.0).main().unwrap()
    };
    let lost = |structure, name| value(|p| p.planned, structure, name) - value(|p| p.delivered, structure, name);
    let cost = score.costs[4];
    println!("{cost:?}");
    assert!((cost.target_d90_gy - lost(0, "D90")).abs() < 1e-6);
    assert!((cost.target_v100_percent - lost(0, "V100")).abs() < 1e-6);
    assert!((cost.urethra_d10_gy.unwrap() + lost(1, "D10")).abs() < 1e-6);
    assert!((cost.urethra_d30_gy.unwrap() + lost(1, "D30")).abs() < 1e-6);
    assert!(cost.target_d90_gy.abs() > 1e-3 && cost.urethra_d30_gy.unwrap().abs() > 1e-3);
    assert!(score.costs[5].target_d90_gy.abs() < 1e-9);
}

#[test]
fn a_lost_seed_counts_in_the_planned_dose_only() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let mut pairs = pairs(&[]);
    let lost = vec![pairs.remove(7).planned];
    let all = score(&[], &anatomy, &kernel, &[]);
    let less = Score::of(Implant {
        pairs,
        lost,
        title: String::new(),
        source: String::new(),
        ..score(&[], &anatomy, &kernel, &[]).implant
    });
    let less = less.unwrap();
    let d90 = |v: &Verdict| Metric::parse("D90").unwrap().of(&v.dvhs[0], 145.0).main().unwrap();
    assert!((d90(&less.planned) - d90(&all.planned)).abs() < 1e-6);
    assert!(d90(&less.delivered) < d90(&all.delivered) - 0.5);
    assert_eq!(to_json(&less)["seeds_lost"], 1);
}

/// Guards against a D90 of 137.6 Gy on the page next to 139.0 Gy of all seeds in the window.
#[test]
fn a_seed_without_a_plan_counts_in_the_delivered_dose() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let whole = score(&[], &anatomy, &kernel, &[]);
    let mut implant = score(&[], &anatomy, &kernel, &[]).implant;
    implant.unplanned.push(implant.pairs.remove(7).delivered);
    let other = Score::of(implant).unwrap();
    let d90 = |v: &Verdict| Metric::parse("D90").unwrap().of(&v.dvhs[0], 145.0).main().unwrap();
    assert!((d90(&other.delivered) - d90(&whole.delivered)).abs() < 1e-6);
    assert_eq!((other.seeds(), whole.seeds()), (36, 36));
    assert!(
        page::page(&other)
            .unwrap()
            .contains("1 of the 36 seeds has no planned place")
    );
}

#[test]
fn the_page_is_self_contained_and_escapes_its_input() {
    let (anatomy, kernel) = (anatomy(), kernel());
    let mut record = TickRecord::zeroed();
    let records: Vec<TickRecord> = (0..5000_u64)
        .map(|i| {
            record.due_ns = i * 1_000_000;
            record.force_on_hand_n[2] = (i as f64 * 1e-3).sin();
            record
        })
        .collect();
    let score = score(&[4, 20], &anatomy, &kernel, &records);
    let page = super::page::page(&score).unwrap();
    assert_eq!(page.matches("<svg").count(), 3);
    // Guards against "−0.0" for no change, and "-0.00" for -0.001 Gy.
    for zero in ["-0.0<", "-0.00<", "-0.000<", "+0.0<", "+0.00<", "+0.000<", "−"] {
        assert!(!page.contains(zero), "{zero}");
    }
    assert!(page.contains("a &lt;test&gt;") && !page.contains("<test>"));
    for foreign in ["http://", "https://", "src=", "NaN"] {
        let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains(foreign), "{foreign}");
    }
    let json = to_json(&score);
    assert_eq!(json["seeds"].as_array().map(Vec::len), Some(36));
    assert!((json["seeds"][4]["error_along_mm"].as_f64().unwrap() - 6.0).abs() < 1e-9);
}

/// Guards against a legend with an outline "to be spared" in a scene without one.
#[test]
fn the_legend_names_only_what_is_drawn() {
    let (mut anatomy, kernel) = (anatomy(), kernel());
    let page_of = |anatomy: &Anatomy| super::page::page(&score(&[4], anatomy, &kernel, &[])).unwrap();
    assert!(page_of(&anatomy).contains("to be spared"));
    anatomy.spared.clear();
    let page = page_of(&anatomy);
    assert!(page.contains("target, cut through its middle") && !page.contains("to be spared"));
}
