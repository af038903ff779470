//! The slices on the graphics card: three small volumes, an image if there is one, and a texture
//! for each slice.

use super::plane::Plane;
use super::speckle::{self, GRAIN_M, GRAINS, LARGEST_AMPLITUDE, LARGEST_LEVEL};
use crate::view::driver::DriverCost;
use crate::view::paste::{Paste, Pasted, gpu_of};
use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use nalgebra::{Matrix3, Vector3};
use std::mem::size_of;
use stylet_anatomy::PatientFrame;
use stylet_files::Image;
use stylet_host::link::SceneModel;
use stylet_imaging::Gpu;
use stylet_imaging::gpu::{Drawing, SAMPLER, UNIFORM, VOLUME, drawn_on};
use stylet_shm_schema::GridInfo;
use stylet_surfaces::field::{Field, SEEN_M, STEPS};

const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const GREY: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;
const LARGEST_SIDE: u32 = 2048;
/// Side of a picture cell at whose corners the material point is found. Displacements come every 8
/// mm (ADR 9), which is more pixels.
const CELL_PIXELS: u32 = 16;

/// Same layout as `Slice` in `slice.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct SliceUniform {
    middle_m: [f32; 4],
    right_m: [f32; 4],
    up_m: [f32; 4],
    volume_corner_m: [f32; 4],
    volume_size_m: [f32; 4],
    nodes_corner_m: [f32; 4],
    nodes_size_m: [f32; 4],
    grain: [[f32; 4]; 3],
    image: [[f32; 4]; 3],
}

/// Error of an image that cannot be shown in the slices.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The window runs without a graphics device.
    #[error("there is no graphics device to show an image")]
    NoDevice,
    /// One side has more voxels than a texture can have.
    #[error("{name} has {side} voxels along one side, and the graphics card takes {longest}; crop it to the gland")]
    TooLarge {
        /// Name of the image.
        name: String,
        /// Voxels along the longest side.
        side: usize,
        /// Voxels that the card takes.
        longest: u32,
    },
}

/// Resources of one scene.
struct Body {
    brightness: wgpu::TextureView,
    nodes: wgpu::Texture,
    nodes_info: GridInfo,
    at_rest: bool,
    volume_corner_m: [f32; 3],
    volume_size_m: [f32; 3],
    scene_from_patient: Matrix3<f64>,
    patient: PatientFrame,
}

/// Image without its greys, which are on the card.
struct OnCard {
    image: Image,
    view: wgpu::TextureView,
}

/// One picture.
struct Pane {
    uniform: wgpu::Buffer,
    bind: wgpu::BindGroup,
    target: Option<Target>,
    drawn: Option<(SliceUniform, u64)>,
}

struct Target {
    size: [u32; 2],
    view: wgpu::TextureView,
    pasted: Pasted,
}

pub struct SliceGpu {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    tissue_pipeline: wgpu::RenderPipeline,
    image_pipeline: wgpu::RenderPipeline,
    paste: Paste,
    grain: wgpu::TextureView,
    clamped: wgpu::Sampler,
    repeated: wgpu::Sampler,
    image: Option<OnCard>,
    /// Placeholder without an image.
    no_image: wgpu::TextureView,
    body: Option<Body>,
    panes: Vec<Pane>,
    /// Number that grows with each new content of the volumes.
    content: u64,
    texels: Vec<[u16; 4]>,
    pub driver: DriverCost,
}

impl SliceGpu {
    pub fn new(state: &RenderState) -> Self {
        let gpu = gpu_of(state);
        let types = [UNIFORM, VOLUME, VOLUME, VOLUME, VOLUME, SAMPLER, SAMPLER];
        let layout = gpu.layout(wgpu::ShaderStages::VERTEX_FRAGMENT, &types);
        let constants = [("STEPS", f64::from(STEPS)), ("SEEN_M", f64::from(SEEN_M))];
        let pipeline = |fragment| {
            let vertex = ("slice_vertex", &constants[..]);
            Drawing::made_by_shader(include_str!("slice.wgsl"), vertex, (fragment, &[]), COLOR)
                .pipeline(&gpu.device, &layout)
        };
        let grain = gpu.volume([GRAINS as u32; 3], GREY);
        let grains = speckle::grain();
        let mut driver = DriverCost::default();
        driver.send(|| gpu.write(&grain, &grains, 1));
        Self {
            tissue_pipeline: pipeline("slice_fragment"),
            image_pipeline: pipeline("image_fragment"),
            paste: Paste::new(state),
            grain: grain.create_view(&Default::default()),
            clamped: gpu.sampler(wgpu::AddressMode::ClampToEdge),
            repeated: gpu.sampler(wgpu::AddressMode::Repeat),
            image: None,
            no_image: gpu.volume([1; 3], GREY).create_view(&Default::default()),
            layout,
            body: None,
            panes: Vec::new(),
            content: 0,
            texels: Vec::new(),
            driver,
            gpu,
        }
    }

