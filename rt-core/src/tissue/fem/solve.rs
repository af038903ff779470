//! One step: take up the held patch, refine what it moves, superpose, report.

use super::level::Level;
use super::model::FemModel;
use super::output;
use super::real::Real;
use super::simd::{Simd, vectorised};
use super::state::{DIRECTIONS, FemState};
use crate::tissue::HeldOutcome;

/// Farthest from rest that a held element is followed, in elements.
pub const REACH: f64 = 2048.0;
/// A direction is new if this part of the displacement is outside those known.
const NEW_DIRECTION: f64 = 1e-6;
/// A patch is the next one up to so many cells away, and pushed the same way up to an angle of this cosine.
const NEXT_PATCH: isize = 2;
const SAME_WAY: f64 = 0.9;

/// A cube of tissue around an element that moves as one piece with the needle's tip: a single node would be ill-posed,
/// as its force goes to zero with the lattice's spacing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipPatch {
    pub element: u32,
    /// Where the element's centre is held, in the scene frame.
    pub position_m: [f64; 3],
    /// Elements whose centres are within half of this of the held element's, along each axis, are held with it.
    pub edge_m: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveSettings {
    /// Forces left on free nodes, relative to those that the moved patch would cause in a body at rest.
    pub relative_tolerance: f64,
    /// Multigrid cycles in one step, at most.
    pub max_cycles: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FemReport {
    pub held: HeldOutcome,
    pub cycles: u32,
    /// As in `SolveSettings::relative_tolerance`, measured after the step.
    pub relative_residual: f64,
    pub converged: bool,
    /// Force with which the tip moves the patch; the tissue pushes the tip with the opposite.
    pub tip_force_n: [f64; 3],
    /// Elements that moved in this step.
    pub moved: u32,
    /// Largest distance of an element from rest, in elements.
    pub max_displacement: f32,
}

/// Brings the body to equilibrium with the held patch, as far as `settings` allow. No patch: at rest.
///
/// What cannot be followed is refused and changes nothing; so is a state of another model.
pub fn step<T: Real>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    held: Option<TipPatch>,
    settings: &SolveSettings,
) -> FemReport {
    if !state.fits(model) {
        return report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings);
    }
    let Some(held) = held else {
        release(model, state);
        let moved = output::write(model, state);
        return FemReport {
            moved,
            ..report(state, HeldOutcome::None, 0, 0.0, settings)
        };
    };
    match cells_of(model, &held) {
        Some((cells, by_m)) => hold_cells(model, state, cells, by_m, settings),
        None => report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings),
    }
}

fn report<T: Real>(
    state: &FemState<T>,
    held: HeldOutcome,
    cycles: u32,
    relative_residual: f64,
    settings: &SolveSettings,
) -> FemReport {
    let used = &state.responses[..state.count];
    FemReport {
        held,
        cycles,
        relative_residual,
        converged: relative_residual <= settings.relative_tolerance && state.max_displacement.is_finite(),
        tip_force_n: [0, 1, 2].map(|c| used.iter().map(|r| r.weight_m * r.force_n_per_m[c]).sum()),
        moved: 0,
        max_displacement: state.max_displacement,
    }
}

/// The body goes back to rest; responses are kept for when the same patch is held again.
fn release<T: Real>(model: &FemModel<T>, state: &mut FemState<T>) {
    debug_assert!(state.fits(model));
    state.responses.iter_mut().for_each(|r| r.weight_m = 0.0);
}

/// The cells of the finest grid that a patch holds, and how far it moves them.
fn cells_of<T: Real>(model: &FemModel<T>, held: &TipPatch) -> Option<([[usize; 2]; 3], [f64; 3])> {
    let (lattice, grid) = (&model.lattice, &model.levels[0].grid);
    if held.element as usize >= model.element_count() || !(0.0..f64::INFINITY).contains(&held.edge_m) {
        return None;
    }
    let rest = lattice.rest_m(held.element);
    let by_m = [0, 1, 2].map(|a| held.position_m[a] - rest[a]);
    if !by_m.iter().all(|c| c.abs() <= REACH * lattice.spacing_m) {
        return None;
    }
    let cell = lattice.cell(held.element);
    let reach = (0.5 * held.edge_m / lattice.spacing_m + 1e-9).floor() as usize;
    let cells = [0, 1, 2].map(|a| {
        let centre = cell[a] - model.low_cell[a];
        [
            centre.saturating_sub(reach),
            centre.saturating_add(reach).saturating_add(1).min(grid.nodes[a] - 1),
        ]
    });
    Some((cells, by_m))
}

