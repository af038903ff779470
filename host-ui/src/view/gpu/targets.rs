//! The textures of a picture.

use crate::view::paste::Pasted;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;

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
    pub fn new(
        state: &RenderState,
        size: [u32; 2],
        samples: u32,
        paste: impl Fn(&wgpu::TextureView) -> Pasted,
    ) -> Self {
        let make = |format, samples, usage| {
            let texture = state.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("stylet view"),
                size: wgpu::Extent3d {
                    width: size[0],
                    height: size[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
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
            label: Some("stylet view"),
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
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }
}
