//! The real window in a test harness.
//!
//! `build_eframe` of egui_kittest is not used: its feature turns on the accessibility of eframe, whose macros change
//! features of packages beneath everything, which would be compiled twice between `make run` and `make test`.

use eframe::App as _;
use eframe::egui_wgpu::RendererOptions;
use egui_kittest::wgpu::{WgpuTestRenderer, create_render_state, default_wgpu_setup};
use host_ui::app::{App, Options};
use std::cell::RefCell;
use std::ops::{Deref, DerefMut};
use std::rc::Rc;

pub type Harness = egui_kittest::Harness<'static, Opened>;

/// Window that exists from the harness's first frame on.
pub struct Opened(Option<App>);

impl Deref for Opened {
    type Target = App;

    fn deref(&self) -> &App {
        self.0.as_ref().expect("the first frame is drawn")
    }
}

impl DerefMut for Opened {
    fn deref_mut(&mut self) -> &mut App {
        self.0.as_mut().expect("the first frame is drawn")
    }
}

/// Opens a window of this size in pixels, with the text of that size.
pub fn open_window(size: [f32; 2], options: Options) -> Harness {
    let scale = host_ui::text_scale(size.into());
    let drawn_by = create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE);
    let renderer = WgpuTestRenderer::from_render_state(drawn_by.clone());
    let created = Rc::new(RefCell::new(None));
    let first = created.clone();
    egui_kittest::Harness::builder()
        .with_size(egui::Vec2::from(size) / scale)
        .with_pixels_per_point(scale)
        .renderer(renderer)
        .with_context_setup(move |ctx| {
            let mut cc = eframe::CreationContext::_new_kittest(ctx.clone());
            cc.wgpu_render_state = Some(drawn_by);
            first.replace(Some(App::new(&cc, options)));
        })
        .build_ui_state(
            move |ui, opened| {
                opened.0 = opened.0.take().or_else(|| created.take());
                // The harness's own `Ui` has a margin.
                let whole = egui::UiBuilder::new().max_rect(ui.ctx().content_rect());
                let mut root = egui::Ui::new(ui.ctx().clone(), egui::Id::unique("window"), whole);
                opened.ui(&mut root, &mut eframe::Frame::_new_kittest());
            },
            Opened(None),
        )
}
