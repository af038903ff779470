//! A plan of many needles in the window: edited by label and by key, saved in files, stepped
//! through needle by needle.

use crate::driven::{Driven, is_at_rest, keep_for_docs, misplaced};
use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use host_ui::app::App;
use host_ui::planner::NeedleState;
use std::path::Path;
use std::time::{Duration, Instant};
use stylet_implant::plan::{Hole, ImplantPlan, Loading, Row, Template, exchange};
use stylet_shm_schema::SceneHeader;
use stylet_tests::scratch;

pub const SMALL: [f32; 2] = [1280.0, 800.0];
const LARGE: [f32; 2] = [1920.0, 1080.0];
const PATH: &str = "Plan file: .toml, .csv or .dcm";

pub fn open(size: [f32; 2]) -> Driven {
    let mut driven = Driven::open_plain(size);
    driven.until("the anatomy", |app| app.planner().planning().outlines.is_some());
    driven.window.run_steps(2);
    driven
}

fn plan(driven: &Driven) -> ImplantPlan {
    driven.window.state().planner().plan().expect("a plan").clone()
}

fn seeds(app: &App) -> u32 {
    app.link().snapshot().map_or(0, |s| s.header.seed_count)
}

pub fn header(driven: &Driven) -> SceneHeader {
    driven.window.state().link().scene().expect("live").header
}

/// Returns needles through holes, `count` seeds each, about the middle of the target.
pub fn plan_through(scene: &SceneHeader, holes: &[&str], count: usize) -> ImplantPlan {
    let template = Template::before(scene);
    let (source, prescription_gy) = exchange::usual().expect("known");
    let mut plan = ImplantPlan {
        template,
        source: source.model,
        prescription_gy,
        needles: Vec::new(),
    };
    let middle_m: f64 = (0..3)
        .map(|a| {
            let middle = (scene.target_lower_m[a] + scene.target_upper_m[a]) / 2.0;
            (middle - template.middle_m[a]) * template.inwards[a]
        })
        .sum();
    for (number, hole) in holes.iter().enumerate() {
        let row = Row {
            count,
            deepest_m: middle_m + (count - 1) as f64 * 4e-3,
            pitch_m: 8e-3,
            stranded: number % 2 == 0,
            strength_u: 0.45,
        };
        let added = plan
            .with_needle(hole.parse().expect("a hole"), row.deepest_m)
            .expect("free");
        plan = added.with_row(number, row).expect("a row");
    }
    plan
}

fn import(driven: &mut Driven, path: &Path) {
    driven.window.get_by_label(PATH).focus();
    driven.window.run_steps(1);
    driven
        .window
        .get_by_label(PATH)
        .type_text(path.to_str().expect("words"));
    driven.window.run_steps(2);
    driven.click("Import");
    driven.until("the file", |app| !app.planner().is_busy());
    driven.window.run_steps(3);
}

pub fn put(driven: &mut Driven, name: &str, plan: &ImplantPlan) {
    let path = scratch(name).join("plan.toml");
    let frames = driven
        .window
        .state()
        .planner()
        .planning()
        .outlines
        .expect("known")
        .frames;
    exchange::write(&path, plan, &frames, None).expect("written");
    import(driven, &path);
    assert_eq!(
        driven.window.state().planner().plan().map(|p| p.needles.len()),
        Some(plan.needles.len())
    );
}

fn hole(name: &str) -> Hole {
    name.parse().expect("a hole")
}

