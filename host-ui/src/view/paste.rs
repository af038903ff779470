//! Puts a finished picture into the window, pixel for pixel.
//!
//! An image of the toolkit would go through the shader of its widgets. A driver without a graphics
//! card runs that in full for each pixel, which took longer than drawing the picture.

use eframe::egui_wgpu::{Callback, CallbackResources, CallbackTrait, RenderState};
use eframe::wgpu;
use egui::epaint::PaintCallback;
use egui::{PaintCallbackInfo, Painter, Rect, Shape};
use stylet_imaging::Gpu;
use stylet_imaging::gpu::{Drawing, PICTURE, SAMPLER};

/// Pipelines that put pictures into the window.
pub struct Paste {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    between: wgpu::Sampler,
    /// Pipeline pixel for pixel.
    exact: wgpu::RenderPipeline,
    /// Pipeline for a picture with fewer pixels than its place.
    enlarging: wgpu::RenderPipeline,
}

/// Picture that can be put into the window.
#[derive(Clone)]
pub struct Pasted {
    draw: Draw,
    /// Paint callback, whose identity tells whether the picture is that of the previous frame.
    callback: PaintCallback,
}

#[derive(Clone)]
struct Draw {
    pipeline: wgpu::RenderPipeline,
    picture: wgpu::BindGroup,
}

/// Returns the device of the window.
pub fn gpu_of(state: &RenderState) -> Gpu {
    Gpu {
        device: state.device.clone(),
        queue: state.queue.clone(),
    }
}

impl Paste {
    /// Creates pipelines for textures with the screen's red, green and blue.
    pub fn new(state: &RenderState) -> Self {
        Self::converting(state, state.target_format.is_srgb())
    }

    /// Creates pipelines for textures of the window's own format.
    pub fn as_window(state: &RenderState) -> Self {
        Self::converting(state, false)
    }

    fn converting(state: &RenderState, to_light: bool) -> Self {
        let gpu = gpu_of(state);
        let layout = gpu.layout(wgpu::ShaderStages::FRAGMENT, &[PICTURE, SAMPLER]);
        let pipeline = |enlarges: bool| {
            let [to_light, enlarges] = [to_light, enlarges].map(|is| f64::from(u8::from(is)));
            let constants = [("TAKES_LIGHT", to_light), ("ENLARGES", enlarges)];
            Drawing::made_by_shader(
                include_str!("paste.wgsl"),
                ("paste_vertex", &[]),
                ("paste_fragment", &constants),
                state.target_format,
            )
            .pipeline(&gpu.device, &layout)
        };
        Self {
            exact: pipeline(false),
            enlarging: pipeline(true),
            layout,
            between: gpu.sampler(wgpu::AddressMode::ClampToEdge),
            gpu,
        }
    }

    /// Returns the picture in this texture.
    pub fn of(&self, texture: &wgpu::TextureView) -> Pasted {
        self.by(&self.exact, texture)
    }

    /// Returns the picture in this texture, which has fewer pixels than its place.
    pub fn enlarged(&self, texture: &wgpu::TextureView) -> Pasted {
        self.by(&self.enlarging, texture)
    }

    fn by(&self, pipeline: &wgpu::RenderPipeline, texture: &wgpu::TextureView) -> Pasted {
        let resources = [
            wgpu::BindingResource::TextureView(texture),
            wgpu::BindingResource::Sampler(&self.between),
        ];
        let draw = Draw {
            pipeline: pipeline.clone(),
            picture: self.gpu.bind(&self.layout, &resources),
        };
        Pasted {
            callback: Callback::new_paint_callback(Rect::NOTHING, draw.clone()),
            draw,
        }
    }
}

impl Pasted {
    /// Marks the texture as changed.
    pub fn renew(&mut self) {
        self.callback = Callback::new_paint_callback(Rect::NOTHING, self.draw.clone());
    }

    /// Returns the picture at this place of the window.
    pub fn shape(&self, rect: Rect) -> Shape {
        let mut callback = self.callback.clone();
        callback.rect = rect;
        callback.into()
    }

    /// Paints the picture over earlier shapes.
    pub fn paint(&self, painter: &Painter, rect: Rect) {
        painter.add(self.shape(rect));
    }
}

impl CallbackTrait for Draw {
    fn paint(&self, _info: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, _resources: &CallbackResources) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.picture, &[]);
        pass.draw(0..3, 0..1);
    }
}
