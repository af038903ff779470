//! Plans of synthetic glands keep their limits, cancel, and are the same each time.

use super::glands::{GLANDS, Gland, TEMPLATE};
use super::*;
use crate::plan::automatic::{self, Aims};
use crate::plan::check::problems;
use crate::plan::dose::decay::Interval;
use std::time::Instant;

fn iodine() -> (Source, DoseKernel) {
    let source = Source::known("6711").unwrap();
    let kernel = DoseKernel::new(&source, Interval::ALL);
    (source, kernel)
}

fn find(anatomy: &Anatomy, method: Method) -> Proposal {
    let (source, kernel) = iodine();
    let objectives = Objectives::new(&source, 145.0);
    let go_on = |_| ControlFlow::Continue(());
    plan(TEMPLATE, anatomy, &kernel, &source.model, &objectives, method, go_on).unwrap()
}

fn row(gland: &str, method: &str, plan: &ImplantPlan, figures: &Figures, seconds: f64) {
    let strength_u = plan.needles[0].seeds[0].strength_u;
    let of = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.1}"));
    println!(
        "| {gland} | {method} | {:.1} | {:.1} | {:.1} | {} | {} | {} | {} | {} | {strength_u:.2} | {seconds:.2} | {} |",
        figures.v100,
        figures.d90,
        figures.v150,
        of(figures.urethra_d10),
        of(figures.urethra_d30),
        of(figures.rectum_d2cc),
        plan.needles.len(),
        plan.seed_count(),
        if figures.beyond() == 0.0 { "yes" } else { "no" }
    );
}

/// Seconds of the straightforward loop over all points of the full engine.
fn straightforward_s(engine: &Engine, kernel: &DoseKernel, plan: &ImplantPlan) -> f64 {
    let (begun, seeds) = (Instant::now(), plan.seeds());
    let dose_at = |point_m: [f64; 3]| seeds.iter().map(|s| kernel.exact_at_gy(s, point_m)).sum::<f64>();
    let sum: f64 = engine.points_m().map(dose_at).sum();
    assert!(sum > 0.0);
    begun.elapsed().as_secs_f64()
}

fn study(glands: impl Iterator<Item = &'static Gland>) {
    let (source, kernel) = iodine();
    println!("| gland | method | V100 | D90 | V150 | urethra D10 | D30 | rectum D2cc | needles | seeds | U | s | limits kept |");
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for gland in glands {
        let anatomy = gland.anatomy();
        let engine = Engine::new(&kernel, bodies(&anatomy));
        let aside = if gland.is_kept_aside { ", aside" } else { "" };
        let arch = if gland.arch_mm.is_some() { ", arch" } else { "" };
        let name = format!("{} ({} cc{arch}{aside})", gland.name, gland.cc);
        let begun = Instant::now();
        let go_on = |_| ControlFlow::Continue(());
        let today = automatic::plan(TEMPLATE, &anatomy, &kernel, &source.model, &Aims::new(145.0), go_on).unwrap();
        let seconds = begun.elapsed().as_secs_f64();
        let figures = engine.histograms(&today.seeds()).figures(1.0, 145.0).unwrap();
        row(&name, "peripheral", &today, &figures, seconds);
        for (method, words) in [(Method::GreedyExchange, "exchange"), (Method::Annealing, "annealing")] {
            let begun = Instant::now();
            let found = find(&anatomy, method);
            let seconds = begun.elapsed().as_secs_f64();
            row(&name, words, &found.plan, &found.figures, seconds);
            let loop_s = straightforward_s(&engine, &kernel, &found.plan);
            println!(
                "  {:.2} times the straightforward loop ({loop_s:.2} s); {} holes behind bone; samples V100 {:.1} V150 {:.1} D10 {:.1} D2cc {:.1}; {:?}",
                seconds / loop_s,
                found.behind_bone,
                found.sampled.v100,
                found.sampled.v150,
                found.sampled.urethra_d10.unwrap_or(0.0),
                found.sampled.rectum_d2cc.unwrap_or(0.0),
                found.figures.broken()
            );
            let wrong = problems(&found.plan, &anatomy);
            assert!(wrong.is_empty(), "{name}: {wrong:?}");
            assert!(found.plan.needles.len() <= 25);
        }
    }
}

#[test]
#[ignore = "minutes; the command is in docs/plan.md"]
fn glands_that_the_search_was_tuned_on() {
    study(GLANDS.iter().filter(|g| !g.is_kept_aside));
}

#[test]
#[ignore = "minutes; the command is in docs/plan.md"]
fn glands_that_were_kept_aside() {
    study(GLANDS.iter().filter(|g| g.is_kept_aside));
}
