//! Compensation at least halves the mean seed error, on plans and glands that it was not tuned on; and the page that
//! says so.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Source};
use stylet_implant::plan::compensate::summary_m;
use stylet_implant::plan::first;
use stylet_implant::plan::optimise::Objectives;
use stylet_implant::plan::{Anatomy, ImplantPlan, Limits, Needle, Template, compensate};
use stylet_implant::workflow::{Pace, plan_with_seeds};
use stylet_sim::scene::Labels;
use stylet_tests::rehearsal::Theatre;

/// The default of the scripted hand, and the mean of the fastest in the clinic (design, section 9).
const SLOW: f64 = 0.05;
const FAST: f64 = 0.123;

/// One gland and its needles, before and after.
struct Row {
    gland: &'static str,
    needles: usize,
    seeds: usize,
    /// Needles that cannot be inserted as planned.
    not_as_planned: usize,
    /// Needles without a solution.
    not_possible: usize,
    insert_m_per_s: f64,
    /// Mean and worst error, before and after.
    errors_m: [[f64; 2]; 2],
    rehearsals: usize,
    /// Those due to edges.
    for_edges: usize,
    /// Seeds still on an edge, and the largest motion of one of them.
    sensitive: (usize, f64),
    seconds: f64,
}

fn first_plan(theatre: &Theatre) -> ImplantPlan {
    let source = Source::known("6711").expect("it comes with the program");
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let anatomy = Anatomy::of(&theatre.scene).expect("a closed target");
    let template = Template::before(&theatre.scene.header);
    let proceed = |_| std::ops::ControlFlow::Continue(());
    let objectives = Objectives::new(&source, 145.0);
    let mut found = first::proposals(template, &anatomy, &kernel, &source, &objectives, 1, proceed).expect("a plan");
    let plan = found.remove(0).found.plan;
    let found = stylet_implant::plan::check::problems(&plan, &anatomy);
    assert!(found.is_empty(), "{found:?}");
    plan
}

/// Returns the default needle of a scene as a needle of a plan.
fn default_needle(theatre: &Theatre, seeds: usize) -> Needle {
    let plan = plan_with_seeds(&theatre.scene.header, seeds);
    let mut needle = first_plan_needle(plan.entry_m, plan.direction);
    for place in &plan.seeds_m {
        let along_m = needle.along_m(*place);
        needle.seeds.push(stylet_implant::plan::NeedleSeed {
            along_m,
            strength_u: 0.5,
        });
    }
    needle.in_order()
}

fn first_plan_needle(entry_m: [f64; 3], direction: [f64; 3]) -> Needle {
    Needle {
        hole: None,
        entry_m,
        direction,
        depth_m: 0.0,
        retract_to_m: 0.0,
        loading: stylet_implant::plan::Loading::Loose,
        seeds: Vec::new(),
    }
}

/// An ellipsoid with a hollow on one side, 1 mm elements, not aligned with any axis.
fn ellipsoid() -> Labels {
    let dims = [80, 70, 90];
    let half = [21.0, 16.0, 24.0];
    let cell = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let off = [0, 1, 2].map(|a| at[a] as f64 + 0.5 - dims[a] as f64 / 2.0);
        let inside = (0..3).map(|a| (off[a] / half[a]).powi(2)).sum::<f64>() <= 1.0;
        let hollow = (off[0] - 20.0).powi(2) + (off[1] - 12.0).powi(2) + (off[2] - 15.0).powi(2) < 144.0;
        u8::from(inside && !hollow)
    };
    Labels {
        dims,
        spacing_m: 1e-3,
        cells: (0..dims.iter().product()).map(cell).collect(),
        structures: Vec::new(),
    }
}