    /// Takes the tissues of a scene. A scene too large for the card has no slices.
    pub fn set_scene(&mut self, model: &SceneModel, scene_from_patient: Matrix3<f64>) {
        self.drop_panes();
        self.body = None;
        let (info, nodes_info) = (model.header.labels, model.header.nodes);
        let longest = self.gpu.device.limits().max_texture_dimension_3d;
        let border = speckle::border_cells(info.spacing_m);
        let has_cells = |grid: &GridInfo, border: usize| {
            grid.dims
                .iter()
                .all(|&d| d > 0 && d as usize + 2 * border <= longest as usize)
        };
        if !has_cells(&info, border) || !has_cells(&nodes_info, 0) || model.labels.is_empty() {
            return;
        }
        let (dims, bytes) = speckle::brightness_volume(&model.header, &model.labels);
        let beam = scene_from_patient.column(1).normalize();
        let bytes = speckle::with_edges(&bytes, dims, info.spacing_m, beam.into());
        let brightness = self.gpu.volume(dims.map(|d| d as u32), GREY);
        self.driver.send(|| self.gpu.write(&brightness, &bytes, 1));
        let nodes = self.gpu.volume(nodes_info.dims, wgpu::TextureFormat::Rgba16Float);
        self.body = Some(Body {
            brightness: brightness.create_view(&Default::default()),
            nodes,
            nodes_info,
            at_rest: false,
            volume_corner_m: info
                .origin_m
                .map(|c| (c - (border as f64 + 0.5) * info.spacing_m) as f32),
            volume_size_m: dims.map(|d| (d as f64 * info.spacing_m) as f32),
            scene_from_patient,
            patient: model.header.patient(),
        });
        self.set_field(&Field::rest(nodes_info));
    }

    /// Drops bindings to the volumes.
    fn drop_panes(&mut self) {
        self.panes.clear();
        self.content += 1;
    }

    /// Takes an image, and its greys to the card.
    pub fn set_image(&mut self, mut image: Image) -> Result<(), ImageError> {
        let longest = self.gpu.device.limits().max_texture_dimension_3d;
        if let Some(side) = image.dims.iter().find(|&&side| side > longest as usize) {
            return Err(ImageError::TooLarge {
                name: image.name,
                side: *side,
                longest,
            });
        }
        let greys = std::mem::take(&mut image.greys);
        let texture = self.gpu.volume(image.dims.map(|d| d as u32), GREY);
        self.driver.send(|| self.gpu.write(&texture, &greys, 1));
        let view = texture.create_view(&Default::default());
        self.image = Some(OnCard { image, view });
        self.drop_panes();
        Ok(())
    }

    pub fn forget_image(&mut self) {
        self.image = None;
        self.drop_panes();
    }

    pub fn set_field(&mut self, field: &Field) {
        let Some(body) = &mut self.body else { return };
        if field.info != body.nodes_info || (field.at_rest && body.at_rest) {
            return;
        }
        field.texels(&mut self.texels);
        let bytes: &[u8] = bytemuck::cast_slice(&self.texels);
        self.driver.send(|| self.gpu.write(&body.nodes, bytes, 8));
        body.at_rest = field.at_rest;
        self.content += 1;
    }

