//! The real window on a separate core, drawn by the software driver and driven like by a person.

use crate::kept::{assert_like_kept, tolerant, with_fewer_greys};
use crate::opened::{Harness, open_window};
use egui::accesskit::Role;
use egui_kittest::kittest::{NodeT, Queryable, by};
use host_ui::app::{App, Options};
use host_ui::view::orientation::Orientation;
use std::time::{Duration, Instant};
use stylet_host::core_args::CoreArgs;
use stylet_shm_schema::{Instance, flags};
use stylet_test_kit::scratch;
use stylet_tests::Core;

pub fn is_at_rest(app: &App) -> bool {
    app.link().state().is_some_and(|s| s.speed_m_per_s.abs() < 1e-3)
}

pub struct Driven {
    pub window: Harness,
    pub core: Core,
}

impl Driven {
    pub fn open(size: [f32; 2]) -> Self {
        Self::on(Core::start(), size)
    }

    /// Opens a core without real time, so that the machine's rights do not matter.
    pub fn open_plain(size: [f32; 2]) -> Self {
        Self::on(Core::start_with(&[real_time_option()]), size)
    }

    pub fn on(core: Core, size: [f32; 2]) -> Self {
        let window = window_on(&core.instance, size);
        let mut driven = Self { window, core };
        driven.until_live();
        driven
    }

    /// Closes the window like a kill, and opens another.
    pub fn reopen(&mut self, size: [f32; 2]) {
        self.window = window_on(&self.core.instance, size);
        self.until_live();
    }