fn row(gland: &'static str, mut theatre: Theatre, needles: &[Needle], insert_m_per_s: f64) -> Row {
    let begun = Instant::now();
    let limits = Limits {
        reach_m: 0.25,
        ..Limits::default()
    };
    let pace = Pace {
        insert_m_per_s,
        ..Pace::default()
    };
    let mut done = Vec::new();
    for needle in needles {
        let mm = |e: Vec<f64>| {
            e.iter()
                .map(|m| format!("{:.2}", m * 1e3))
                .collect::<Vec<_>>()
                .join(" ")
        };
        let hole = needle.hole.map_or_else(|| "-".to_owned(), |h| h.to_string());
        let along = needle.seeds.iter().map(|s| s.along_m).collect();
        match compensate(needle, &pace, &limits, &mut theatre) {
            Ok(c) => {
                println!(
                    "{gland} {hole} at {}: before {}, after {} mm, {} rehearsals, {} of them for edges; {:?}",
                    mm(along),
                    mm(c.errors_before_m().collect()),
                    mm(c.errors_after_m().collect()),
                    c.rehearsals,
                    c.for_edges,
                    c.sensitive
                );
                done.push(c);
            }
            Err(why) => println!("{gland} {hole} at {}: {why}", mm(along)),
        }
    }
    Row {
        gland,
        insert_m_per_s,
        needles: needles.len(),
        seeds: done.iter().map(|c| c.after_m.len()).sum(),
        not_as_planned: done.iter().filter(|c| c.before_m.is_none()).count(),
        not_possible: needles.len() - done.len(),
        errors_m: summary_m(&done),
        rehearsals: theatre.rehearsals,
        for_edges: done.iter().map(|c| c.for_edges).sum(),
        sensitive: {
            let moves = || done.iter().flat_map(|c| &c.sensitive);
            let largest_m = moves().map(|s| s.moves_m.unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
            (moves().count(), largest_m)
        },
        seconds: begun.elapsed().as_secs_f64(),
    }
}

const HEAD: &str = "\
# Compensation

Errors of seeds at rest relative to the plan, dropped as planned and dropped where compensation says, from rehearsals of the core.
The test that checks these figures writes this page: `make compensation`; the everyday one tries every third needle of a plan.
Nothing in `plan/compensate.rs` was fitted to any of these glands: its limits come from tissues of known motion in its unit tests.

Plans are the automatic ones (I-125 6711, 145 Gy) unless stated otherwise. Strands keep their pitch, so
one shift applies to all their seeds.

- *Not as planned*: needles whose last drop, if dropped as planned, would leave the tip outside the tissue, which has moved ahead of
  it. They count only after compensation.
- *Not possible*: needles that no way was found for to leave their last seeds inside the tissue.
- *For edges*: rehearsals, of all, that looked for edges beside the drops or for drops clear of them (docs/plan.md, Edges). One for each needle finds that there is none.
- *Sensitive*: seeds on an edge even so: how many, and how far one of them rests from where it was rehearsed, at most, if the tip stops up to 0.3 mm deeper or shallower.

A strand does not stretch (docs/physics.md, Strands), so one shift can bring all its seeds to their places.

| gland | speed in | needles | not as planned | not possible | seeds | mean before | mean after | worst before | worst after | rehearsals | for edges | sensitive | time |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|
";

fn page() -> PathBuf {
    stylet_test_kit::repository("docs/compensation.md")
}

fn text(rows: &[Row]) -> String {
    let mut text = HEAD.to_owned();
    for r in rows {
        let [[mean, worst], [mean_after, worst_after]] = r.errors_m.map(|e| e.map(|m| m * 1e3));
        let _ = writeln!(
            text,
            "| {} | {:.0} mm/s | {} | {} | {} | {} | {mean:.2} mm | {mean_after:.2} mm | {worst:.2} mm | {worst_after:.2} mm | {} | {} | {} | {:.0} s |",
            r.gland,
            r.insert_m_per_s * 1e3,
            r.needles,
            r.not_as_planned,
            r.not_possible,
            r.seeds,
            r.rehearsals,
            r.for_edges,
            match r.sensitive {
                (0, _) => "0".to_owned(),
                (count, largest_m) => format!("{count}, {:.1} mm", largest_m * 1e3),
            },
            r.seconds
        );
    }
    text
}

#[test]
fn compensation_halves_the_mean_error_on_every_gland() {
    check(&compensated(3));
}

#[test]
#[ignore = "three minutes: every needle of every plan"]
fn compensation_of_every_needle_halves_it_and_the_page_says_so() {
    let rows = compensated(1);
    let text = text(&rows);
    println!("{text}");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(page(), &text).expect("docs can be written");
    }
    check(&rows);
}

/// Compensates every `every`-th needle of automatic plans.
fn compensated(every: usize) -> Vec<Row> {
    let some = |plan: &ImplantPlan| plan.needles.iter().step_by(every).cloned().collect::<Vec<Needle>>();
    let mut rows = Vec::new();
    let paper = Theatre::builtin("paper");
    let needle = default_needle(&paper, 5);
    rows.push(row("`paper`, five seeds through the middle", paper, &[needle], SLOW));
    for speed in [SLOW, FAST] {
        let paper = Theatre::builtin("paper");
        let plan = first_plan(&paper);
        rows.push(row("`paper`", paper, &some(&plan), speed));
    }
    let pelvis = Theatre::builtin("pelvis");
    let plan = first_plan(&pelvis);
    rows.push(row("`pelvis`", pelvis, &some(&plan), FAST));
    let full = Theatre::builtin("full");
    let needle = default_needle(&full, 4);
    rows.push(row(
        "`full`, four seeds through the middle, a longer needle",
        full,
        &[needle],
        FAST,
    ));
    let other = Theatre::of_labels("hollow ellipsoid", &ellipsoid());
    let plan = first_plan(&other);
    rows.push(row("labels: ellipsoid with a hollow, 1 mm", other, &some(&plan), FAST));
    rows
}

fn check(rows: &[Row]) {
    let kept = std::fs::read_to_string(page()).expect("docs/compensation.md is there");
    for r in rows.iter().filter(|r| r.insert_m_per_s == FAST) {
        assert!(
            r.not_possible * 8 <= r.needles,
            "{}: {} needles",
            r.gland,
            r.not_possible
        );
    }
    for r in rows {
        let [[before, _], [after, _]] = r.errors_m;
        assert!(after < 0.5 * before, "{}: {before} m before, {after} m after", r.gland);
        assert!(
            kept.contains(r.gland),
            "docs/compensation.md lacks {}: run the command at its head",
            r.gland
        );
    }
}
