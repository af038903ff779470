//! The generator: strands with their seeds every 10 mm, some that touch, in tissue with bone,
//! noise, and voxels of 1 x 1 x 3 mm.
//!
//! It is independent of the search: points scattered in each seed's cylinder are moved by the
//! scanner's blur and counted.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use stylet_files::{VoxelFrame, VoxelValues};

/// Half axes of the gland, m.
pub const SEMI_AXES_M: [f64; 3] = [24e-3, 19e-3, 23e-3];
/// Number of seeds that touch another one.
pub const TOUCHING: usize = 27;
const SPACING_MM: [f64; 3] = [1.0, 1.0, 3.0];
const DIMS: [usize; 3] = [84, 76, 26];
/// Number of points of each seed.
const POINTS: usize = 6_000;
/// Sum of the values of a seed above the tissue, in HU times voxels.
const SIGNAL: f64 = 6000.0;
const NOISE_HU: f64 = 25.0;

/// Volume with its seeds.
pub struct Phantom {
    /// The CT.
    pub volume: VoxelValues<f32>,
    /// Place (RAS, m) and axis of each seed.
    pub seeds: Vec<([f64; 3], [f64; 3])>,
}

struct Random(ChaCha8Rng);

impl Random {
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Draws a normal number (Box and Muller).
    fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.unit(), self.unit());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

impl Phantom {
    /// Creates a hundred seeds; a scanner that `cuts_at` a value gives strong seeds that exceed it.
    pub fn new(random_seed: u64, cuts_at: Option<f32>) -> Self {
        let mut random = Random(ChaCha8Rng::seed_from_u64(random_seed));
        let seeds_mm = implant(&mut random);
        assert_eq!(seeds_mm.len(), 100);
        // Columns of a supine CT run to the left and to the back: LPS.
        let turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
        let columns = turn * Matrix3::from_diagonal(&Vector3::from(SPACING_MM)) * 1e-3;
        let half = Vector3::from([0, 1, 2].map(|a| (DIMS[a] - 1) as f64 / 2.0));
        let frame = VoxelFrame::new(columns, -(columns * half), "phantom").unwrap();
        let signal = if cuts_at.is_some() { 3.0 * SIGNAL } else { SIGNAL };
        let values = tissue(&mut random);
        let mut volume = VoxelValues {
            dims: DIMS,
            values,
            frame,
        };
        for (place_mm, axis) in &seeds_mm {
            // Seeds of one order differ by some percent.
            let own = signal * (1.0 + 0.03 * random.normal());
            draw(&mut volume, &mut random, *place_mm, *axis, own);
        }
        for value in &mut volume.values {
            *value += (NOISE_HU * random.normal()) as f32;
            *value = value.round().min(cuts_at.unwrap_or(f32::INFINITY));
        }
        let seeds = seeds_mm.into_iter().map(|(p, a)| ((p * 1e-3).into(), a.into()));
        Self {
            volume,
            seeds: seeds.collect(),
        }
    }
}

/// Creates uneven soft tissue, a piece of bone, and a small calcification.
fn tissue(random: &mut Random) -> Vec<f32> {
    let phases: [f64; 3] = std::array::from_fn(|_| random.within(0.0, 6.0));
    let value = |n: usize| {
        let at = [n % DIMS[0], n / DIMS[0] % DIMS[1], n / DIMS[0] / DIMS[1]];
        let mm = [0, 1, 2].map(|a| at[a] as f64 * SPACING_MM[a]);
        let wave = (0..3).map(|a| 8.0 * (mm[a] / 7.0 + phases[a]).sin()).sum::<f64>();
        let bone = mm[0] > 10.0 && mm[0] < 60.0 && mm[1] < 6.0 && mm[2] > 15.0 && mm[2] < 60.0;
        let calcification = at == [4, 70, 3];
        (if bone {
            750.0
        } else if calcification {
            1500.0
        } else {
            40.0 + wave
        }) as f32
    };
    (0..DIMS.iter().product()).map(value).collect()
}

/// Creates strands through the gland, every seed with its own small error, and groups that touch;
/// in mm.
fn implant(random: &mut Random) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let mut seeds: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    let alone = 100 - TOUCHING;
    // From the outside inwards, as in peripheral loading.
    let rings = [(0.86, 11), (0.52, 7), (0.12, 2)];
    let mut strands = Vec::new();
    for (share, count) in rings {
        for n in 0..count {
            let angle = std::f64::consts::TAU * (f64::from(n) + 0.3 * share) / f64::from(count);
            let (x, y) = (
                share * SEMI_AXES_M[0] * 1e3 * angle.cos(),
                share * SEMI_AXES_M[1] * 1e3 * angle.sin(),
            );
            let tilt = Vector3::new(random.within(-0.09, 0.09), random.within(-0.09, 0.09), 1.0).normalize();
            strands.push((Vector3::new(x, y, random.within(-3.0, 3.0)), tilt));
        }
    }
    let mut along: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    for depth in [-5.0, 5.0, -15.0, 15.0] {
        along.extend(strands.iter().map(|(middle, tilt)| (middle + tilt * depth, *tilt)));
    }
    for (place, tilt) in along.into_iter().take(alone) {
        let error = Vector3::from_fn(|_, _| random.normal().clamp(-2.0, 2.0) * 0.5);
        let turned = (tilt + Vector3::new(random.normal(), random.normal(), 0.0) * 0.06).normalize();
        seeds.push((place + error, turned));
    }
    // 13 get a neighbour end to end at the end of their strand, 13 one at their side, and one of
    // those two.
    for n in 0..TOUCHING {
        let with = if n < 13 { alone - 13 + n } else { (n - 13) % 13 };
        let (place, axis) = seeds[with];
        let across = axis
            .cross(&Vector3::new(random.normal(), random.normal(), 0.2))
            .normalize();
        let beside = match n {
            0..13 => axis * random.within(4.6, 5.0) + across * random.within(0.0, 0.5),
            13..26 => across * random.within(1.0, 2.0) + axis * random.within(-1.5, 1.5),
            _ => axis * -4.8,
        };
        seeds.push((place + beside, Rotation3::new(across * 0.1) * axis));
    }
    seeds
}

/// Adds one seed of 4.5 x 0.8 mm.
fn draw(volume: &mut VoxelValues<f32>, random: &mut Random, place_mm: Vector3<f64>, axis: Vector3<f64>, signal: f64) {
    let across = axis.cross(&Vector3::new(0.6, 0.8, 0.0)).normalize();
    let other = axis.cross(&across);
    let [nx, ny, _] = volume.dims;
    for _ in 0..POINTS {
        let (radius, angle) = (0.4 * random.unit().sqrt(), random.within(0.0, std::f64::consts::TAU));
        let solid = axis * random.within(-2.25, 2.25) + across * radius * angle.cos() + other * radius * angle.sin();
        // In the plane a normal blur, along the table a box, as in a spiral CT.
        let blur = Vector3::new(0.55 * random.normal(), 0.55 * random.normal(), random.within(-0.8, 0.8));
        let index = volume
            .frame
            .index_of((place_mm + solid + blur) * 1e-3)
            .map(|i| i.round() as usize);
        volume.values[(index[2] * ny + index[1]) * nx + index[0]] += (signal / POINTS as f64) as f32;
    }
}
