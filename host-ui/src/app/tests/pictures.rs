//! Pictures of every state of the window in all its sizes, for inspection:
//!
//! `cargo test --profile quick -p host-ui --lib pictures -- --ignored`, with `STYLET_PICTURES=1280x720`
//! for those whose name contains that.

use super::fixture::options;
use super::whole::{STATES, State};
use crate::app::App;
use crate::app::watch::EXAMPLE;
use crate::theme;
use eframe::egui_wgpu::RendererOptions;
use egui_kittest::Harness;
use egui_kittest::wgpu::{WgpuTestRenderer, create_render_state, default_wgpu_setup};
use image::RgbaImage;
use image::imageops::{FilterType, replace, resize};
use std::path::PathBuf;
use std::sync::Arc;
use stylet_base::interrupt::Interrupt;
use stylet_host::link::{Piece, SceneModel, Snapshot, played_of};

/// Sizes of the window in pixels: the smallest possible, and those of common screens.
const SIZES: [[u32; 2]; 5] = [[960, 600], [1280, 720], [1366, 768], [1920, 1080], [3840, 2160]];
const SCALES: [f32; 3] = [1.0, 1.5, 2.0];
/// Width of a picture on the sheet of all states.
const ON_SHEET: u32 = 480;
const SHEET_COLUMNS: u32 = 6;

/// Returns scene and last tissue of the example.
fn tissue() -> (Arc<SceneModel>, Box<Snapshot>) {
    let played = played_of(EXAMPLE, &Interrupt::default()).expect("a recording");
    let (mut scene, mut snapshot) = (None, None);
    for (_, piece) in played.pieces {
        match piece {
            Piece::Scene(found) => scene = Some(found),
            Piece::Snapshot(found) => snapshot = Some(found),
            _ => {}
        }
    }
    let scene = scene.expect("a scene");
    // Made here, because a picture would not wait for a thread.
    let _bodies = scene.bodies();
    (scene, snapshot.expect("tissue"))
}

fn picture(
    pixels: [u32; 2],
    scale: f32,
    is_dark: bool,
    (_, pose): &State,
    scene: Arc<SceneModel>,
    snapshot: Box<Snapshot>,
) -> RgbaImage {
    let drawn_by = create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE);
    let mut created = None;
    let mut window = Harness::builder()
        .with_size(egui::Vec2::new(pixels[0] as f32, pixels[1] as f32) / scale)
        .with_pixels_per_point(scale)
        .renderer(WgpuTestRenderer::from_render_state(drawn_by.clone()))
        .build_ui(move |ui| {
            let ctx = ui.ctx().clone();
            let app = created.get_or_insert_with(|| {
                let mut cc = eframe::CreationContext::_new_kittest(ctx.clone());
                cc.wgpu_render_state = Some(drawn_by.clone());
                let mut app = App::new(&cc, options());
                pose(&mut app);
                app
            });
            app.middle.take(&app.shown, Some(&scene), Some(&snapshot));
            // The harness's own `Ui` has a margin.
            let whole = egui::UiBuilder::new().max_rect(ctx.content_rect());
            drop(app.frame_ui(&mut egui::Ui::new(ctx, egui::Id::unique("window"), whole)));
        });
    theme::apply(&window.ctx);
    window
        .ctx
        .set_theme(if is_dark { egui::Theme::Dark } else { egui::Theme::Light });
    window.run_steps(6);
    window.render().expect("a picture")
}

#[test]
#[ignore = "pictures to be looked at"]
fn of_every_state_in_every_size() {
    let wanted = std::env::var("STYLET_PICTURES").unwrap_or_default();
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../target/states");
    let (scene, snapshot) = tissue();
    for pixels in SIZES {
        for scale in SCALES {
            let of = format!("{}x{}-{:.0}", pixels[0], pixels[1], scale * 100.0);
            if !of.contains(&wanted) {
                continue;
            }
            std::fs::create_dir_all(folder.join(&of)).expect("a folder");
            let height = ON_SHEET * pixels[1] / pixels[0];
            let rows = (STATES.len() as u32).div_ceil(SHEET_COLUMNS);
            let mut sheet = RgbaImage::new(SHEET_COLUMNS * ON_SHEET, rows * height);
            for (number, state) in (0..).zip(STATES) {
                let is_dark = number % 2 == 0;
                let drawn = picture(pixels, scale, is_dark, state, scene.clone(), snapshot.clone());
                let name = state.0.replace(' ', "-");
                drawn.save(folder.join(&of).join(format!("{name}.png"))).expect("saved");
                let small = resize(&drawn, ON_SHEET, height, FilterType::Triangle);
                let at = [number % SHEET_COLUMNS * ON_SHEET, number / SHEET_COLUMNS * height];
                replace(&mut sheet, &small, at[0].into(), at[1].into());
            }
            sheet.save(folder.join(format!("{of}.png"))).expect("saved");
            println!(
                "{}: {} states",
                folder.join(format!("{of}.png")).display(),
                STATES.len()
            );
        }
    }
}