    /// Returns the picture of a plane, drawn if anything in it has changed; `None` without a scene.
    pub fn picture(&mut self, number: usize, plane: &Plane, pixels_per_point: f32, with_image: bool) -> Option<Pasted> {
        let body = self.body.as_ref()?;
        let image = self.image.as_ref().filter(|_| with_image).map(|on_card| &on_card.image);
        let size = [plane.rect.width(), plane.rect.height()]
            .map(|side| ((side * pixels_per_point).round() as u32).clamp(1, LARGEST_SIDE));
        let cells = size.map(|side| side.div_ceil(CELL_PIXELS));
        let uniform = uniform(body, plane, cells, image);
        let pipeline = match image {
            Some(_) => &self.image_pipeline,
            None => &self.tissue_pipeline,
        }
        .clone();
        while self.panes.len() <= number {
            let pane = self.pane()?;
            self.panes.push(pane);
        }
        let pane = &mut self.panes[number];
        if pane.target.as_ref().is_none_or(|t| t.size != size) {
            pane.target = Some(target(&self.gpu, &self.paste, size));
            pane.drawn = None;
        }
        let target = pane.target.as_mut()?;
        if pane.drawn != Some((uniform, self.content)) {
            pane.drawn = Some((uniform, self.content));
            let bytes = bytemuck::bytes_of(&uniform);
            self.driver.send(|| {
                self.gpu.queue.write_buffer(&pane.uniform, 0, bytes);
                draw(&self.gpu, &pipeline, &pane.bind, &target.view, cells);
                bytes.len() as u64
            });
            target.pasted.renew();
        }
        Some(target.pasted.clone())
    }

    fn pane(&self) -> Option<Pane> {
        let body = self.body.as_ref()?;
        let uniform = self.gpu.uniform(size_of::<SliceUniform>() as u64);
        let nodes = body.nodes.create_view(&Default::default());
        let view = wgpu::BindingResource::TextureView;
        let resources = [
            uniform.as_entire_binding(),
            view(&body.brightness),
            view(&nodes),
            view(&self.grain),
            view(self.image.as_ref().map_or(&self.no_image, |on_card| &on_card.view)),
            wgpu::BindingResource::Sampler(&self.clamped),
            wgpu::BindingResource::Sampler(&self.repeated),
        ];
        Some(Pane {
            bind: self.gpu.bind(&self.layout, &resources),
            uniform,
            target: None,
            drawn: None,
        })
    }
}

fn uniform(body: &Body, plane: &Plane, cells: [u32; 2], image: Option<&Image>) -> SliceUniform {
    let four = |v: Vector3<f64>, w: f32| [v.x as f32, v.y as f32, v.z as f32, w];
    let padded = |v: [f32; 3], w: f32| [v[0], v[1], v[2], w];
    let half = |side: f32| f64::from(side) / 2.0 * plane.m_per_point;
    let nodes = &body.nodes_info;
    let grain = [0, 1, 2].map(|a| {
        let along = body.scene_from_patient.column(a) / (f64::from(GRAIN_M[a]) * GRAINS as f64);
        four(along, 0.0)
    });
    SliceUniform {
        middle_m: four(plane.middle_m, LARGEST_AMPLITUDE),
        right_m: four(plane.right * half(plane.rect.width()), 0.0),
        up_m: four(plane.up * half(plane.rect.height()), LARGEST_LEVEL),
        volume_corner_m: padded(body.volume_corner_m, cells[0] as f32),
        volume_size_m: padded(body.volume_size_m, cells[1] as f32),
        nodes_corner_m: padded(nodes.origin_m.map(|c| (c - 0.5 * nodes.spacing_m) as f32), 0.0),
        nodes_size_m: padded(nodes.dims.map(|d| (f64::from(d) * nodes.spacing_m) as f32), 0.0),
        grain,
        image: image.map_or([[0.0; 4]; 3], |image| {
            image.texture_from_scene(&body.patient).map(|row| row.map(|v| v as f32))
        }),
    }
}

fn target(gpu: &Gpu, paste: &Paste, size: [u32; 2]) -> Target {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
    let texture = gpu.picture(size, 1, COLOR, usage);
    let view = texture.create_view(&Default::default());
    Target {
        size,
        pasted: paste.of(&view),
        view,
    }
}

fn draw(gpu: &Gpu, pipeline: &wgpu::RenderPipeline, bind: &wgpu::BindGroup, view: &wgpu::TextureView, cells: [u32; 2]) {
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[drawn_on(view, wgpu::LoadOp::Clear(wgpu::Color::BLACK))],
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, bind, &[]);
        pass.draw(0..6 * cells[0] * cells[1], 0..1);
    }
    gpu.queue.submit([encoder.finish()]);
}
