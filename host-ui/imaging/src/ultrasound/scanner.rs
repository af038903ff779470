//! The passes that compute a picture, and their resources on the graphics card.

mod passes;

use super::beams::{Grid, MAP_CELL, powers};
use super::marks::Marks;
use super::{Plane, Probe, View};
use crate::Tissue;
use crate::body::{Body, Metal};
use crate::gpu::Gpu;
use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;
use passes::{Buffers, Passes};
use std::mem::size_of;
use stylet_surfaces::field::Field;

/// The largest loss of a texel, dB per cm and MHz, and the largest impedance, MRayl.
pub(super) const LARGEST_LOSS: f32 = 25.5;
pub(super) const LARGEST_IMPEDANCE: f32 = 10.2;
/// Range from black to white of an unaltered picture, in decibels.
pub(super) const RANGE_DB: f32 = 60.0;
/// Brightness of tissue with a mean echo of 0 dB: the gland.
pub(super) const ZERO_BRIGHTNESS: f32 = Tissue::SOFT.brightness;
/// Distance between points whose texture is linearly interpolated, so that patches of soft tissue
/// are some 4 mm across; m.
pub(super) const PATCH_M: f64 = 3e-3;
/// Brightness of edges: the relative step of impedance times this is the amplitude over the
/// gland's.
const EDGE: f32 = 90.0;

/// Operator's settings of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Gain of the whole picture, dB.
    pub gain_db: f64,
    /// Gain with depth, dB per cm, which compensates the two-way attenuation of tissue.
    pub tgc_db_per_cm: f64,
    /// Range from black to white, in decibels.
    pub range_db: f64,
    /// Unevenness of soft tissue: standard deviation of its level from place to place, dB. This is
    /// a property of the simulation, not of a machine; 0 leaves speckle alone.
    pub texture_db: f64,
}

impl Default for Settings {
    /// Returns settings that compensate 0.5 dB per cm and MHz at 7 MHz, both ways.
    fn default() -> Self {
        Self {
            gain_db: 0.0,
            tgc_db_per_cm: 7.0,
            range_db: f64::from(RANGE_DB),
            texture_db: 3.5,
        }
    }
}

/// Same layout as `Shot` in `ultrasound.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Shot([[f32; 4]; 13]);

/// Same layout as `Scan` in `scan.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Scan([[f32; 4]; 3]);

/// Reason why a scene has no picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPicture {
    /// Nothing of the body is known.
    #[error("the scene has no labels to draw")]
    NoLabels,
    /// Labels or nodes exceed what a texture holds.
    #[error("the scene is too large for the graphics card")]
    TooLarge,
    /// The driver has given up the device.
    #[error("the graphics device was lost; start the program again")]
    Lost,
}

/// Tissues and displacements on the card.
struct OnCard {
    tissues: wgpu::TextureView,
    nodes: wgpu::Texture,
    field: Field,
    corner_m: Vector3<f64>,
    size_m: Vector3<f64>,
}

/// Renderer of a probe's pictures.
pub struct Scanner {
    gpu: Gpu,
    passes: Passes,
    body: Option<OnCard>,
    buffers: Option<Buffers>,
    marks: Marks,
    /// Fan whose powers are on the card.
    powers: Option<(View, f64, Probe)>,
    texels: Vec<[u16; 4]>,
}

impl Scanner {
    /// Creates a scanner without a body.
    pub fn new(gpu: Gpu) -> Self {
        Self {
            passes: Passes::new(&gpu),
            body: None,
            buffers: None,
            marks: Marks::default(),
            powers: None,
            texels: Vec::new(),
            gpu,
        }
    }

