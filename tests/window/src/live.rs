//! The real window on a running core, driven by label through the steps.
//!
//! `make picture` keeps pictures of it for the README and the tour.

use crate::driven::{Driven, keep_for_docs, options_of};
use crate::opened::open_window;
use egui::accesskit::Role;
use egui_kittest::kittest::{NodeT, Queryable};
use host_ui::app::App;
use host_ui::view::orientation::Orientation;
use nalgebra::Vector3;
use std::path::Path;
use std::time::Duration;
use stylet_implant::plan::file;
use stylet_shm_schema::{Phase, flags};
use stylet_surfaces::field::Field;
use stylet_tests::Core;

fn phase(app: &App) -> u32 {
    app.link().state().map_or(0, |s| s.phase)
}

/// Inserts the needle to the deepest planned seed.
fn insert(driven: &mut Driven) {
    driven.click("Insert");
    driven.until("the deepest seed", |app| {
        app.link()
            .state()
            .is_some_and(|s| s.flags & flags::PUNCTURED != 0 && s.flags & flags::AT_GOAL != 0)
    });
}

#[test]
#[ignore = "draws the first picture of the README"]
fn a_seed_is_dropped_in_the_pelvis() {
    let core = Core::start_with(&["--rt-if-allowed", "--scene", "pelvis"]);
    let mut driven = Driven::on(core, [1280.0, 800.0]);
    driven.plan_and_place();
    driven.until("the needle line", |app| {
        app.link().state().is_some_and(|s| s.flags & flags::LINE_READY != 0)
    });
    driven.click("Engage force");
    insert(&mut driven);
    driven.click("Drop seed");
    driven.come_to_rest();
    keep_for_docs(&driven.picture("window"), "window");
}

#[test]
fn four_steps_by_label_move_the_gland_and_drop_a_seed() {
    let mut driven = Driven::open([1280.0, 800.0]);
    driven.plan_and_place();
    driven.click("Engage force");
    driven.until("force", |app| {
        app.link().state().is_some_and(|s| s.flags & flags::ENGAGED != 0)
    });
    let before = driven.picture("placed");
    // From the entry, 10 mm before the gland, to 6 mm into it: the membrane gives way at 8 mm.
    driven.pull_tip(0.016);
    assert_eq!(phase(driven.window.state()), Phase::Hold as u32, "the hand has stopped");
    driven.until("the gland to move before the puncture", |app| {
        app.link()
            .snapshot()
            .is_some_and(|s| s.header.max_displacement_m > 4e-3)
    });
    let state = driven.window.state().link().state().copied().expect("live");
    assert_eq!(state.flags & flags::PUNCTURED, 0, "punctured already");
    let during = driven.picture("contraction");
    keep_for_docs(&during, "contraction");
    assert!(differing_pixels(&before, &during) > 2_000, "the picture did not change");
    assert_inside_moves_as_the_surface_does(driven.window.state());
    assert_slice_shows_the_dent(&driven, &before, &during);
    insert(&mut driven);
    driven.click("Drop seed");
    driven.until("a seed", |app| {
        app.link().snapshot().is_some_and(|s| s.header.seed_count == 1)
    });
    driven.come_to_rest();
    driven.click("Retract");
    driven.until("the needle outside", |app| phase(app) == Phase::Outside as u32);
    let generation = driven.window.state().link().parameters().map(|p| p.generation);
    driven.click("Parameters");
    driven.window.run_steps(10);
    assert_eq!(
        driven.window.state().link().parameters().map(|p| p.generation),
        generation,
        "opening the dialog changed a parameter"
    );
    driven.picture("parameters");
    assert!(driven.core.is_running());
}