/// Holds the nodes of all elements in a box of cells of the finest grid, moved by `by_m` from rest.
pub(super) fn hold_cells<T: Real>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    cells: [[usize; 2]; 3],
    by_m: [f64; 3],
    settings: &SolveSettings,
) -> FemReport {
    let distance = by_m.iter().map(|c| c * c).sum::<f64>().sqrt();
    let (mut cycles, mut residual) = (0, 0.0);
    if distance == 0.0 {
        release(model, state);
    } else {
        if state.patch != Some(cells) && !state.take_up(model, cells, by_m.map(|c| c / distance), distance) {
            return report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings);
        }
        state.weigh(model, by_m, distance);
        (cycles, residual) = refine(model, state, settings);
    }
    let moved = output::write(model, state);
    FemReport {
        moved,
        ..report(state, HeldOutcome::Followed, cycles, residual, settings)
    }
}

/// Refines the response that has most left to do until all together meet the tolerance.
fn refine<T: Real>(model: &FemModel<T>, state: &mut FemState<T>, settings: &SolveSettings) -> (u32, f64) {
    let mut cycles = 0;
    loop {
        let used = &state.responses[..state.count];
        let load = used.iter().map(|r| (r.weight_m * r.load).powi(2)).sum::<f64>().sqrt();
        let left = |n: usize| (used[n].weight_m * used[n].residual).abs();
        let residual = (0..used.len()).map(left).sum::<f64>() / load;
        let most = (0..used.len())
            .max_by(|&a, &b| left(a).total_cmp(&left(b)))
            .unwrap_or(0);
        if load == 0.0 {
            return (cycles, 0.0);
        }
        if residual <= settings.relative_tolerance || cycles >= settings.max_cycles {
            return (cycles, residual);
        }
        let share = settings.relative_tolerance * load / used.len() as f64;
        let target = 0.9 * share / used[most].weight_m.abs();
        let spent = state.refine(model, most, target, settings.max_cycles - cycles, settings.max_cycles);
        if spent == 0 {
            return (cycles, residual);
        }
        cycles += spent;
    }
}

/// From one patch to the next of the same size: by how many nodes, and how far the first one was from rest. Nothing
/// where they are far apart, or pushed in different directions.
fn moved_along(
    before: [[usize; 2]; 3],
    now: [[usize; 2]; 3],
    at_m: [f64; 3],
    direction: [f64; 3],
) -> Option<([isize; 3], f64)> {
    let distance = at_m.iter().map(|c| c * c).sum::<f64>().sqrt();
    let along = (0..3).map(|a| at_m[a] * direction[a]).sum::<f64>();
    let by = [0, 1, 2].map(|a| now[a][0] as isize - before[a][0] as isize);
    let same_size = (0..3).all(|a| now[a][1] - now[a][0] == before[a][1] - before[a][0]);
    let near = by.iter().all(|n| n.abs() <= NEXT_PATCH);
    (same_size && near && distance > 0.0 && along > SAME_WAY * distance).then_some((by, distance))
}

vectorised! {
/// `moved` at each node is `u` at the node so many nodes before it, or its own `u` where no element touches that one.
fn shifted<T>(level: &Level<T>, by: [isize; 3], u: &[T], moved: &mut [T]) {
    let (grid, in_use) = (&level.grid, &level.inverse_diagonal);
    for (row, at) in grid.node_spans().enumerate() {
        moved[at.clone()].copy_from_slice(&u[at.clone()]);
        let (j, k) = (row % grid.nodes[1], row / grid.nodes[1]);
        let inside = |n: usize, axis: usize| n.checked_add_signed(-by[axis]).filter(|&n| n < grid.nodes[axis]);
        let (Some(j), Some(k)) = (inside(j, 1), inside(k, 2)) else {
            continue;
        };
        // Past both ends of a line lie nodes that no element touches; only the first line has none before it.
        let line = grid.index([0, j, k]) + at.start % grid.stride;
        let skipped = (by[0].max(0) as usize).saturating_sub(line);
        let from = (line + skipped).saturating_add_signed(-by[0]);
        let count = (at.len() - skipped).min(in_use.len() - from);
        let to = &mut moved[at.start + skipped..][..count];
        let (u, in_use) = (&u[from..][..count], &in_use[from..][..count]);
        for ((to, &u), &in_use) in to.iter_mut().zip(u).zip(in_use) {
            *to = if in_use == T::ZERO { *to } else { u };
        }
    }
}
}

impl<T: Real> FemState<T> {
    /// Takes up another patch: the present displacement becomes the first guess of the response along `direction`,
    /// moved along where the patch is the next one: deep inside a body that would be the answer.
    ///
    /// False if no node in `cells` can move.
    fn take_up(&mut self, model: &FemModel<T>, cells: [[usize; 2]; 3], direction: [f64; 3], distance: f64) -> bool {
        let before = self.patch.map(|patch| (patch, self.held_at_m()));
        if !self.find_nodes(model, cells) {
            return false;
        }
        match before.and_then(|(patch, at_m)| moved_along(patch, cells, at_m, direction)) {
            Some((by, distance)) => {
                self.collapse(1.0 / distance);
                self.shift(model, by);
            }
            None => self.collapse(1.0 / distance),
        }
        let held = &self.patch_nodes[..self.held];
        self.multigrid.hold(&model.levels, held);
        for nodes in &model.loose {
            let part = nodes.first().map(|&node| model.part[node as usize]);
            if held.iter().any(|&node| Some(model.part[node as usize]) == part) {
                continue;
            }
            for &node in nodes {
                self.multigrid.stages[0].inverse_diagonal[node as usize] = T::ZERO;
                self.responses[0].u.iter_mut().for_each(|c| c[node as usize] = T::ZERO);
            }
        }
        self.patch = Some(cells);
        self.count = 1;
        self.begin_response(model, 0, direction);
        true
    }