fn until_checked(driven: &mut Driven) {
    driven.window.run_steps(3);
    driven.until("the checks", |app| {
        app.planner().planning().implant.is_some_and(|i| i.problems.is_some())
    });
    for _ in 0..50 {
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn adding_moving_and_removing_needles_can_be_undone() {
    let mut driven = open(SMALL);
    driven.click("Empty plan");
    driven.click("G7: no needle");
    driven.press(Key::Enter);
    assert_eq!(plan(&driven).needles[0].hole, Some(hole("G7")));
    assert!(!plan(&driven).needles[0].seeds.is_empty());
    until_checked(&mut driven);
    assert!(problems_of_needles(&driven).is_empty());
    // One needle cannot cover the target, which is a problem of the plan.
    driven.wait_for_label("target V100 is");
    assert!(driven.window.query_by_label("The plan has no problems.").is_none());
    // Two to the patient's left, one up.
    for key in [Key::ArrowRight, Key::ArrowRight, Key::ArrowUp, Key::Enter] {
        driven.press(key);
    }
    driven.until("the second needle", |app| {
        app.planner().plan().is_some_and(|plan| plan.needles.len() == 2)
    });
    assert_eq!(plan(&driven).needles[1].hole, Some(hole("I8")));
    driven.window.key_press_modifiers(Modifiers::SHIFT, Key::ArrowDown);
    driven.window.run_steps(2);
    assert_eq!(plan(&driven).needles[1].hole, Some(hole("I7")));
    driven.click("anterior");
    assert_eq!(plan(&driven).needles[1].hole, Some(hole("I8")));
    assert_ne!(plan(&driven).needles[1].loading, Loading::Loose);
    driven.click("Strand");
    assert_eq!(plan(&driven).needles[1].loading, Loading::Loose);
    let all = plan(&driven);
    driven.click("Remove");
    assert_eq!(plan(&driven).needles.len(), 1);
    let one = plan(&driven);
    driven.window.key_press_modifiers(Modifiers::CTRL, Key::Z);
    driven.window.run_steps(2);
    assert_eq!(plan(&driven), all, "taken back");
    driven
        .window
        .key_press_modifiers(Modifiers::CTRL | Modifiers::SHIFT, Key::Z);
    driven.window.run_steps(2);
    assert_eq!(plan(&driven), one, "put back");
    // A hole outside the target reports it and adds nothing.
    driven.click("A1: no needle");
    driven.press(Key::Enter);
    driven.window.get_by_label_contains("A1 would miss the target");
    assert_eq!(plan(&driven), one);
}

#[test]
fn a_plan_survives_a_file_round_trip() {
    let mut driven = open(SMALL);
    let folder = scratch("ui-plan-files");
    let planned = plan_through(&header(&driven), &["F6", "G8", "H6"], 3);
    put(&mut driven, "ui-plan-put", &planned);
    let first = plan(&driven);
    for ending in ["toml", "csv", "dcm"] {
        let path = folder.join(format!("kept.{ending}"));
        driven.window.get_by_label(PATH).focus();
        driven.window.key_press_modifiers(Modifiers::COMMAND, Key::A);
        driven.window.run_steps(1);
        driven
            .window
            .get_by_label(PATH)
            .type_text(path.to_str().expect("words"));
        driven.window.run_steps(2);
        driven.click("Save");
        driven.until("the file", |app| !app.planner().is_busy());
        driven.window.run_steps(2);
        driven.window.get_by_label_contains("Plan saved as");
        driven.click("Discard the plan");
        driven.click("Import");
        driven.until("the plan", |app| app.planner().plan().is_some());
        driven.window.run_steps(2);
        let back = plan(&driven);
        assert_eq!(back.needles.len(), 3, "{ending}");
        for (a, b) in back.seeds().iter().zip(first.seeds()) {
            let off: f64 = (0..3).map(|i| (a.position_m[i] - b.position_m[i]).powi(2)).sum();
            // CSV has nanometres.
            assert!(off.sqrt() < 2e-9, "{ending}: {off}");
        }
    }
    let wrong = folder.join("wrong.toml");
    std::fs::write(&wrong, "format = 3").expect("written");
    let before = plan(&driven);
    driven.window.get_by_label(PATH).focus();
    driven.window.key_press_modifiers(Modifiers::COMMAND, Key::A);
    driven.window.run_steps(1);
    import(&mut driven, &wrong);
    driven.window.get_by_label_contains("wrong.toml: it is not a plan");
    assert_eq!(plan(&driven), before);
}

/// Inserts all needles with only the key for the next action.
#[test]
fn needles_go_in_one_after_the_other_by_one_key() {
    let mut driven = open(SMALL);
    let planned = plan_through(&header(&driven), &["F7", "H7"], 2);
    put(&mut driven, "ui-plan-run", &planned);
    driven.click("Engage force");
    let start = Instant::now();
    let done = |app: &App| app.planner().progress().done() == 2;
    while !done(driven.window.state()) {
        assert!(start.elapsed() < Duration::from_secs(180), "the procedure does not end");
        driven.press(Key::Enter);
        for _ in 0..40 {
            driven.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
        driven.until("rest", is_at_rest);
        if driven.window.state().planner().progress().begun() == 1 && seeds(driven.window.state()) == 2 {
            driven.picture("plan-first-needle");
        }
    }
    assert_eq!(seeds(driven.window.state()), 4);
    let progress = driven.window.state().planner().progress().clone();
    assert_eq!([0, 1].map(|n| progress.seeds_of(n, 4)), [0..2, 2..4]);
    assert_eq!(progress.state(1), NeedleState::Done);
    driven.window.run_steps(5);
    driven.window.get_by_label("2.2");
    driven.picture("plan-debrief");
    // The scripted hand does the same, from the beginning.
    driven.click("Run all 2 needles");
    driven.press(Key::Y);
    driven.until("the first needle", |app| app.planner().progress().begun() == 1);
    wait_long(&mut driven, "the scripted hand", done);
    driven.wait_for_label("All 2 needles are done.");
    assert_eq!(seeds(driven.window.state()), 4);
    let progress = driven.window.state().planner().progress().clone();
    assert_eq!([0, 1].map(|n| progress.seeds_of(n, 4)), [0..2, 2..4]);
}

/// Guards against a stopped script, or one in a reopened window, that removed the seeds and
/// restarted at its first needle.
#[test]
fn a_stopped_script_continues_in_this_window_and_the_next() {
    let mut driven = open(SMALL);
    let planned = plan_through(&header(&driven), &["F7", "H7"], 2);
    put(&mut driven, "ui-plan-go-on", &planned);
    driven.click("Run all 2 needles");
    wait_long(&mut driven, "the first seed", |app| seeds(app) == 1);
    driven.click("Stop");
    driven.wait_for_label("Continue at needle 1 of 2");
    driven.window.get_by_label("Start over");
    driven.click("Continue at needle 1 of 2");
    wait_long(&mut driven, "the third seed", |app| seeds(app) == 3);
    driven.window.get_by_label("Needle 2 of 2");
    // Another window finds the plan of the first, and inspects the tissue.
    driven.reopen(SMALL);
    driven.until("the plan", |app| {
        app.planner().plan().is_some_and(|plan| plan.needles.len() == 2)
    });
    driven.wait_for_label("Continue at needle 2 of 2");
    let found = driven.window.state().planner().progress();
    assert_eq!(
        found.state(0),
        NeedleState::Done,
        "the list said planned until the script went on"
    );
    assert_eq!(
        (found.state(1), found.seeds_of(1, 3)),
        (NeedleState::Inserted, 2..3),
        "the step of the drops said done although a seed was left"
    );
    driven.click("Continue at needle 2 of 2");
    wait_long(&mut driven, "all needles", |app| app.planner().progress().done() == 2);
    driven.wait_for_label("All 2 needles are done.");
    let placed = driven.window.state().link().snapshot().expect("a snapshot").header;
    assert_eq!(placed.seed_count, 4);
    let dropped_at_m = placed.seeds[..4]
        .iter()
        .map(|seed| seed.dropped_at_m)
        .collect::<Vec<_>>();
    for (n, one) in dropped_at_m.iter().enumerate() {
        let apart = |other: &[f64; 3]| (0..3).map(|a| (one[a] - other[a]).powi(2)).sum::<f64>().sqrt();
        let nearest_m = dropped_at_m[..n].iter().map(apart).fold(f64::MAX, f64::min);
        assert!(nearest_m > 3e-3, "seed {n} lies {nearest_m} m from another");
    }
    let progress = driven.window.state().planner().progress().clone();
    assert_eq!([0, 1].map(|n| progress.seeds_of(n, 4)), [0..2, 2..4]);
}

/// Like [`Driven::until`], for steps that take minutes on a busy machine.
fn wait_long(driven: &mut Driven, what: &str, ready: impl Fn(&App) -> bool) {
    let start = Instant::now();
    while !ready(driven.window.state()) {
        assert!(start.elapsed() < Duration::from_secs(180), "waited in vain for {what}");
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns the problems that the checks of needles and seeds found.
fn problems_of_needles(driven: &Driven) -> Vec<String> {
    let implant = driven.window.state().planner().planning().implant;
    let found = implant.and_then(|i| i.problems.clone()).unwrap_or_default();
    found.iter().map(ToString::to_string).collect()
}

#[test]
fn an_automatic_plan_covers_the_target_without_problems() {
    let mut driven = open(SMALL);
    driven.click("Automatic plan");
    wait_long(&mut driven, "the plan", |app| app.planner().plan().is_some());
    until_checked(&mut driven);
    assert!(problems_of_needles(&driven).is_empty());
    let planned = plan(&driven);
    assert!(planned.needles.iter().all(|n| n.hole.is_some() && !n.seeds.is_empty()));
    let prescription = format!("{} seeds of I-125 6711, 145 Gy", planned.seed_count());
    driven.wait_for_label(&prescription);
    // Guards against a violated dose limit next to "The plan has no problems.".
    let is_broken = driven.window.query_all_by_label_contains(" not met").count() > 0;
    let is_praised = driven.window.query_by_label("The plan has no problems.").is_some();
    assert_ne!(is_broken, is_praised);
    keep_for_docs(&driven.picture("plan-automatic"), "plan");
    // D90 and V100 meet their limits.
    assert!(driven.window.query_all_by_label("met").count() >= 2);
    let problems = misplaced(&driven.window);
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn compensation_reports_progress_and_can_be_cancelled() {
    let mut driven = open(SMALL);
    let planned = plan_through(&header(&driven), &["F7", "H7", "G8"], 1);
    put(&mut driven, "ui-plan-compensate", &planned);
    driven.click("Compensate");
    driven.window.run_steps(3);
    driven.until("the first needle", |app| {
        app.planner()
            .planning()
            .implant
            .is_some_and(|i| i.rest_errors_m.iter().flatten().count() == 1)
    });
    driven.window.run_steps(2);
    driven.window.get_by_label_contains("1 of 3 needles compensated");
    driven.window.get_by_label_contains("2 of 3; less than a minute left");
    driven.click("Cancel");
    driven.until("the end of the work", |app| !app.planner().is_busy());
    driven.picture("plan-compensated-in-part");
    let task = driven.window.state().planner().task(0).expect("a needle");
    assert_ne!(task.drops.along_m[0], planned.needles[0].depth_m, "the drop was moved");
    // An edit of the needle invalidates its rehearsal.
    driven.window.get_by_label_contains("F7: needle 1,").click();
    driven.window.run_steps(2);
    driven.click("anterior");
    let task = driven.window.state().planner().task(0).expect("a needle");
    assert_eq!(task.drops.along_m[0], planned.needles[0].depth_m);
}

/// Returns holes about the middle, and one at the edge, where seeds lie outside the target.
fn twenty() -> Vec<String> {
    let columns = ["D", "E", "F", "G", "H", "I", "J", "L"];
    let rows: [(u8, &[usize]); 5] = [
        (5, &[1, 2, 4, 7]),
        (6, &[0, 2, 4, 6]),
        (7, &[0, 1, 5, 6]),
        (8, &[0, 2, 4, 6]),
        (9, &[1, 2, 4, 5]),
    ];
    let holes = rows
        .iter()
        .flat_map(|(row, at)| at.iter().map(move |c| format!("{}{row}", columns[*c])));
    holes.collect()
}

#[test]
fn a_plan_of_twenty_needles_matches_its_picture() {
    for (size, light, name) in [(SMALL, false, "plan_dark_small"), (LARGE, true, "plan_light_large")] {
        let mut driven = open(size);
        if light {
            driven.press(Key::T);
        }
        let holes = twenty();
        let holes: Vec<&str> = holes.iter().map(String::as_str).collect();
        let planned = plan_through(&header(&driven), &holes, 5);
        put(&mut driven, name, &planned);
        until_checked(&mut driven);
        let start = Instant::now();
        while driven.window.query_by_label_contains("100 seeds of I-125").is_none() {
            assert!(start.elapsed() < Duration::from_secs(60), "no dose came");
            driven.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
        // The path differs from one machine to the next.
        driven.window.get_by_label(PATH).focus();
        driven.window.key_press_modifiers(Modifiers::COMMAND, Key::A);
        driven.window.key_press(Key::Delete);
        driven.window.run_steps(2);
        driven.window.key_press(Key::Escape);
        driven.window.get_by_label_contains("F6: needle").click();
        driven.window.run_steps(4);
        let problems = misplaced(&driven.window);
        driven.picture(name);
        assert!(problems.is_empty(), "{name}:\n{}", problems.join("\n"));
        driven.compare_plan(name);
    }
}

/// Run with `cargo test --profile quick -p stylet-tests-window plan -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn cost_of_a_frame_with_a_hundred_seeds() {
    let mut driven = open(SMALL);
    measure(&mut driven, "no plan", 100);
    let holes = twenty();
    let holes: Vec<&str> = holes.iter().map(String::as_str).collect();
    let planned = plan_through(&header(&driven), &holes, 5);
    put(&mut driven, "plan-cost", &planned);
    until_checked(&mut driven);
    measure(&mut driven, "100 seeds, editor open", 200);
    driven.window.get_by_label_contains("F6: needle").click();
    driven.window.run_steps(3);
    let keys = [Key::ArrowUp, Key::ArrowDown];
    pressed(&mut driven, "edits, each with its dose", keys, Modifiers::SHIFT, 300);
    pressed(&mut driven, "edits in a row", keys, Modifiers::SHIFT, 12);
    driven.press(Key::Escape);
    driven.press(Key::I);
    let chosen = plan(&driven).needles[5].hole.expect("a hole");
    pressed(
        &mut driven,
        "3D view turned, no isodose",
        [Key::Num1, Key::Num2],
        Modifiers::NONE,
        12,
    );
    let chosen = format!("{chosen}: needle 6");
    // The template as a whole reports its hole too, before the hole does.
    let holes = driven.window.get_all_by_label_contains(&chosen);
    holes.last().expect("the hole").click();
    driven.window.run_steps(3);
    pressed(&mut driven, "edits in a row, no isodose", keys, Modifiers::SHIFT, 12);
}

/// Measures frames in which one key or the other is pressed.
fn pressed(driven: &mut Driven, what: &str, keys: [Key; 2], modifiers: Modifiers, pause_ms: u64) {
    let (mut with, mut after) = (Vec::new(), Vec::new());
    for number in 0..40 {
        driven.window.key_press_modifiers(modifiers, keys[number % 2]);
        driven.window.run_steps(1);
        with.push(driven.window.state().cost().cpu_us);
        let until = Instant::now() + Duration::from_millis(pause_ms);
        while Instant::now() < until {
            driven.window.run_steps(1);
            after.push(driven.window.state().cost().cpu_us);
            std::thread::sleep(Duration::from_millis(12));
        }
    }
    for (frames, of) in [(&mut with, "the frame"), (&mut after, "those after it")] {
        frames.sort_by(f64::total_cmp);
        let (middle, last) = (frames[frames.len() / 2] * 1e-3, frames[frames.len() - 1] * 1e-3);
        println!("{what}, {of}: p50 {middle:.2} ms, worst {last:.2} ms");
    }
}

fn measure(driven: &mut Driven, what: &str, frames: usize) {
    let mut frame_us: Vec<f64> = (0..frames)
        .map(|_| {
            driven.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(12));
            driven.window.state().cost().cpu_us
        })
        .collect();
    frame_us.sort_by(f64::total_cmp);
    println!(
        "{what}, {frames} frames: panels and pictures p50 {:.2} ms, p99 {:.2} ms",
        frame_us[frames / 2] * 1e-3,
        frame_us[frames * 99 / 100] * 1e-3
    );
}