    /// Takes a body and the grid of its displacements, at rest. A body too large for the card has
    /// no picture.
    pub fn set_body(&mut self, body: &Body, field: &Field) {
        let longest = self.gpu.device.limits().max_texture_dimension_3d;
        (self.body, self.buffers) = (None, None);
        let fits = |dims: [u32; 3]| dims.iter().all(|&d| d > 0 && d + 2 <= longest);
        if !fits(body.grid.dims) || !fits(field.info.dims) {
            return;
        }
        // One cell of coupling all round, because the card repeats the outermost.
        let dims = body.grid.dims.map(|d| d + 2);
        let mut texels = vec![texel(&body.tissues[0]); dims.iter().map(|&d| d as usize).product()];
        let [wide, high, _] = body.grid.dims.map(|d| d as usize);
        for (row, cells) in body.cells.chunks_exact(wide).enumerate() {
            let (y, z) = (row % high + 1, row / high + 1);
            let start = (z * (high + 2) + y) * (wide + 2) + 1;
            for (slot, &label) in texels[start..].iter_mut().zip(cells) {
                *slot = texel(&body.tissues[usize::from(label)]);
            }
        }
        let tissues = self.gpu.volume(dims, wgpu::TextureFormat::Rgba8Unorm);
        self.gpu.write(&tissues, bytemuck::cast_slice(&texels), 4);
        let nodes = self.gpu.volume(field.info.dims, wgpu::TextureFormat::Rgba16Float);
        self.body = Some(OnCard {
            tissues: tissues.create_view(&Default::default()),
            nodes,
            field: Field::rest(field.info),
            corner_m: body.corner_m().add_scalar(-body.grid.spacing_m),
            size_m: body.size_m().add_scalar(2.0 * body.grid.spacing_m),
        });
        self.send_field(&Field::rest(field.info));
        self.set_field(field);
    }

    /// Takes the present displacements of the tissue.
    pub fn set_field(&mut self, field: &Field) {
        let Some(body) = &mut self.body else { return };
        if field.info == body.field.info && *field != body.field {
            body.field = field.clone();
            self.send_field(field);
        }
    }

    fn send_field(&mut self, field: &Field) {
        let Some(body) = &self.body else { return };
        field.texels(&mut self.texels);
        self.gpu.write(&body.nodes, bytemuck::cast_slice(&self.texels), 8);
    }

    /// Computes the picture of a plane; `None` without a body. Its pixels are opaque greys.
    pub fn picture(&mut self, plane: &Plane, settings: &Settings, metal: &Metal) -> Option<wgpu::TextureView> {
        let grid = Grid::of(plane);
        let body = self.body.as_ref()?;
        if self.buffers.as_ref().is_none_or(|b| !b.fit(grid, plane.pixels)) {
            self.powers = None;
            let nodes = body.nodes.create_view(&Default::default());
            self.buffers = Some(
                self.passes
                    .buffers(&self.gpu, grid, plane.pixels, [&body.tissues, &nodes]),
            );
        }
        let buffers = self.buffers.as_ref()?;
        self.marks.draw(plane, grid, metal);
        let queue = &self.gpu.queue;
        queue.write_buffer(&buffers.marks, 0, bytemuck::cast_slice(&self.marks.of_sample));
        let fan = Some((plane.view, plane.depth_m, plane.probe));
        if self.powers != fan {
            self.powers = fan;
            queue.write_buffer(&buffers.powers, 0, bytemuck::cast_slice(&powers(plane, grid)));
        }
        queue.write_buffer(&buffers.shot, 0, bytemuck::bytes_of(&shot(plane, settings, grid, body)));
        queue.write_buffer(&buffers.scan, 0, bytemuck::bytes_of(&scan(plane, settings, grid)));
        self.passes.run(&self.gpu, buffers, plane.covered());
        Some(buffers.target.create_view(&Default::default()))
    }

    /// Returns the pixels of the last picture, row by row from the top; empty without one.
    pub fn pixels(&self) -> Vec<[u8; 4]> {
        self.buffers
            .as_ref()
            .map_or_else(Vec::new, |b| self.gpu.pixels(&b.target))
    }