    /// Runs some steps, the last ones drawn like in the shipped window. By then, parts that moved
    /// are drawn in full.
    fn draw(&mut self) {
        for _ in 0..20 {
            self.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
        App::draw_changes_only(&self.window.ctx, true);
        self.window.run_steps(3);
    }

    /// Returns the last picture, with covered areas blanked.
    fn drawn(&mut self) -> image::RgbaImage {
        let picture = self.window.render().expect("a picture");
        App::draw_changes_only(&self.window.ctx, false);
        picture
    }

    fn until_live(&mut self) {
        self.until("a live core", |app| {
            app.link().state().is_some() && app.link().scene().is_some_and(|scene| scene.bodies_made().is_some())
        });
    }

    /// Draws frames until the window reaches the expected state.
    pub fn until(&mut self, what: &str, ready: impl Fn(&App) -> bool) {
        let start = Instant::now();
        while !ready(self.window.state()) {
            assert!(start.elapsed() < Duration::from_secs(30), "waited in vain for {what}");
            self.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn click(&mut self, label: &str) {
        self.window.get_by_label(label).click();
        self.window.run_steps(2);
    }

    /// Types into the last field with this in its label, instead of its text.
    pub fn type_into(&mut self, label: &str, text: &str) {
        fn field<'a>(driven: &'a Driven, label: &'a str) -> egui_kittest::Node<'a> {
            let fields = driven
                .window
                .query_all(by().role(Role::TextInput).label_contains(label));
            fields.last().expect("a field")
        }
        field(self, label).focus();
        self.window.run_steps(2);
        self.window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        self.window.run_steps(2);
        field(self, label).type_text(text);
        self.window.run_steps(2);
    }

    /// Waits for a label that contains these words.
    pub fn wait_for_label(&mut self, words: &str) {
        let begun = Instant::now();
        while self.window.query_by_label_contains(words).is_none() {
            assert!(begun.elapsed() < Duration::from_secs(60), "waited in vain for {words}");
            self.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn press(&mut self, key: egui::Key) {
        self.window.key_press(key);
        self.window.run_steps(2);
    }

    pub fn plan_and_place(&mut self) {
        self.click("Plan five seeds");
        self.until("the plan", |app| app.link().plan().is_some_and(|p| p.seed_count == 5));
        self.window.run_steps(2);
        self.click("Place needle");
        self.until("the needle at its entry", |app| {
            app.link().state().is_some_and(|s| s.flags & flags::AT_GOAL != 0)
        });
        self.rest();
    }

    /// Waits until the tip stands: the goal is reached to 0.1 mm while the hand still moves, and an exercise that
    /// loses the device would hold it there.
    fn rest(&mut self) {
        let tip =
            |driven: &Self| nalgebra::Vector3::from(driven.window.state().link().state().expect("live").tip_in_scene_m);
        let begun = Instant::now();
        loop {
            let before = tip(self);
            for _ in 0..10 {
                self.window.run_steps(1);
                std::thread::sleep(Duration::from_millis(10));
            }
            if (tip(self) - before).norm() < 1e-6 {
                return;
            }
            assert!(begun.elapsed() < Duration::from_secs(30), "the tip never stood");
        }
    }

    /// Pulls the tip in the sagittal slice by hand.
    pub fn pull_tip(&mut self, ahead_m: f64) {
        let at = |driven: &Self, ahead_m: f64| {
            let app = driven.window.state();
            let rect = driven.window.get_by_label("Sagittal slice").rect();
            let plane = app.middle().plane(Orientation::Sagittal, rect);
            let state = app.link().state().expect("live");
            let place = [0, 1, 2].map(|a| state.tip_in_scene_m[a] + state.needle_direction[a] * ahead_m);
            plane.on_screen(place.into())
        };
        let (from, to) = (at(self, 0.0), at(self, ahead_m));
        self.window.drag_at(from);
        self.window.run_steps(2);
        for _ in 0..80 {
            self.window.hover_at(to);
            self.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
        self.window.drop_at(to);
        self.window.run_steps(2);
        self.until("rest", is_at_rest);
    }

    pub fn picture(&mut self, name: &str) -> image::RgbaImage {
        self.draw();
        let picture = self.drawn();
        picture
            .save(scratch(&format!("picture-{name}")).join(format!("{name}.png")))
            .expect("saved");
        picture
    }

    /// Like [`Driven::compare`], while the plan replaces the plots.
    pub fn compare_plan(&mut self, name: &str) {
        assert_like_kept(name, &tolerant(), || {
            self.draw();
            let size = self.window.ctx.content_rect().size();
            let status = egui::Rect::from_min_max([120.0, 0.0].into(), [size.x - 250.0, 33.0].into());
            self.window.mask(status);
            self.drawn()
        });
    }

    /// Draws frames until hand and tissue are at rest, because moving parts are drawn coarser.
    pub fn come_to_rest(&mut self) {
        for _ in 0..10 {
            self.draw();
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Like [`Driven::compare`], after tissue and seeds have moved, which never repeats exactly:
    /// the slices are covered too, and figures may differ by this number of pixels.
    pub fn compare_live(&mut self, name: &str, pixels: usize) {
        assert_like_kept(name, &tolerant().max_failed_pixels(pixels), || {
            self.come_to_rest();
            let slices =
                ["Axial slice", "Sagittal slice", "Coronal slice"].map(|label| self.window.get_by_label(label).rect());
            slices.into_iter().for_each(|rect| self.window.mask(rect));
            self.cover_figures();
            self.drawn()
        });
    }

    /// Covers the figures at the top, and the plots.
    fn cover_figures(&mut self) {
        let size = self.window.ctx.content_rect().size();
        let cover = |from: [f32; 2], to: [f32; 2]| egui::Rect::from_min_max(from.into(), to.into());
        self.window.mask(cover([120.0, 0.0], [size.x - 250.0, 33.0]));
        self.window.mask(cover([size.x - 330.0, 40.0], [size.x, size.y]));
    }

    /// Compares with the kept picture; live parts are covered: figures at the top and the plots.
    pub fn compare(&mut self, name: &str) {
        assert_like_kept(name, &tolerant(), || {
            self.draw();
            self.cover_figures();
            self.drawn()
        });
    }
}

/// Gives the window another size in pixels, with text of the size that follows from it.
pub fn resize(window: &mut Harness, size: [f32; 2]) {
    let fit = host_ui::text_scale(size.into());
    window.ctx.set_zoom_factor(fit);
    window.run_steps(1);
    window.set_size(egui::Vec2::from(size) / fit);
}

/// Returns the options of a window on a core, or without one, that no gamepad moves.
pub fn options_of(instance: Instance) -> Options {
    Options {
        core: CoreArgs {
            instance,
            ..CoreArgs::default()
        },
        no_controllers: true,
        ..Options::default()
    }
}

/// Returns the window on a core that runs.
pub fn window_on(instance: &Instance, size: [f32; 2]) -> Harness {
    let window = open_window(size, options_of(instance.clone()));
    // Steps without a picture draw nothing.
    App::draw_changes_only(&window.ctx, false);
    window
}

/// Draws the last frame at once, and compares it with the result of its changes to the previous
/// frames.
pub fn assert_drawn_by_changes(window: &mut Harness, state: &str) {
    let by_changes = window.render().expect("a picture");
    App::draw_all_again(&window.ctx);
    let at_once = window.render().expect("a picture");
    let differing: Vec<_> = by_changes
        .enumerate_pixels()
        .zip(at_once.pixels())
        .filter(|((.., a), b)| a != b)
        .map(|((x, y, a), b)| (x, y, a.0, b.0))
        .collect();
    let some = &differing[..differing.len().min(12)];
    assert_eq!(differing.len(), 0, "{state}: {some:?}");
}

/// Returns whether `make picture` draws pictures of the documentation: in real time, and compared with no kept picture.
pub fn is_for_docs() -> bool {
    std::env::var_os("STYLET_TOUR").is_some()
}

/// Returns the option of a core: without real time pictures look alike on every machine.
pub fn real_time_option() -> &'static str {
    if is_for_docs() { "--rt-if-allowed" } else { "--no-rt" }
}

/// Saves a picture of the documentation.
pub fn keep_for_docs(picture: &image::RgbaImage, name: &str) {
    if !is_for_docs() {
        return;
    }
    let place = format!("{}/../../docs/pictures/{name}.png", env!("CARGO_MANIFEST_DIR"));
    let file = std::fs::File::create(place).expect("docs/pictures can be written");
    let encoder = image::codecs::png::PngEncoder::new_with_quality(
        file,
        image::codecs::png::CompressionType::Best,
        image::codecs::png::FilterType::Adaptive,
    );
    let rgb = image::DynamicImage::from(with_fewer_greys(picture, 12)).into_rgb8();
    rgb.write_with_encoder(encoder).expect("a PNG");
}

/// Returns text and widgets outside the window, and pairs that overlap.
pub fn misplaced(window: &Harness) -> Vec<String> {
    use egui::accesskit::Role;
    let screen = window.ctx.content_rect();
    let roles = [
        Role::Label,
        Role::Button,
        Role::CheckBox,
        Role::RadioButton,
        Role::TextInput,
    ];
    let all = window.query_all(by().predicate(move |node| roles.contains(&node.role())));
    let nodes: Vec<(String, egui::Rect)> = all
        .map(|node| {
            let inner = node.accesskit_node();
            let name = inner.label().or(inner.value()).unwrap_or_default();
            (name, node.rect())
        })
        .filter(|(name, rect)| !name.is_empty() && rect.is_positive())
        .collect();
    let mut problems = Vec::new();
    for (i, (name, rect)) in nodes.iter().enumerate() {
        if !screen.expand(0.5).contains_rect(*rect) {
            problems.push(format!("{name:?} at {rect} leaves the window"));
        }
        for (other, beside) in &nodes[i + 1..] {
            let common = rect.intersect(*beside);
            // Neighbours may share an edge.
            if common.width() > 1.5 && common.height() > 1.5 {
                problems.push(format!("{name:?} at {rect} lies over {other:?} at {beside}"));
            }
        }
    }
    problems
}