#[test]
fn a_new_window_moves_nothing() {
    let mut driven = Driven::open([1280.0, 800.0]);
    driven.plan_and_place();
    let tip = |app: &App| app.link().state().map(|s| s.tip_in_scene_m).expect("live");
    let mut second = open_window([1280.0, 800.0], options_of(driven.core.instance.clone()));
    // The plan begins only now: a window that waits while another is made on its thread lets its
    // hand stop. A tip between two marks of the depth slider once made a new window pull it to the
    // nearest mark.
    driven.click("Insert");
    driven.until("contact", |app| phase(app) != Phase::Outside as u32);
    let start = tip(driven.window.state());
    for _ in 0..100 {
        second.run_steps(1);
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
    let end = tip(driven.window.state());
    assert!(
        end[2] - start[2] > 0.01,
        "the insertion stopped when a window came: {start:?} to {end:?}"
    );
}

#[test]
fn a_core_that_was_killed_is_started_again_by_a_click() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    driven.plan_and_place();
    let is_pelvis = |app: &App| {
        app.link()
            .scene()
            .is_some_and(|scene| scene.header.name.read() == "pelvis")
    };
    driven.click("1  Choose the scene");
    driven.click("pelvis");
    driven.until("the other scene", is_pelvis);
    driven.until("the needle before the other body", |app| {
        let scene = app.link().scene().expect("live");
        app.link()
            .state()
            .is_some_and(|s| s.tip_in_scene_m[2] < scene.header.lower_m[2] - 0.025)
    });
    let run = |app: &App| app.link().session().map(|session| session.session_id);
    let first = run(driven.window.state());
    driven.core.kill_only();
    for _ in 0..200 {
        driven.window.run_steps(1);
        if driven.window.query_by_label("Start it again").is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    driven.picture("ended");
    driven.click("Start it again");
    driven.until("another run", |app| {
        run(app).is_some_and(|id| Some(id) != first) && app.link().state().is_some()
    });
    driven.until("the scene that was open", |app| {
        run(app).is_some_and(|id| app.link().scene().is_some_and(|s| s.header.session_id == id)) && is_pelvis(app)
    });
    assert!(
        driven
            .window
            .query_by_label("The simulator core is not running")
            .is_none()
    );
}

#[test]
fn the_plan_of_one_needle_is_saved_when_the_core_ends() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    driven.click("Plan five seeds");
    driven.until("the plan", |app| app.link().plan().is_some_and(|p| p.seed_count == 5));
    driven.core.kill_only();
    let said = "Plan saved as ";
    driven.wait_for_label(said);
    let label = driven.window.get_by_label_contains(said);
    let node = label.accesskit_node();
    let text = node.label().or(node.value()).expect("a text");
    let file = Path::new(&text[text.find(said).expect("the file") + said.len()..]);
    let frame = driven.window.state().link().scene().expect("kept").header.patient();
    let plan = file::read(file, &frame).expect("a plan");
    std::fs::remove_dir_all(file.parent().expect("a folder")).expect("removed");
    assert_eq!((plan.needles.len(), plan.seed_count()), (1, 5));
}

