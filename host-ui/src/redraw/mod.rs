//! Redraws only the parts of the window that differ from the previous frame.
//!
//! The toolkit draws all of the window in each frame. A driver without a graphics card does that on
//! the processor, which took most of a frame for unchanged text. Here the window is a texture that
//! is kept: only the changes are drawn into it, and the toolkit draws one picture.

mod damage;

use crate::cpu_time::thread_ns;
use crate::view::driver::DriverCost;
use crate::view::paste::{Paste, Pasted, gpu_of};
use damage::{Drawn, damage, window};
use eframe::egui_wgpu::{RenderState, ScreenDescriptor};
use eframe::wgpu;
use egui::epaint::textures::TexturesDelta;
use egui::epaint::{ClippedPrimitive, ClippedShape, Shape};
use egui::{Color32, Context, FullOutput, Rect, TextureId};
use stylet_imaging::gpu::drawn_on;

/// Renderer that replaces the shapes of a frame by one that shows them.
pub(crate) struct Redraw {
    is_on: bool,
    state: RenderState,
    paste: Paste,
    kept: Option<LastFrame>,
    cost: RedrawCost,
    driver: DriverCost,
}

/// Processor time of redrawing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RedrawCost {
    /// Time to find the changes and to triangulate them.
    pub own_ns: u64,
    pub driver_ns: u64,
}

/// Window as it was last drawn.
struct LastFrame {
    size: [u32; 2],
    pixels_per_point: f32,
    background: Color32,
    texture: wgpu::TextureView,
    pasted: Pasted,
    shapes: Vec<Drawn>,
}

impl Redraw {
    /// Creates a renderer for the window of this graphics device.
    pub(crate) fn new(state: RenderState) -> Self {
        Self {
            is_on: true,
            paste: Paste::as_window(&state),
            state,
            kept: None,
            cost: RedrawCost::default(),
            driver: DriverCost::default(),
        }
    }

    /// Returns the cost since the last call.
    pub(crate) fn take_cost(&mut self) -> RedrawCost {
        std::mem::take(&mut self.cost)
    }

    /// Switches the renderer; when off, the toolkit draws the window.
    pub(crate) fn switch(&mut self, on: bool) {
        (self.is_on, self.kept) = (on, None);
    }

    /// Draws all of the last frame once more.
    pub(crate) fn again(&mut self, ctx: &Context) {
        if let Some(kept) = self.kept.take() {
            self.draw(ctx, &kept, &[window(kept.size, kept.pixels_per_point)]);
            self.kept = Some(kept);
        }
    }

    /// Takes changed textures. An update inside a texture keeps the layout; a replaced texture may
    /// move everything.
    fn take_textures(&mut self, textures: &mut TexturesDelta) {
        let mut renderer = self.state.renderer.write();
        for (id, changes) in textures.set.drain() {
            for change in changes {
                if change.is_whole() || id != TextureId::default() {
                    self.kept = None;
                }
                renderer.update_texture(&self.state.device, &self.state.queue, id, &change);
            }
        }
    }

    fn kept(&mut self, size: [u32; 2], pixels_per_point: f32, background: Color32) -> LastFrame {
        let same =
            |k: &LastFrame| k.size == size && k.pixels_per_point == pixels_per_point && k.background == background;
        if let Some(kept) = self.kept.take().filter(same) {
            return kept;
        }
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let texture = gpu_of(&self.state).picture(size, 1, self.state.target_format, usage);
        let texture = texture.create_view(&Default::default());
        let whole = window(size, pixels_per_point);
        let nothing = ClippedShape::new(Rect::EVERYTHING, Shape::Noop);
        LastFrame {
            size,
            pixels_per_point,
            background,
            pasted: self.paste.of(&texture),
            texture,
            // A shape that is in no frame, so that all of the window differs.
            shapes: vec![Drawn::new(nothing, whole).everywhere(whole)],
        }
    }

    /// Draws the damaged rectangles of `kept` from its shapes.
    fn draw(&mut self, ctx: &Context, kept: &LastFrame, damaged: &[Rect]) {
        let mut shapes = Vec::new();
        for rect in damaged {
            let hidden = kept.shapes.iter().rposition(|drawn| drawn.hides_below(*rect));
            if hidden.is_none() {
                // Larger than the visible area, because its own edge is smoothed.
                let background = Shape::rect_filled(rect.expand(4.0), 0.0, kept.background);
                shapes.push(ClippedShape::new(*rect, background));
            }
            let seen = &kept.shapes[hidden.unwrap_or(0)..];
            for drawn in seen.iter().filter(|d| d.rect.intersects(*rect)) {
                let mut shape = drawn.shape.clone();
                shape.clip_rect = shape.clip_rect.intersect(*rect);
                shapes.push(shape);
            }
        }
        let primitives = ctx.tessellate(shapes, kept.pixels_per_point);
        let mut driver = self.driver;
        driver.time(|| self.send(kept, &primitives));
        self.driver = driver;
    }

    fn send(&self, kept: &LastFrame, primitives: &[ClippedPrimitive]) {
        let screen = ScreenDescriptor {
            size_in_pixels: kept.size,
            pixels_per_point: kept.pixels_per_point,
        };
        let (device, queue) = (&self.state.device, &self.state.queue);
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut renderer = self.state.renderer.write();
        let prepared = renderer.update_buffers(device, queue, &mut encoder, primitives, &screen);
        {
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("stylet window"),
                    color_attachments: &[drawn_on(&kept.texture, wgpu::LoadOp::Load)],
                    ..Default::default()
                })
                .forget_lifetime();
            renderer.render(&mut pass, primitives, &screen);
        }
        queue.submit(prepared.into_iter().chain([encoder.finish()]));
    }
}

impl egui::Plugin for Redraw {
    fn debug_name(&self) -> &'static str {
        "redraw"
    }

    fn output_hook(&mut self, ctx: &Context, output: &mut FullOutput) {
        if !self.is_on {
            return;
        }
        let begun = (thread_ns(), self.driver.cpu_ns);
        self.take_textures(&mut output.textures_delta);
        let pixels_per_point = output.pixels_per_point;
        let points = ctx.viewport_rect().size();
        let size = [points.x, points.y].map(|side| (side * pixels_per_point).round() as u32);
        let largest = self.state.device.limits().max_texture_dimension_2d;
        if !size.iter().all(|side| (1..=largest).contains(side)) {
            return;
        }
        let mut kept = self.kept(size, pixels_per_point, ctx.global_style().visuals.panel_fill);
        let rect = window(size, pixels_per_point);
        let shapes = std::mem::take(&mut output.shapes);
        let shapes: Vec<Drawn> = shapes.into_iter().map(|shape| Drawn::new(shape, rect)).collect();
        let damaged = damage(&kept.shapes, &shapes, pixels_per_point);
        kept.shapes = shapes;
        if !damaged.is_empty() {
            self.draw(ctx, &kept, &damaged);
        }
        output.shapes = vec![ClippedShape::new(rect, kept.pasted.shape(rect))];
        self.kept = Some(kept);
        let all_ns = thread_ns().saturating_sub(begun.0);
        let driver_ns = self.driver.cpu_ns - begun.1;
        self.cost.driver_ns += driver_ns;
        self.cost.own_ns += all_ns.saturating_sub(driver_ns);
    }
}