    /// Computes the picture of a plane and returns its greys, row by row from the top.
    ///
    /// # Errors
    ///
    /// Without a body that fits the card, or if the device was lost.
    pub fn greys(&mut self, plane: &Plane, settings: &Settings, metal: &Metal) -> Result<Vec<u8>, NoPicture> {
        self.picture(plane, settings, metal).ok_or(NoPicture::TooLarge)?;
        let greys: Vec<u8> = self.pixels().into_iter().map(|[grey, ..]| grey).collect();
        let [wide, high] = plane.pixels.map(|side| side as usize);
        (greys.len() == wide * high).then_some(greys).ok_or(NoPicture::Lost)
    }

    /// Returns decibels over the mean echo of the gland, by sample and beam, before scan
    /// conversion.
    pub fn levels_db(&self) -> Vec<f32> {
        self.buffers
            .as_ref()
            .map_or_else(Vec::new, |b| self.gpu.pixels(&b.levels))
    }

    /// Waits until the last picture is computed.
    pub fn wait(&self) {
        // The window notices a lost device.
        let _ = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
    }
}

fn texel(tissue: &Tissue) -> [u8; 4] {
    let byte = |share: f32| (share * 255.0).round().clamp(0.0, 255.0) as u8;
    [
        byte(tissue.brightness),
        byte(tissue.loss_db_per_cm_mhz / LARGEST_LOSS),
        byte(tissue.impedance_mrayl / LARGEST_IMPEDANCE).max(1),
        255,
    ]
}

fn four(v: Vector3<f64>, w: f64) -> [f32; 4] {
    [v.x, v.y, v.z, w].map(|c| c as f32)
}

fn is_linear(view: View) -> f64 {
    f64::from(u8::from(view == View::Sagittal))
}

fn shot(plane: &Plane, settings: &Settings, grid: Grid, body: &OnCard) -> Shot {
    let (probe, info) = (&plane.probe, &body.field.info);
    let counts = [grid.lines, grid.samples, grid.slices, MAP_CELL].map(|n| n as f32);
    let nodes_m = Vector3::from(info.dims).map(|d| f64::from(d) * info.spacing_m);
    Shot([
        four(plane.pose.middle_m, is_linear(plane.view)),
        four(plane.right(), probe.radius_m),
        four(plane.pose.up, plane.depth_m),
        four(plane.normal(), probe.half(plane.view)),
        counts,
        four(
            Vector3::new(probe.axial_m, probe.lateral_m, probe.lateral_per_depth),
            0.0,
        ),
        four(
            Vector3::new(probe.thickness_m, probe.focus_m, probe.focal_depth_m),
            probe.mhz,
        ),
        four(
            Vector3::new(settings.tgc_db_per_cm * 100.0, settings.gain_db, f64::from(EDGE)),
            settings.texture_db,
        ),
        four(body.corner_m, 0.0),
        four(body.size_m, 0.0),
        four(Vector3::from(info.origin_m).add_scalar(-0.5 * info.spacing_m), 0.0),
        four(nodes_m, 0.0),
        four(Vector3::from(grid.scatterers_m).map(f64::recip), 0.0),
    ])
}

fn scan(plane: &Plane, settings: &Settings, grid: Grid) -> Scan {
    let [wide, high] = plane.pixels.map(f64::from);
    // The gland keeps its grey at any range.
    let white_db = (1.0 - f64::from(ZERO_BRIGHTNESS)) * settings.range_db;
    Scan([
        [wide, high, plane.m_per_pixel(), plane.lowest_m()].map(|c| c as f32),
        [
            is_linear(plane.view),
            plane.probe.radius_m,
            plane.depth_m,
            plane.probe.half(plane.view),
        ]
        .map(|c| c as f32),
        [
            f64::from(grid.lines),
            f64::from(grid.samples),
            white_db,
            settings.range_db.max(1.0),
        ]
        .map(|c| c as f32),
    ])
}

const SHOT_BYTES: u64 = size_of::<Shot>() as u64;
const SCAN_BYTES: u64 = size_of::<Scan>() as u64;
