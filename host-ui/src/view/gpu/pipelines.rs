//! Pipelines of marks and surfaces: shaders, blending and depth.

use super::super::marks::MarkVertex;
use super::targets::{COLOR, DEPTH};
use eframe::wgpu;
use std::mem::size_of;
use stylet_surfaces::mesh::SurfaceVertex;

/// Pipelines of one picture.
pub struct Pipelines {
    pub solid: wgpu::RenderPipeline,
    pub line: wgpu::RenderPipeline,
    pub surface_back: wgpu::RenderPipeline,
    pub surface_front: wgpu::RenderPipeline,
}

/// Creates pipelines for pictures with this number of samples per pixel.
pub fn pipelines(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, samples: u32) -> Pipelines {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("stylet scene"),
        source: wgpu::ShaderSource::Wgsl(include_str!("../scene.wgsl").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("stylet scene"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let mark = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4];
    let surface = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
    let solid = Kind {
        stage: "mark",
        stride: size_of::<MarkVertex>(),
        attributes: &mark,
        topology: wgpu::PrimitiveTopology::TriangleList,
        cull: None,
        opaque: true,
        samples,
    };
    let front = Kind {
        stage: "surface",
        stride: size_of::<SurfaceVertex>(),
        attributes: &surface,
        topology: wgpu::PrimitiveTopology::TriangleList,
        cull: Some(wgpu::Face::Back),
        opaque: false,
        samples,
    };
    let line = Kind {
        topology: wgpu::PrimitiveTopology::LineList,
        ..solid
    };
    let back = Kind {
        cull: Some(wgpu::Face::Front),
        ..front
    };
    Pipelines {
        solid: pipeline(device, &layout, &module, &solid),
        line: pipeline(device, &layout, &module, &line),
        surface_back: pipeline(device, &layout, &module, &back),
        surface_front: pipeline(device, &layout, &module, &front),
    }
}

/// Differences between the four pipelines.
#[derive(Clone, Copy)]
struct Kind<'a> {
    stage: &'static str,
    stride: usize,
    attributes: &'a [wgpu::VertexAttribute],
    topology: wgpu::PrimitiveTopology,
    cull: Option<wgpu::Face>,
    opaque: bool,
    samples: u32,
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    module: &wgpu::ShaderModule,
    kind: &Kind<'_>,
) -> wgpu::RenderPipeline {
    let blend = (!kind.opaque).then_some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING);
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(kind.stage),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(&format!("{}_vertex", kind.stage)),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: kind.stride as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: kind.attributes,
            })],
        },
        primitive: wgpu::PrimitiveState {
            topology: kind.topology,
            cull_mode: kind.cull,
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(kind.opaque),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: kind.samples,
            ..Default::default()
        },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(&format!("{}_fragment", kind.stage)),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: COLOR,
                blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
