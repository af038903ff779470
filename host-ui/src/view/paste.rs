//! Puts a finished picture into the window, pixel for pixel.
//!
//! An image of the toolkit would go through the shader of its widgets. A driver without a graphics
//! card runs that in full for each pixel, which took longer than drawing the picture.

use eframe::egui_wgpu::{Callback, CallbackResources, CallbackTrait, RenderState};
use eframe::wgpu;
use egui::epaint::PaintCallback;
use egui::{PaintCallbackInfo, Painter, Rect, Shape};
use stylet_imaging::Drawing;

/// Pipelines that put pictures into the window.
pub struct Paste {
    device: wgpu::Device,
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
        let device = &state.device;
        let picture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("stylet paste"),
            entries: &[entry(0, picture), entry(1, sampler)],
        });
        let between = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("stylet paste"),
            mag_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self {
            exact: pipeline(device, &layout, state.target_format, [to_light, false]),
            enlarging: pipeline(device, &layout, state.target_format, [to_light, true]),
            layout,
            between,
            device: device.clone(),
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
        let picture = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("stylet paste"),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(texture),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::Sampler(&self.between),
                },
            ],
        });
        let draw = Draw {
            pipeline: pipeline.clone(),
            picture,
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

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    window: wgpu::TextureFormat,
    [to_light, enlarges]: [bool; 2],
) -> wgpu::RenderPipeline {
    Drawing {
        label: "stylet paste",
        wgsl: include_str!("paste.wgsl"),
        vertex: ("paste_vertex", &[]),
        fragment: (
            "paste_fragment",
            &[
                ("TAKES_LIGHT", f64::from(u8::from(to_light))),
                ("ENLARGES", f64::from(u8::from(enlarges))),
            ],
        ),
        target: window,
    }
    .pipeline(device, layout)
}
