//! The real window on a running core, driven by label through the four steps.
//!
//! The picture that it draws is the README's; `make picture` keeps it.

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use host_ui::app::{App, Options};
use std::time::{Duration, Instant};
use stylet_shm_schema::{Phase, flags};
use stylet_tests::{Core, scratch};

struct Driven {
    window: Harness<'static, App>,
    core: Core,
}

impl Driven {
    fn open(size: [f32; 2]) -> Self {
        let core = Core::start();
        let options = Options {
            instance: core.instance.clone(),
            scene: None,
            label: None,
        };
        let window = Harness::builder()
            .with_size(size)
            .wgpu()
            .build_eframe(|cc| App::new(cc, options));
        let mut driven = Self { window, core };
        driven.until("a live core", |app| {
            app.link().state().is_some() && app.link().scene().is_some()
        });
        driven
    }

    /// Draws frames until the window knows what is waited for.
    fn until(&mut self, what: &str, ready: impl Fn(&App) -> bool) {
        let start = Instant::now();
        while !ready(self.window.state()) {
            assert!(start.elapsed() < Duration::from_secs(30), "waited in vain for {what}");
            self.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn click(&mut self, label: &str) {
        self.window.get_by_label(label).click();
        self.window.run_steps(2);
    }

    fn plan_and_place(&mut self) {
        self.click("Plan five seeds");
        self.until("the plan", |app| app.link().plan().is_some_and(|p| p.seed_count == 5));
        self.click("Place needle");
        self.until("the needle at its entry", |app| {
            app.link().state().is_some_and(|s| s.flags & flags::AT_GOAL != 0)
        });
    }

    fn picture(&mut self, name: &str) -> image::RgbaImage {
        self.window.run_steps(3);
        let picture = self.window.render().expect("a picture");
        picture
            .save(scratch(&format!("picture-{name}")).join(format!("{name}.png")))
            .expect("saved");
        picture
    }
}

fn phase(app: &App) -> u32 {
    app.link().state().map_or(0, |s| s.phase)
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
    driven.click("Insert");
    driven.until("contraction", |app| phase(app) == Phase::Contraction as u32);
    driven.until("the gland to move before the puncture", |app| {
        app.link()
            .snapshot()
            .is_some_and(|s| s.header.max_displacement_m > 4e-3)
    });
    let state = driven.window.state().link().state().copied().expect("live");
    assert_eq!(state.flags & flags::PUNCTURED, 0, "punctured already");
    let during = driven.picture("contraction");
    assert!(differing_pixels(&before, &during) > 2_000, "the picture did not change");
    driven.until("the deepest seed", |app| {
        app.link()
            .state()
            .is_some_and(|s| s.flags & flags::PUNCTURED != 0 && s.flags & flags::AT_GOAL != 0)
    });
    driven.click("Drop seed");
    driven.until("a seed", |app| {
        app.link().snapshot().is_some_and(|s| s.header.seed_count == 1)
    });
    let picture = driven.picture("window");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        let place = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/pictures/window.png");
        picture.save(place).expect("docs/pictures can be written");
    }
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
fn a_window_that_comes_moves_nothing_by_itself() {
    let mut driven = Driven::open([1280.0, 800.0]);
    driven.plan_and_place();
    let tip = |app: &App| app.link().state().map(|s| s.tip_in_scene_m).expect("live");
    // A tip between two marks of the depth slider once made a new window pull it to the nearest mark.
    driven.click("Insert");
    driven.until("contact", |app| phase(app) != Phase::Outside as u32);
    let options = Options {
        instance: driven.core.instance.clone(),
        scene: None,
        label: None,
    };
    let mut second = Harness::builder()
        .with_size([1280.0, 800.0])
        .wgpu()
        .build_eframe(|cc| App::new(cc, options));
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
fn keys_drive_the_needle_and_letting_go_stops_it() {
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

fn differing_pixels(a: &image::RgbaImage, b: &image::RgbaImage) -> usize {
    a.pixels()
        .zip(b.pixels())
        .filter(|(a, b)| a.0.iter().zip(b.0).any(|(x, y)| x.abs_diff(y) > 24))
        .count()
}
