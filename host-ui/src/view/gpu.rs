//! The offscreen picture: textures, pipelines and buffers on the graphics card.
//!
//! The picture is drawn into a separate texture and shown as an image, so that a window and a
//! test see the same pixels.

mod growing;
mod pipelines;
mod targets;

use super::driver::DriverCost;
use super::marks::Marks;
use super::paste::{Paste, Pasted, gpu_of};
use super::uniforms::SceneUniform;
use crate::dose_worker::IsodoseShell;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use growing::Growing;
use pipelines::Pipelines;
use std::mem::size_of;
use std::ops::Range;
use stylet_imaging::Gpu;
use stylet_imaging::gpu::UNIFORM;
use stylet_surfaces::mesh::SurfaceVertex;
use stylet_surfaces::mesh::coarse::coarse;
use targets::{FINE, ONE_SAMPLE, Targets};

const LARGEST_SIDE: u32 = 4096;

struct Material {
    uniform: wgpu::Buffer,
    bind: wgpu::BindGroup,
}

/// Closed surface: its indices, all and fewer, and its look.
struct Layer {
    fine: Range<u32>,
    coarse: Range<u32>,
    material: Material,
}

/// Surface of one dose.
struct Shell {
    vertices: Growing,
    indices: Growing,
    material: Material,
}

pub struct SceneGpu {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    /// Pipelines of the fine picture, and of the coarse one.
    pipelines: [Pipelines; 2],
    paste: Paste,
    /// Surface of the body, then those inside it.
    surfaces: Vec<Layer>,
    ghost: Material,
    /// Marks that change with the plan, then those that change with every tick.
    solids: [Growing; 2],
    lines: [Growing; 2],
    surface_vertices: Growing,
    ghost_vertices: Growing,
    indices: Growing,
    shells: Vec<Shell>,
    /// True with a graphics card; without one, moving pictures have a quarter of the pixels and
    /// fewer triangles.
    has_card: bool,
    /// The fine picture, and the coarse one.
    targets: [Option<Targets>; 2],
    shows_coarse: bool,
    pub driver: DriverCost,
}

impl SceneGpu {
    pub fn new(state: &RenderState) -> Self {
        let gpu = gpu_of(state);
        let device = &gpu.device;
        let layout = gpu.layout(wgpu::ShaderStages::VERTEX_FRAGMENT, &[UNIFORM]);
        let vertex = wgpu::BufferUsages::VERTEX;
        Self {
            pipelines: [FINE, ONE_SAMPLE].map(|samples| Pipelines::new(device, &layout, samples)),
            paste: Paste::new(state),
            surfaces: Vec::new(),
            ghost: material(&gpu, &layout),
            solids: [Growing::new(device, vertex), Growing::new(device, vertex)],
            lines: [Growing::new(device, vertex), Growing::new(device, vertex)],
            surface_vertices: Growing::new(device, vertex),
            ghost_vertices: Growing::new(device, vertex),
            indices: Growing::new(device, wgpu::BufferUsages::INDEX),
            shells: Vec::new(),
            has_card: state.adapter.get_info().device_type != wgpu::DeviceType::Cpu,
            targets: [None, None],
            shows_coarse: false,
            driver: DriverCost::default(),
            layout,
            gpu,
        }
    }

    /// Sets the indices of each surface, the body's first.
    pub fn set_scene(&mut self, rest: &[SurfaceVertex], surfaces: &[Vec<u32>]) {
        self.driver.send(|| self.ghost_vertices.write(&self.gpu, rest));
        let mut indices: Vec<u32> = Vec::new();
        let mut add = |some: &[u32]| {
            let begun = indices.len() as u32;
            indices.extend(some);
            begun..indices.len() as u32
        };
        self.surfaces.clear();
        for surface in surfaces {
            let fine = add(surface);
            let coarse = if self.has_card {
                fine.clone()
            } else {
                add(&coarse(rest, surface))
            };
            self.surfaces.push(Layer {
                fine,
                coarse,
                material: material(&self.gpu, &self.layout),
            });
        }
        self.driver.send(|| self.indices.write(&self.gpu, &indices));
    }

