//! Bindings and shader of a slice.

use super::COLOR;
use eframe::wgpu;
use stylet_surfaces::field::{SEEN_M, STEPS};

/// Creates the layout: uniform, four volumes and two samplers.
pub fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let volume = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    let uniform = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    let entries: Vec<wgpu::BindGroupLayoutEntry> = [uniform, volume, volume, volume, volume, sampler, sampler]
        .into_iter()
        .enumerate()
        .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty,
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("stylet slice"),
        entries: &entries,
    })
}

/// Creates the pipeline of the fragment shader with this name.
pub fn pipeline(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, shader: &str) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("stylet slice"),
        source: wgpu::ShaderSource::Wgsl(include_str!("../slice.wgsl").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("stylet slice"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("stylet slice"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("slice_vertex"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("STEPS", f64::from(STEPS)), ("SEEN_M", f64::from(SEEN_M))],
                ..Default::default()
            },
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(shader),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(COLOR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