    fn find_nodes(&mut self, model: &FemModel<T>, cells: [[usize; 2]; 3]) -> bool {
        let level = &model.levels[0];
        let grid = &level.grid;
        let inside = |cell: [usize; 3]| (0..3).all(|a| (cells[a][0]..cells[a][1]).contains(&cell[a]));
        let holds = |place: [usize; 3]| {
            (0..8).any(|corner: usize| {
                let back = [corner & 1, corner >> 1 & 1, corner >> 2];
                let cell = [0, 1, 2].map(|a| place[a].wrapping_sub(back[a]));
                inside(cell) && model.is_cell[grid.index(cell)]
            })
        };
        let any_free = (cells[2][0]..=cells[2][1]).any(|k| {
            (cells[1][0]..=cells[1][1]).any(|j| {
                (cells[0][0]..=cells[0][1])
                    .any(|i| level.inverse_diagonal[grid.index([i, j, k])] != T::ZERO && holds([i, j, k]))
            })
        });
        if !any_free {
            return false;
        }
        self.held = 0;
        for k in cells[2][0]..=cells[2][1] {
            for j in cells[1][0]..=cells[1][1] {
                for i in cells[0][0]..=cells[0][1] {
                    let node = grid.index([i, j, k]);
                    if level.inverse_diagonal[node] != T::ZERO && holds([i, j, k]) {
                        self.patch_nodes[self.held] = node as u32;
                        self.held += 1;
                    }
                }
            }
        }
        true
    }

    /// The present displacement times `scale` becomes response 0.
    fn collapse(&mut self, scale: f64) {
        let [first, others @ ..] = &mut self.responses;
        let count = self.count;
        let weight = T::of(if count > 0 { first.weight_m * scale } else { 0.0 });
        first.u.iter_mut().flatten().for_each(|u| *u = weight * *u);
        for other in others.iter().take(count.saturating_sub(1)) {
            let weight = T::of(other.weight_m * scale);
            for (u, v) in first.u.iter_mut().zip(&other.u) {
                u.iter_mut().zip(v).for_each(|(u, &v)| *u += weight * v);
            }
        }
    }

    /// How far the patch is from rest.
    fn held_at_m(&self) -> [f64; 3] {
        let used = &self.responses[..self.count];
        [0, 1, 2].map(|a| used.iter().map(|r| r.weight_m * r.direction[a]).sum())
    }

    /// Response 0 moved by so many nodes along each axis; nodes that would take theirs from outside the body keep it.
    fn shift(&mut self, model: &FemModel<T>, by: [isize; 3]) {
        let level = &model.levels[0];
        for (u, moved) in self.responses[0].u.iter_mut().zip(&mut self.p) {
            shifted(level.simd, level, by, u, moved);
            std::mem::swap(u, moved);
        }
    }

    fn begin_response(&mut self, model: &FemModel<T>, n: usize, direction: [f64; 3]) {
        let low = self.patch.map_or(0, |cells| cells[2][0].saturating_sub(1));
        let high = self
            .patch
            .map_or(0, |cells| (cells[2][1] + 2).min(model.levels[0].grid.nodes[2]));
        let load = self.load(model, direction, low..high);
        let response = &mut self.responses[n];
        for (u, part) in response.u.iter_mut().zip(direction) {
            for &node in &self.patch_nodes[..self.held] {
                u[node as usize] = T::of(part);
            }
        }
        response.direction = direction;
        response.load = load;
        response.residual = f64::INFINITY;
    }

    /// Expresses the displacement of the patch in the directions known, with a new one if it needs one.
    fn weigh(&mut self, model: &FemModel<T>, by_m: [f64; 3], distance: f64) {
        let mut rest = by_m;
        for response in &mut self.responses[..self.count] {
            response.weight_m = (0..3).map(|a| rest[a] * response.direction[a]).sum();
            for axis in 0..3 {
                rest[axis] -= response.weight_m * response.direction[axis];
            }
        }
        let left = rest.iter().map(|c| c * c).sum::<f64>().sqrt();
        if left <= NEW_DIRECTION * distance || self.count == DIRECTIONS {
            return;
        }
        let n = self.count;
        self.responses[n].u.iter_mut().for_each(|c| c.fill(T::ZERO));
        self.responses[n].weight_m = left;
        self.count += 1;
        self.begin_response(model, n, rest.map(|c| c / left));
    }
}
