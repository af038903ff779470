//! Pipelines of marks and surfaces: shaders, blending and depth.

use super::super::marks::MarkVertex;
use super::targets::{COLOR, DEPTH};
use eframe::wgpu;
use std::mem::size_of;
use stylet_imaging::gpu::Drawing;
use stylet_surfaces::mesh::SurfaceVertex;

/// Pipelines of one picture.
pub struct Pipelines {
    pub solid: wgpu::RenderPipeline,
    pub line: wgpu::RenderPipeline,
    pub surface_back: wgpu::RenderPipeline,
    pub surface_front: wgpu::RenderPipeline,
}

impl Pipelines {
    /// Creates pipelines for pictures with this number of samples per pixel.
    pub fn new(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, samples: u32) -> Self {
        let mark = |topology| {
            let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4];
            let primitive = wgpu::PrimitiveState {
                topology,
                ..Default::default()
            };
            let stages = ["mark_vertex", "mark_fragment"];
            let vertices = (size_of::<MarkVertex>(), &attributes[..]);
            pipeline(device, layout, samples, stages, vertices, primitive, true)
        };
        let surface = |hidden| {
            let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
            let primitive = wgpu::PrimitiveState {
                cull_mode: Some(hidden),
                ..Default::default()
            };
            let stages = ["surface_vertex", "surface_fragment"];
            let vertices = (size_of::<SurfaceVertex>(), &attributes[..]);
            pipeline(device, layout, samples, stages, vertices, primitive, false)
        };
        Self {
            solid: mark(wgpu::PrimitiveTopology::TriangleList),
            line: mark(wgpu::PrimitiveTopology::LineList),
            surface_back: surface(wgpu::Face::Front),
            surface_front: surface(wgpu::Face::Back),
        }
    }
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    samples: u32,
    [vertex, fragment]: [&str; 2],
    (stride, attributes): (usize, &[wgpu::VertexAttribute]),
    primitive: wgpu::PrimitiveState,
    is_opaque: bool,
) -> wgpu::RenderPipeline {
    Drawing {
        wgsl: include_str!("../scene.wgsl"),
        vertex: (vertex, &[]),
        fragment: (fragment, &[]),
        target: wgpu::ColorTargetState {
            blend: (!is_opaque).then_some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            ..COLOR.into()
        },
        buffers: &[Some(wgpu::VertexBufferLayout {
            array_stride: stride as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes,
        })],
        primitive,
        depth: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(is_opaque),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        samples,
    }
    .pipeline(device, layout)
}
