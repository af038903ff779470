//! Dose at arbitrary points.

use super::grid::DoseGrid;
use super::kernel::{BLOCK, Block, DoseKernel, Placed};
use super::seed::Seed;
use rayon::prelude::*;

/// Points with their accumulated dose.
#[derive(Clone, Debug)]
pub struct DosePoints {
    blocks: Vec<[[f32; BLOCK]; 3]>,
    /// Middle of the points, from which single precision is fine enough.
    anchor_m: [f64; 3],
    dose_gy: Vec<f64>,
}

impl DosePoints {
    /// Creates points without dose; places in m.
    pub fn new(points_m: &[[f64; 3]]) -> Self {
        let count = points_m.len().max(1) as f64;
        let anchor_m = [0, 1, 2].map(|a| points_m.iter().map(|p| p[a]).sum::<f64>() / count);
        let of_block = |points: &[[f64; 3]]| {
            let last = points.len() - 1;
            [0, 1, 2].map(|a| std::array::from_fn(|i| (points[i.min(last)][a] - anchor_m[a]) as f32))
        };
        Self {
            blocks: points_m.chunks(BLOCK).map(of_block).collect(),
            anchor_m,
            dose_gy: vec![0.0; points_m.len()],
        }
    }

    /// Returns the dose in the order of the points.
    pub fn dose_gy(&self) -> &[f64] {
        &self.dose_gy
    }

    /// Adds the dose of seeds.
    pub fn add(&mut self, kernel: &DoseKernel, seeds: &[Seed]) {
        self.change(kernel, seeds, 1.0);
    }

    /// Undoes [`DosePoints::add`] to the last bit.
    pub fn remove(&mut self, kernel: &DoseKernel, seeds: &[Seed]) {
        self.change(kernel, seeds, -1.0);
    }

    fn change(&mut self, kernel: &DoseKernel, seeds: &[Seed], sign: f64) {
        let placed = self.place(seeds);
        Self::accumulate(&self.blocks, kernel, &placed, sign, &mut self.dose_gy, &|_| ());
    }

    fn accumulate(
        blocks: &[[[f32; BLOCK]; 3]],
        kernel: &DoseKernel,
        seeds: &[Placed],
        sign: f64,
        dose_gy: &mut [f64],
        done: &(dyn Fn(u64) + Sync),
    ) {
        dose_gy
            .par_chunks_mut(BLOCK)
            .zip(blocks)
            .with_min_len(16)
            .for_each(|(dose, block)| {
                kernel.add(seeds, &as_block(block), sign, dose);
                done(dose.len() as u64);
            });
    }

    /// Computes the dose of these seeds alone.
    pub fn of_seeds_gy(&self, kernel: &DoseKernel, seeds: &[Seed]) -> Vec<f64> {
        self.of_seeds_reporting(kernel, seeds, &|_| ())
    }

    /// Like [`DosePoints::of_seeds_gy`]; calls `done` with the number of points done since, from
    /// any thread.
    pub fn of_seeds_reporting(&self, kernel: &DoseKernel, seeds: &[Seed], done: &(dyn Fn(u64) + Sync)) -> Vec<f64> {
        let placed = self.place(seeds);
        let mut dose_gy = vec![0.0; self.dose_gy.len()];
        Self::accumulate(&self.blocks, kernel, &placed, 1.0, &mut dose_gy, done);
        dose_gy
    }

    /// Computes the dose of seeds alone after every distance, among the points and to the seeds, is
    /// multiplied by `by`.
    pub fn of_seeds_stretched_gy(&self, kernel: &DoseKernel, seeds: &[Seed], by: f64) -> Vec<f64> {
        let stretched = Self {
            blocks: self
                .blocks
                .iter()
                .map(|axes| axes.map(|axis| axis.map(|v| v * by as f32)))
                .collect(),
            anchor_m: self.anchor_m,
            dose_gy: vec![0.0; self.dose_gy.len()],
        };
        let moved = |s: &Seed| Seed {
            position_m: [0, 1, 2].map(|a| self.anchor_m[a] + (s.position_m[a] - self.anchor_m[a]) * by),
            ..*s
        };
        let seeds: Vec<Seed> = seeds.iter().map(moved).collect();
        stretched.of_seeds_gy(kernel, &seeds)
    }

    /// Interpolates the dose of a grid at the points, in Gy.
    pub fn of_grid_gy(&self, grid: &DoseGrid) -> Vec<f64> {
        let at = |n: usize| {
            let axes = &self.blocks[n / BLOCK];
            grid.at_gy([0, 1, 2].map(|a| self.anchor_m[a] + f64::from(axes[a][n % BLOCK])))
        };
        (0..self.dose_gy.len()).into_par_iter().map(at).collect()
    }

    fn place(&self, seeds: &[Seed]) -> Vec<Placed> {
        seeds.iter().map(|s| DoseKernel::place(s, self.anchor_m)).collect()
    }
}

fn as_block(axes: &[[f32; BLOCK]; 3]) -> Block {
    Block {
        x_m: axes[0],
        y_m: axes[1],
        z_m: axes[2],
    }
}
