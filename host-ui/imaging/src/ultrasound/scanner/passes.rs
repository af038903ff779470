//! Pipelines of the passes in their order, and the buffers between them.

use super::{LARGEST_IMPEDANCE, LARGEST_LOSS, PATCH_M, RANGE_DB, SCAN_BYTES, SHOT_BYTES, ZERO_BRIGHTNESS};
use crate::Tissue;
use crate::gpu::{Drawing, GRID, Gpu, READ, SAMPLER, UNIFORM, VOLUME, drawn_on};
use crate::ultrasound::beams::Grid;
use std::mem::size_of;
use stylet_surfaces::field::{SEEN_M, STEPS};

const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const BETWEEN: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
const LEVELS: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
/// Sizes of the passes' groups, and neighbours that are computed together, as in the shader.
const GROUP: u32 = 64;
const BEAM_GROUP: u32 = 16;
const LATERAL_GROUP: [u32; 2] = [16, 4];
const AT_ONCE: u32 = 4;
const ENTRIES: [&str; 5] = ["rest_map", "echo", "beam", "axial", "lateral"];

pub struct Passes {
    layout: wgpu::BindGroupLayout,
    scan_layout: wgpu::BindGroupLayout,
    /// Pipelines in the order of [`ENTRIES`].
    compute: [wgpu::ComputePipeline; 5],
    scan: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
}

/// Buffers of one grid and one size of picture.
pub struct Buffers {
    grid: Grid,
    pixels: [u32; 2],
    pub shot: wgpu::Buffer,
    pub scan: wgpu::Buffer,
    pub marks: wgpu::Buffer,
    pub levels: wgpu::Texture,
    pub powers: wgpu::Buffer,
    pub target: wgpu::Texture,
    /// Bindings of alternate passes: the first of two textures from the second, then the second
    /// from the first.
    bind: [wgpu::BindGroup; 2],
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
            UNIFORM,
            VOLUME,
            VOLUME,
            SAMPLER,
            READ,
            READ,
            GRID,
            written(BETWEEN),
            written(LEVELS),
        ];
        let layout = gpu.layout(wgpu::ShaderStages::COMPUTE, &types);
        let scan_layout = gpu.layout(wgpu::ShaderStages::FRAGMENT, &[UNIFORM, GRID]);
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
            scan: Drawing::made_by_shader(
                include_str!("../scan.wgsl"),
                ("scan_vertex", &[]),
                ("scan_fragment", &[]),
                COLOR,
            )
            .pipeline(&gpu.device, &scan_layout),
            compute: gpu.compute(&layout, include_str!("../ultrasound.wgsl"), ENTRIES, &constants),
            layout,
            scan_layout,
            sampler: gpu.sampler(wgpu::AddressMode::ClampToEdge),
        }
    }

    pub fn buffers(
        &self,
        gpu: &Gpu,
        grid: Grid,
        pixels: [u32; 2],
        [tissues, nodes]: [&wgpu::TextureView; 2],
    ) -> Buffers {
        let word = size_of::<f32>() as u64;
        let [shot, scan] = [SHOT_BYTES, SCAN_BYTES].map(|bytes| gpu.uniform(bytes));
        let marks = gpu.storage(grid.count() as u64 * 2 * word);
        let powers = gpu.storage(u64::from(grid.samples) * word);
        let read = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let beams = |format| {
            let usage = read | wgpu::TextureUsages::STORAGE_BINDING;
            gpu.picture([grid.lines, grid.samples], 1, format, usage)
        };
        let levels = beams(LEVELS);
        let target = gpu.picture(pixels, 1, COLOR, read | wgpu::TextureUsages::RENDER_ATTACHMENT);
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let (one, other, levels_view) = (view(&beams(BETWEEN)), view(&beams(BETWEEN)), view(&levels));
        let bind = [[&one, &other], [&other, &one]].map(|[before, after]| {
            let resources = [
                shot.as_entire_binding(),
                wgpu::BindingResource::TextureView(tissues),
                wgpu::BindingResource::TextureView(nodes),
                wgpu::BindingResource::Sampler(&self.sampler),
                marks.as_entire_binding(),
                powers.as_entire_binding(),
                wgpu::BindingResource::TextureView(before),
                wgpu::BindingResource::TextureView(after),
                wgpu::BindingResource::TextureView(&levels_view),
            ];
            gpu.bind(&self.layout, &resources)
        });
        let shown = [
            scan.as_entire_binding(),
            wgpu::BindingResource::TextureView(&levels_view),
        ];
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

    /// Runs the passes. No beam reaches beyond `covered`, x, y, width and height in pixels.
    pub fn run(&self, gpu: &Gpu, buffers: &Buffers, covered: [u32; 4]) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let Grid { lines, samples, .. } = buffers.grid;
        let [columns, rows] = buffers.grid.map_cells();
        let (beams, four_samples) = (lines.div_ceil(GROUP), samples.div_ceil(AT_ONCE));
        let sizes = [
            [columns.div_ceil(GROUP), rows, 2],
            [beams, four_samples, 1],
            [lines.div_ceil(BEAM_GROUP), 1, 1],
            [beams, four_samples, 1],
            [
                lines.div_ceil(AT_ONCE * LATERAL_GROUP[0]),
                samples.div_ceil(LATERAL_GROUP[1]),
                1,
            ],
        ];
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for ((pipeline, [x, y, z]), bind) in self.compute.iter().zip(sizes).zip(buffers.bind.iter().cycle()) {
                pass.set_bind_group(0, bind, &[]);
                pass.set_pipeline(pipeline);
                pass.dispatch_workgroups(x, y, z);
            }
        }
        {
            let view = buffers.target.create_view(&Default::default());
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("stylet ultrasound"),
                color_attachments: &[drawn_on(&view, wgpu::LoadOp::Clear(wgpu::Color::BLACK))],
                ..Default::default()
            });
            pass.set_pipeline(&self.scan);
            pass.set_bind_group(0, &buffers.scan_bind, &[]);
            let [x, y, wide, high] = covered;
            pass.set_scissor_rect(x, y, wide, high);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }
}

/// Returns a texture that a pass writes.
fn written(format: wgpu::TextureFormat) -> wgpu::BindingType {
    wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format,
        view_dimension: wgpu::TextureViewDimension::D2,
    }
}