    pub fn set_surface(&mut self, vertices: &[SurfaceVertex]) {
        self.driver.send(|| self.surface_vertices.write(&self.gpu, vertices));
    }

    /// Moves vertices of the same surface.
    pub fn move_surface(&mut self, vertices: &[SurfaceVertex], runs: Vec<Range<usize>>) {
        for run in runs {
            self.driver
                .send(|| self.surface_vertices.write_run(&self.gpu, vertices, run));
        }
    }

    /// Sets vertices and indices of each isodose surface.
    pub fn set_shells(&mut self, shells: &[IsodoseShell]) {
        let device = &self.gpu.device;
        while self.shells.len() < shells.len() {
            self.shells.push(Shell {
                vertices: Growing::new(device, wgpu::BufferUsages::VERTEX),
                indices: Growing::new(device, wgpu::BufferUsages::INDEX),
                material: material(&self.gpu, &self.layout),
            });
        }
        self.shells.truncate(shells.len());
        for (shell, surface) in self.shells.iter_mut().zip(shells) {
            self.driver.send(|| shell.vertices.write(&self.gpu, &surface.vertices));
            self.driver.send(|| shell.indices.write(&self.gpu, &surface.indices));
        }
    }

    /// Sets marks: `which` is 0 for those of the plan, 1 for those of the tick.
    pub fn set_marks(&mut self, which: usize, marks: &Marks) {
        self.driver
            .send(|| self.solids[which].write(&self.gpu, &marks.triangles));
        self.driver.send(|| self.lines[which].write(&self.gpu, &marks.lines));
    }

    /// Sets the size in pixels. Returns true if the picture is new and must be drawn.
    pub fn resize(&mut self, size: [u32; 2]) -> bool {
        let size = size.map(|side| side.clamp(1, LARGEST_SIDE));
        if self.targets[0].as_ref().is_some_and(|t| t.size == size) {
            return false;
        }
        let fine = Targets::new(&self.gpu, size, FINE, |picture| self.paste.of(picture));
        let coarse = (!self.has_card).then(|| {
            let size = size.map(|side| side.div_ceil(2));
            Targets::new(&self.gpu, size, ONE_SAMPLE, |picture| self.paste.enlarged(picture))
        });
        self.targets = [Some(fine), coarse];
        true
    }

    /// Returns the picture that was drawn last.
    pub fn picture(&self) -> Option<Pasted> {
        let shown = &self.targets[usize::from(self.shows_coarse)];
        shown.as_ref().map(|t| t.pasted.clone())
    }

    /// Returns whether the last drawn picture has fewer pixels than its place.
    pub fn shows_coarse(&self) -> bool {
        self.shows_coarse
    }

    /// Draws the picture: opaque parts, the rest shape, the body's far side, its inner parts, its
    /// near side. `looks` has one uniform for each surface, `shells` one for each isodose surface;
    /// missing ones are not drawn. Returns the background, and whether the picture will change in
    /// the next frame.
    pub fn draw(
        &mut self,
        looks: &[SceneUniform],
        shells: &[SceneUniform],
        ghost: Option<&SceneUniform>,
        (clear, moves): ([f64; 3], bool),
    ) {
        self.shows_coarse = moves && self.targets[1].is_some();
        let which = usize::from(self.shows_coarse);
        let Some(mut targets) = self.targets[which].take() else {
            return;
        };
        let mut driver = self.driver;
        driver.send(|| self.send_picture(&targets, (looks, shells, ghost), clear));
        self.driver = driver;
        targets.pasted.renew();
        self.targets[which] = Some(targets);
    }

