//! The automatic plan of the built-in pelvis keeps the limits that the peripheral pattern does not keep.

use std::ops::ControlFlow;
use std::time::Instant;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Source};
use stylet_implant::plan::automatic::{self, Aims};
use stylet_implant::plan::optimise::{self, Engine, Method, Objectives};
use stylet_implant::plan::{Anatomy, Needle, Template, check};
use stylet_tests::rehearsal::Theatre;

/// V150 was 84.5 % and D10 of the urethra 291 Gy: the pattern looked at the coverage of the target alone.
#[test]
fn the_automatic_plan_of_the_pelvis_keeps_its_limits() {
    let theatre = Theatre::builtin("pelvis");
    let anatomy = Anatomy::of(&theatre.scene).expect("a closed target");
    let template = Template::before(&theatre.scene.header);
    assert_eq!(anatomy.bone.len(), 1, "the pubic arch");
    let source = Source::known("6711").expect("comes with the program");
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let engine = Engine::new(&kernel, optimise::bodies(&anatomy));
    let proceed = |_| ControlFlow::Continue(());
    let before = automatic::plan(template, &anatomy, &kernel, "6711", &Aims::new(145.0), proceed).expect("a plan");
    let figures = |plan: &stylet_implant::plan::ImplantPlan| engine.histograms(&plan.seeds()).figures(1.0, 145.0);
    let crosses = |needle: &&Needle| {
        let bone = &anatomy.bone[0];
        !bone
            .pieces_m(needle.entry_m, needle.direction, needle.depth_m)
            .is_empty()
    };
    println!(
        "peripheral: {} needles, {} of them through bone, {} seeds, {:?}",
        before.needles.len(),
        before.needles.iter().filter(crosses).count(),
        before.seed_count(),
        figures(&before)
    );
    let objectives = Objectives::new(&source, 145.0);
    for method in [Method::GreedyExchange, Method::Annealing] {
        let begun = Instant::now();
        let found = optimise::plan(template, &anatomy, &kernel, "6711", &objectives, method, proceed).expect("a plan");
        let seconds = begun.elapsed().as_secs_f64();
        let (begun, seeds) = (Instant::now(), found.plan.seeds());
        let dose_at = |point_m: [f64; 3]| seeds.iter().map(|s| kernel.exact_at_gy(s, point_m)).sum::<f64>();
        let sum: f64 = engine.points_m().map(dose_at).sum();
        let loop_s = begun.elapsed().as_secs_f64();
        println!(
            "{method:?}: {} needles, {} seeds of {:.2} U, {} holes behind bone, {seconds:.1} s, {:.2} times the straightforward loop of {loop_s:.1} s; robust {:.3}, cost {:.4}\n  {:?}\n  samples {:?}",
            found.plan.needles.len(),
            found.plan.seed_count(),
            seeds[0].strength_u,
            found.behind_bone,
            seconds / loop_s,
            found.robust,
            found.cost,
            found.figures,
            found.sampled
        );
        assert!(sum > 0.0);
        if method == Method::default() {
            let wrong = check::problems(&found.plan, &anatomy);
            assert!(wrong.is_empty(), "{wrong:?}");
            assert_eq!(found.figures.broken(), Vec::<String>::new());
            assert!(found.plan.needles.len() <= 25);
        }
    }
}