#[test]
fn keys_drive_the_needle_and_releasing_stops_it() {
    let mut driven = Driven::open([1280.0, 800.0]);
    driven.plan_and_place();
    let z = |app: &App| app.link().state().map_or(0.0, |s| s.tip_in_scene_m[2]);
    let start = z(driven.window.state());
    driven.window.key_down(egui::Key::W);
    driven.until("the needle to go in", |app| z(app) > start + 5e-3);
    driven.window.key_up(egui::Key::W);
    driven.until("rest", |app| {
        app.link().state().is_some_and(|s| s.speed_m_per_s.abs() < 1e-3)
    });
    let stopped = z(driven.window.state());
    for _ in 0..50 {
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(
        (z(driven.window.state()) - stopped).abs() < 2e-3,
        "the needle went on by itself"
    );
}

/// Checks that surface vertices, sent in full, agree with the displacements inside, sent on a
/// coarse grid.
fn assert_inside_moves_as_the_surface_does(app: &App) {
    let (scene, snapshot) = (app.link().scene().expect("live"), app.link().snapshot().expect("live"));
    let field = Field::of(scene.header.nodes, &snapshot.displacements_m).expect("the snapshot is the scene's");
    let errors_m: Vec<f64> = scene
        .rest_m
        .iter()
        .zip(&snapshot.positions_m)
        .map(|(rest, now)| {
            let (rest, now) = (Vector3::from(*rest).map(f64::from), Vector3::from(*now).map(f64::from));
            (field.displacement_m(rest) - (now - rest)).norm()
        })
        .collect();
    let rms_m = (errors_m.iter().map(|e| e * e).sum::<f64>() / errors_m.len() as f64).sqrt();
    let worst_m = errors_m.iter().copied().fold(0.0, f64::max);
    let moved_m = snapshot.header.max_displacement_m;
    println!("moved {moved_m:.4} m; grid against surface: rms {rms_m:.6} m, worst {worst_m:.6} m");
    // A link stretches by three quarters at most, and a vertex is no farther from a node than the
    // spacing of the grid.
    assert!(worst_m < 0.75 * field.info.spacing_m, "{worst_m} m");
    assert!(rms_m < 0.1 * moved_m, "{rms_m} m of {moved_m} m");
}

/// Guards against tissue at rest next to the shaft: the picture must show the dent, as dark as
/// outside.
fn assert_slice_shows_the_dent(driven: &Driven, before: &image::RgbaImage, during: &image::RgbaImage) {
    let app = driven.window.state();
    let rect = driven.window.get_by_label("Sagittal slice").rect();
    let plane = app.middle().plane(Orientation::Sagittal, rect);
    let state = app.link().state().expect("live");
    let (tip, ahead) = (
        Vector3::from(state.tip_in_scene_m),
        Vector3::from(state.needle_direction),
    );
    let mean = |picture: &image::RgbaImage, middle: Vector3<f64>| {
        let at = plane.on_screen(middle);
        let (x, y) = (at.x.round() as u32, at.y.round() as u32);
        let patch = (x - 4..=x + 4).flat_map(|x| (y - 4..=y + 4).map(move |y| (x, y)));
        patch.map(|(x, y)| f64::from(picture.get_pixel(x, y).0[1])).sum::<f64>() / 81.0
    };
    let in_dent = tip - ahead * 4e-3 + plane.up * 2.5e-3;
    let in_tissue = tip + ahead * 6e-3 + plane.up * 6e-3;
    let [was, now] = [before, during].map(|picture| mean(picture, in_dent));
    let inside = mean(during, in_tissue);
    println!("brightness in the dent: {was:.0} at rest, {now:.0} now; in the tissue {inside:.0}");
    assert!(was > 0.6 * inside, "at rest there is tissue: {was} of {inside}");
    assert!(now < 0.6 * inside, "now there is none: {now} of {inside}");
}

fn differing_pixels(a: &image::RgbaImage, b: &image::RgbaImage) -> usize {
    a.pixels()
        .zip(b.pixels())
        .filter(|(a, b)| a.0.iter().zip(b.0).any(|(x, y)| x.abs_diff(y) > 24))
        .count()
}

/// Guards against values that were clamped in silence.
#[test]
fn a_value_beyond_its_limits_is_named_and_not_taken() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    let set = |driven: &Driven| driven.window.state().link().parameters().map(|p| (p.generation, p.set));
    let before = set(&driven);
    driven.click("Parameters");
    driven.window.run_steps(3);
    let field = |driven: &mut Driven, text: &str| {
        let label = "Puncture depth u_cri";
        driven.window.get_by_role_and_label(Role::SpinButton, label).click();
        driven.window.run_steps(2);
        driven
            .window
            .key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        driven.window.run_steps(1);
        driven.window.get_by(|node| node.is_focused()).type_text(text);
        driven.window.run_steps(2);
        driven.press(egui::Key::Enter);
        driven.window.run_steps(5);
    };
    field(&mut driven, "900");
    driven.window.get_by_label("900 is beyond the limits; not changed");
    assert_eq!(set(&driven), before);
    // The next letters are meant for the dialog too.
    driven.press(egui::Key::E);
    driven.window.run_steps(5);
    let is_engaged = |app: &App| app.link().state().is_some_and(|s| s.flags & flags::ENGAGED != 0);
    assert!(!is_engaged(driven.window.state()));
    field(&mut driven, "9 mm");
    driven.until("the change", |app| {
        app.link()
            .parameters()
            .is_some_and(|p| Some(p.generation) > before.map(|(n, _)| n))
    });
    assert!(driven.window.query_by_label_contains("beyond the limits").is_none());
}
