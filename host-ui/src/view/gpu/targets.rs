//! The textures of a picture.

use crate::view::paste::Pasted;
use eframe::wgpu;
use stylet_imaging::Gpu;

/// Format that egui accepts for an image that is already gamma-encoded.
pub const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Samples per pixel of a picture that stays.
pub const FINE: u32 = 4;
/// Samples per pixel of a picture that is replaced at once.
pub const ONE_SAMPLE: u32 = 1;

/// Textures that receive a picture.
pub struct Targets {
    pub size: [u32; 2],
    picture: wgpu::TextureView,
    /// Texture of a picture with several samples.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    pub pasted: Pasted,
}

impl Targets {
    pub fn new(gpu: &Gpu, size: [u32; 2], samples: u32, paste: impl Fn(&wgpu::TextureView) -> Pasted) -> Self {
        let make = |format, samples, usage| {
            let texture = gpu.picture(size, samples, format, usage);
            texture.create_view(&Default::default())
        };
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let picture = make(COLOR, 1, drawn | wgpu::TextureUsages::TEXTURE_BINDING);
        Self {
            size,
            samples: (samples > 1).then(|| make(COLOR, samples, drawn)),
            depth: make(DEPTH, samples, drawn),
            pasted: paste(&picture),
            picture,
        }
    }

    pub fn begin<'a>(&self, encoder: &'a mut wgpu::CommandEncoder, [r, g, b]: [f64; 3]) -> wgpu::RenderPass<'a> {
        let (view, resolve_target, store) = match &self.samples {
            Some(samples) => (samples, Some(&self.picture), wgpu::StoreOp::Discard),
            None => (&self.picture, None, wgpu::StoreOp::Store),
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                    store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }
}