    /// Sends the picture; returns the number of bytes.
    fn send_picture(
        &self,
        targets: &Targets,
        (looks, shells, ghost): (&[SceneUniform], &[SceneUniform], Option<&SceneUniform>),
        clear: [f64; 3],
    ) -> u64 {
        let queue = &self.gpu.queue;
        for (surface, look) in self.surfaces.iter().zip(looks) {
            queue.write_buffer(&surface.material.uniform, 0, bytemuck::bytes_of(look));
        }
        for (shell, look) in self.shells.iter().zip(shells) {
            queue.write_buffer(&shell.material.uniform, 0, bytemuck::bytes_of(look));
        }
        // Marks use its light and eye.
        if let Some(ghost) = ghost.or(looks.first()) {
            queue.write_buffer(&self.ghost.uniform, 0, bytemuck::bytes_of(ghost));
        }
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = targets.begin(&mut encoder, clear);
            let pipelines = &self.pipelines[usize::from(self.shows_coarse)];
            pass.set_bind_group(0, &self.ghost.bind, &[]);
            for list in &self.solids {
                draw_list(&mut pass, &pipelines.solid, list);
            }
            for list in &self.lines {
                draw_list(&mut pass, &pipelines.line, list);
            }
            let of = |layer: &Layer| if self.shows_coarse { &layer.coarse } else { &layer.fine }.clone();
            let (far, near) = (&pipelines.surface_back, &pipelines.surface_front);
            if let Some((body, inner)) = self.surfaces.split_first() {
                if ghost.is_some() {
                    self.draw_surface(&mut pass, near, &self.ghost_vertices, &self.ghost, &of(body));
                }
                let now = &self.surface_vertices;
                self.draw_surface(&mut pass, far, now, &body.material, &of(body));
                self.draw_shells(&mut pass, pipelines, shells.len());
                for surface in inner {
                    self.draw_surface(&mut pass, far, now, &surface.material, &of(surface));
                    self.draw_surface(&mut pass, near, now, &surface.material, &of(surface));
                }
                self.draw_surface(&mut pass, near, now, &body.material, &of(body));
            }
        }
        queue.submit([encoder.finish()]);
        ((looks.len() + shells.len() + 1) * size_of::<SceneUniform>()) as u64
    }

    /// Draws the shells; the highest dose is innermost and comes first.
    fn draw_shells(&self, pass: &mut wgpu::RenderPass<'_>, pipelines: &Pipelines, count: usize) {
        for shell in self.shells.iter().take(count).rev().filter(|s| s.indices.len > 0) {
            for pipeline in [&pipelines.surface_back, &pipelines.surface_front] {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &shell.material.bind, &[]);
                pass.set_vertex_buffer(0, shell.vertices.buffer.slice(..));
                pass.set_index_buffer(shell.indices.buffer.slice(..), wgpu::IndexFormat::Uint32);
                pass.draw_indexed(0..shell.indices.len, 0, 0..1);
            }
        }
    }

    fn draw_surface(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        vertices: &Growing,
        material: &Material,
        indices: &Range<u32>,
    ) {
        // The indices belong to the rest shape; a buffer with fewer vertices is not drawn.
        let drawable = indices.end <= self.indices.len && vertices.len > 0 && vertices.len >= self.ghost_vertices.len;
        if !drawable || indices.is_empty() {
            return;
        }
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &material.bind, &[]);
        pass.set_vertex_buffer(0, vertices.buffer.slice(..));
        pass.set_index_buffer(self.indices.buffer.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(indices.clone(), 0, 0..1);
    }
}

fn draw_list(pass: &mut wgpu::RenderPass<'_>, pipeline: &wgpu::RenderPipeline, list: &Growing) {
    if list.len > 0 {
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, list.buffer.slice(..));
        pass.draw(0..list.len, 0..1);
    }
}

fn material(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> Material {
    let uniform = gpu.uniform(size_of::<SceneUniform>() as u64);
    Material {
        bind: gpu.bind(layout, &[uniform.as_entire_binding()]),
        uniform,
    }
}
