//! Pipelines of the passes in their order, and the buffers between them.

use super::{LARGEST_IMPEDANCE, LARGEST_LOSS, PATCH_M, RANGE_DB, SCAN_BYTES, SHOT_BYTES, ZERO_BRIGHTNESS};
use crate::Tissue;
use crate::gpu::{Gpu, READ, SAMPLER, UNIFORM, VOLUME, WRITE};
use crate::ultrasound::beams::Grid;
use std::mem::size_of;
use stylet_surfaces::field::{SEEN_M, STEPS};

const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const BEAMS_AT_ONCE: u32 = 64;
const ENTRIES: [&str; 5] = ["rest_map", "echo", "beam", "axial", "lateral"];

pub struct Passes {
    layout: wgpu::BindGroupLayout,
    scan_layout: wgpu::BindGroupLayout,
    /// In the order of [`ENTRIES`].
    compute: [wgpu::ComputePipeline; 5],
    scan: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
}

/// Of one grid and one size of picture.
pub struct Buffers {
    grid: Grid,
    pixels: [u32; 2],
    pub shot: wgpu::Buffer,
    pub scan: wgpu::Buffer,
    pub marks: wgpu::Buffer,
    pub levels: wgpu::Buffer,
    pub powers: wgpu::Buffer,
    pub target: wgpu::Texture,
    bind: wgpu::BindGroup,
    scan_bind: wgpu::BindGroup,
}

impl Buffers {
    pub fn fit(&self, grid: Grid, pixels: [u32; 2]) -> bool {
        self.grid == grid && self.pixels == pixels
    }
}

impl Passes {
    pub fn new(gpu: &Gpu) -> Self {
        let types = [
            UNIFORM, VOLUME, VOLUME, SAMPLER, READ, READ, WRITE, WRITE, WRITE, WRITE, READ,
        ];
        let layout = gpu.layout(wgpu::ShaderStages::COMPUTE, &types);
        let scan_layout = gpu.layout(wgpu::ShaderStages::FRAGMENT, &[UNIFORM, READ]);
        let constants = [
            ("STEPS", f64::from(STEPS)),
            ("SEEN_M", f64::from(SEEN_M)),
            ("LARGEST_LOSS", f64::from(LARGEST_LOSS)),
            ("LARGEST_IMPEDANCE", f64::from(LARGEST_IMPEDANCE)),
            ("RANGE_DB", f64::from(RANGE_DB)),
            ("ZERO_BRIGHTNESS", f64::from(ZERO_BRIGHTNESS)),
            ("PATCH_M", PATCH_M),
            ("SOFT_LOSS", f64::from(Tissue::SOFT.loss_db_per_cm_mhz)),
        ];
        Self {
            scan: scan_pipeline(&gpu.device, &scan_layout),
            compute: gpu.compute(&layout, include_str!("../ultrasound.wgsl"), ENTRIES, &constants),
            layout,
            scan_layout,
            sampler: gpu.clamped(),
        }
    }

    pub fn buffers(
        &self,
        gpu: &Gpu,
        grid: Grid,
        pixels: [u32; 2],
        [tissues, nodes]: [&wgpu::TextureView; 2],
        grains: &wgpu::Buffer,
    ) -> Buffers {
        let count = grid.count() as u64;
        let four = size_of::<[f32; 4]>() as u64;
        let [columns, rows] = grid.map_cells().map(u64::from);
        let [shot, scan] = [SHOT_BYTES, SCAN_BYTES].map(|bytes| gpu.uniform(bytes));
        let [shifts, near, far] = [2 * columns * rows, count, count].map(|n| gpu.storage(n * four));
        let (marks, levels) = (gpu.storage(count * four / 2), gpu.storage(count * four / 4));
        let powers = gpu.storage(u64::from(grid.samples) * four / 4);
        let [wide, high] = pixels;
        let target = gpu.texture([wide, high, 1], wgpu::TextureDimension::D2, COLOR);
        let resources = [
            shot.as_entire_binding(),
            wgpu::BindingResource::TextureView(tissues),
            wgpu::BindingResource::TextureView(nodes),
            wgpu::BindingResource::Sampler(&self.sampler),
            grains.as_entire_binding(),
            marks.as_entire_binding(),
            shifts.as_entire_binding(),
            near.as_entire_binding(),
            far.as_entire_binding(),
            levels.as_entire_binding(),
            powers.as_entire_binding(),
        ];
        let bind = gpu.bind(&self.layout, &resources);
        let shown = [scan.as_entire_binding(), levels.as_entire_binding()];
        let scan_bind = gpu.bind(&self.scan_layout, &shown);
        Buffers {
            grid,
            pixels,
            shot,
            scan,
            marks,
            levels,
            powers,
            target,
            bind,
            scan_bind,
        }
    }

    pub fn run(&self, gpu: &Gpu, buffers: &Buffers) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let Grid { lines, samples, .. } = buffers.grid;
        let [columns, rows] = buffers.grid.map_cells();
        let groups = lines.div_ceil(BEAMS_AT_ONCE);
        let sizes = [
            [columns.div_ceil(BEAMS_AT_ONCE), rows, 2],
            [groups, samples, 1],
            [groups, 1, 1],
            [groups, samples, 1],
            [groups, samples, 1],
        ];
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &buffers.bind, &[]);
            for (pipeline, [x, y, z]) in self.compute.iter().zip(sizes) {
                pass.set_pipeline(pipeline);
                pass.dispatch_workgroups(x, y, z);
            }
        }
        {
            let view = buffers.target.create_view(&Default::default());
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("stylet ultrasound"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_pipeline(&self.scan);
            pass.set_bind_group(0, &buffers.scan_bind, &[]);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }
}

fn scan_pipeline(device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("stylet ultrasound"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("stylet ultrasound"),
        source: wgpu::ShaderSource::Wgsl(include_str!("../scan.wgsl").into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("stylet ultrasound"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("scan_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("scan_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(COLOR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
