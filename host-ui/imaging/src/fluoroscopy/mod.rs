//! Radiographs of the deformed body, by a C-arm that turns about it.

mod arm;
mod attenuation;
mod exposure;
mod metal;

pub use arm::CArm;
pub use attenuation::Attenuation;
pub use exposure::{DoseCounter, Exposure};

use crate::body::Metal;
use crate::gpu::{Gpu, READ, SAMPLER, UNIFORM, VOLUME, WRITE};
use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;
use std::mem::size_of;
use stylet_surfaces::field::{Field, SEEN_M, STEPS};

/// Distance between two points of a ray at which the material point is found, m: displacements come
/// every 8 mm (ADR 9).
const PIECE_M: f64 = 2e-3;

/// Same layout as `Shot` in `radiograph.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Shot([[f32; 4]; 8]);

/// Picture: the transmitted share of the radiation for each pixel, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Radiograph {
    /// Transmission from 0 to 1.
    pub transmission: Vec<f32>,
}

impl Radiograph {
    /// Returns greys as on the screen of a C-arm, metal and bone dark: the logarithm of the
    /// transmission, its brightest and darkest hundredth white and black.
    pub fn greys(&self) -> Vec<u8> {
        let lost: Vec<f32> = self.transmission.iter().map(|t| -t.max(1e-6).ln()).collect();
        let mut sorted = lost.clone();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| sorted.get((sorted.len() as f64 * share) as usize).copied();
        let (least, most) = (at(0.01).unwrap_or(0.0), at(0.99).unwrap_or(1.0));
        let range = (most - least).max(0.05);
        let grey = |l: &f32| (255.0 * (1.0 - (l - least) / range)).round().clamp(0.0, 255.0) as u8;
        lost.iter().map(grey).collect()
    }
}

/// Renderer of radiographs.
pub struct Fluoroscope {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    pipeline: [wgpu::ComputePipeline; 1],
    sampler: wgpu::Sampler,
}

impl Fluoroscope {
    /// Creates a renderer on this device.
    pub fn new(gpu: Gpu) -> Self {
        let layout = gpu.layout(
            wgpu::ShaderStages::COMPUTE,
            &[UNIFORM, VOLUME, SAMPLER, READ, READ, WRITE],
        );
        let constants = [("STEPS", f64::from(STEPS)), ("SEEN_M", f64::from(SEEN_M))];
        Self {
            pipeline: gpu.compute(&layout, include_str!("radiograph.wgsl"), ["radiograph"], &constants),
            layout,
            sampler: gpu.sampler(wgpu::AddressMode::ClampToEdge),
            gpu,
        }
    }

    /// Takes one picture.
    pub fn shoot(&self, arm: &CArm, body: &Attenuation, field: &Field, metal: &Metal) -> Radiograph {
        let gpu = &self.gpu;
        let storage = wgpu::BufferUsages::STORAGE;
        let cells = gpu.filled(bytemuck::cast_slice(&body.per_m), storage);
        let metal = gpu.filled(bytemuck::cast_slice(&metal::losses(arm, metal)), storage);
        let mut texels = Vec::new();
        field.texels(&mut texels);
        let nodes = gpu.volume(field.info.dims, wgpu::TextureFormat::Rgba16Float);
        gpu.write(&nodes, bytemuck::cast_slice(&texels), 8);
        let nodes = nodes.create_view(&Default::default());
        let uniform = gpu.uniform(size_of::<Shot>() as u64);
        gpu.queue
            .write_buffer(&uniform, 0, bytemuck::bytes_of(&shot(arm, body, field)));
        let [wide, high] = arm.pixels;
        let out = gpu.storage(u64::from(wide) * u64::from(high) * 4);
        let bind = gpu.bind(
            &self.layout,
            &[
                uniform.as_entire_binding(),
                wgpu::BindingResource::TextureView(&nodes),
                wgpu::BindingResource::Sampler(&self.sampler),
                cells.as_entire_binding(),
                metal.as_entire_binding(),
                out.as_entire_binding(),
            ],
        );
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline[0]);
            pass.set_bind_group(0, &bind, &[]);
            pass.dispatch_workgroups(wide.div_ceil(8), high.div_ceil(8), 1);
        }
        gpu.queue.submit([encoder.finish()]);
        Radiograph {
            transmission: gpu.read(&out),
        }
    }
}

fn shot(arm: &CArm, body: &Attenuation, field: &Field) -> Shot {
    let four = |v: Vector3<f64>, w: f64| [v.x, v.y, v.z, w].map(|c| c as f32);
    let [right, up] = arm.right_up();
    let info = &field.info;
    let farthest_m = field
        .displacements_m
        .iter()
        .flatten()
        .fold(0.0, |most: f32, c| most.max(c.abs()));
    let dims = Vector3::from(body.dims).map(f64::from);
    Shot([
        four(arm.source_m(), f64::from(farthest_m)),
        four(arm.detector_m(), arm.pixel_m()),
        four(right, f64::from(arm.pixels[0])),
        four(up, f64::from(arm.pixels[1])),
        four(body.corner_m, body.spacing_m),
        four(dims, PIECE_M),
        four(Vector3::from(info.origin_m).add_scalar(-0.5 * info.spacing_m), 0.0),
        four(Vector3::from(info.dims).map(|d| f64::from(d) * info.spacing_m), 0.0),
    ])
}

#[cfg(test)]
mod tests;
