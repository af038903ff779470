//! Model of a ChainMail body: topology and limits, built once.

use super::classes::Classes;
use super::spans::{Links, Rows, links_along};
use crate::limits::Limits;
use crate::scene::{Lattice, Scene};
use crate::simd::Simd;
use std::sync::Arc;

/// Topology and limits; only the limits ever change.
#[derive(Clone, Debug)]
pub struct ChainMail {
    pub(crate) lattice: Arc<Lattice>,
    limits: Limits,
    pub(crate) classes: Classes,
    pub(crate) rows: Rows,
    /// Links along x, y and z.
    pub(crate) links: [Links; 3],
    /// First and one past the last occupied row j of each plane k.
    pub(crate) rows_of_plane: Vec<[usize; 2]>,
    /// Part of the body that each run belongs to; no link joins two parts.
    part_of_run: Vec<u32>,
    /// Each part, whether something in it is fixed.
    part_is_fixed: Vec<bool>,
    pub(crate) simd: Simd,
}

impl ChainMail {
    /// Returns the body of a scene.
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let lattice = scene.lattice.clone();
        let rows = Rows::of(&lattice);
        let [_, ny, nz] = lattice.dims;
        let rows_of_plane = (0..nz).map(|k| {
            let occupied = || (0..ny).filter(|&j| !rows.numbers(j + ny * k).is_empty());
            match (occupied().next(), occupied().next_back()) {
                (Some(first), Some(last)) => [first, last + 1],
                _ => [0, 0],
            }
        });
        let classes = Classes::new(&scene.structures, &limits);
        let class_of = |_axis: usize, lo, hi| classes.of_link(lattice.structure(lo), lattice.structure(hi));
        let links = [0, 1, 2].map(|axis| links_along(axis, &lattice, &rows, &class_of));
        let part_of_run = parts(&lattice, &rows);
        let mut part_is_fixed = vec![false; part_of_run.iter().map(|&p| p as usize + 1).max().unwrap_or(0)];
        for (run, &part) in rows.runs.iter().zip(&part_of_run) {
            part_is_fixed[part as usize] |= (run.first..run.end()).any(|e| classes.is_fixed(lattice.structure(e)));
        }
        ChainMail {
            limits,
            links,
            rows_of_plane: rows_of_plane.collect(),
            part_of_run,
            part_is_fixed,
            simd: Simd::detect(),
            classes,
            rows,
            lattice,
        }
    }

    /// Returns the elements and their neighbours.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Returns the number of elements.
    pub fn element_count(&self) -> usize {
        self.lattice.element_count()
    }

    /// Returns the limits in force, but for structures with their own.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Takes new limits; states that ran with others must hear of it (`TissueState::disturb`).
    pub fn set_limits(&mut self, limits: Limits) {
        self.classes.set_limits(&limits);
        self.limits = limits;
    }

    pub(crate) fn is_fixed(&self, element: u32) -> bool {
        self.classes.any_fixed() && self.classes.is_fixed(self.lattice.structure(element))
    }

    pub(crate) fn part(&self, element: u32) -> u32 {
        self.part_of_run[self.rows.run_of(element)]
    }

    pub(crate) fn part_of_run(&self, run: usize) -> u32 {
        self.part_of_run[run]
    }

    pub(crate) fn part_is_fixed(&self, part: u32) -> bool {
        self.part_is_fixed[part as usize]
    }
}

/// Numbers the connected parts of a body, for each run: all elements of a run are connected.
fn parts(lattice: &Lattice, rows: &Rows) -> Vec<u32> {
    const UNSEEN: u32 = u32::MAX;
    let mut neighbours = vec![Vec::new(); rows.runs.len()];
    for axis in [1, 2] {
        for span in links_along(axis, lattice, rows, &|_, _, _| Some((0, super::kernels::Pin::None))).all() {
            neighbours[span.lo_run as usize].push(span.hi_run);
            neighbours[span.hi_run as usize].push(span.lo_run);
        }
    }
    let mut part = vec![UNSEEN; rows.runs.len()];
    let mut open = Vec::new();
    let mut count = 0;
    for start in 0..part.len() {
        if part[start] != UNSEEN {
            continue;
        }
        part[start] = count;
        open.push(start as u32);
        while let Some(run) = open.pop() {
            for &next in &neighbours[run as usize] {
                if part[next as usize] == UNSEEN {
                    part[next as usize] = count;
                    open.push(next);
                }
            }
        }
        count += 1;
    }
    part
}
