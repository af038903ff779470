//! Bindings and shader of a slice.

use super::COLOR;
use eframe::wgpu;
use stylet_imaging::Drawing;
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
    Drawing {
        label: "stylet slice",
        wgsl: include_str!("../slice.wgsl"),
        vertex: (
            "slice_vertex",
            &[("STEPS", f64::from(STEPS)), ("SEEN_M", f64::from(SEEN_M))],
        ),
        fragment: (shader, &[]),
        target: COLOR,
    }
    .pipeline(device, layout)
}
