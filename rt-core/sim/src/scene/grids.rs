//! Two coarse grids over a body at rest: labels of its cells, and nodes at which hosts get its displacements.

use super::Lattice;
use stylet_settings::{GridInfo, MAX_LABEL_CELLS, MAX_NODES};

/// Nodes at which displacements are published, each with the element that stands for it.
#[derive(Clone, Debug)]
pub struct NodeGrid {
    /// Place and size of the grid.
    pub info: GridInfo,
    /// One for each node, x fastest: the element there, or one near where there is no tissue, so that a host can
    /// interpolate up to the surface.
    pub elements: Vec<u32>,
}

/// Every how many cells a grid over the occupied cells has a point, so that it has at most so many.
struct Steps {
    low: [usize; 3],
    dims: [usize; 3],
    stride: usize,
}

impl Steps {
    fn over(lattice: &Lattice, most: usize) -> Self {
        let [low, high] = lattice.occupied();
        let cells = [0, 1, 2].map(|a| high[a].saturating_sub(low[a]).max(1));
        let dims_at = |stride: usize| cells.map(|n| (n - 1).div_ceil(stride) + 1);
        let fits = |stride: &usize| dims_at(*stride).iter().product::<usize>() <= most;
        let stride = (1..=super::MAX_CELLS_PER_AXIS)
            .find(fits)
            .unwrap_or(super::MAX_CELLS_PER_AXIS);
        Self {
            low,
            dims: dims_at(stride),
            stride,
        }
    }

    fn info(&self, lattice: &Lattice) -> GridInfo {
        GridInfo {
            dims: self.dims.map(|d| d as u32),
            reserved: 0,
            origin_m: self.low.map(|c| (c as f64 + 0.5) * lattice.spacing_m),
            spacing_m: self.stride as f64 * lattice.spacing_m,
        }
    }

    /// Returns the cells of the lattice in the order of the grid.
    fn cells(&self) -> impl Iterator<Item = [usize; 3]> {
        let [nx, ny, nz] = self.dims;
        let (low, stride) = (self.low, self.stride);
        (0..nx * ny * nz).map(move |n| {
            let at = [n % nx, n / nx % ny, n / nx / ny];
            [0, 1, 2].map(|a| low[a] + at[a] * stride)
        })
    }
}

impl NodeGrid {
    /// Returns the grid over a body at rest.
    pub fn of(lattice: &Lattice) -> Self {
        let steps = Steps::over(lattice, MAX_NODES);
        let mut elements: Vec<Option<u32>> = steps
            .cells()
            .map(|cell| nearest(lattice, cell, steps.stride as i64))
            .collect();
        spread(&mut elements, steps.dims);
        Self {
            info: steps.info(lattice),
            elements: elements.into_iter().map(|e| e.unwrap_or(0)).collect(),
        }
    }
}

/// Returns the element in or nearest to a cell, no farther than `reach` cells along any axis.
fn nearest(lattice: &Lattice, cell: [usize; 3], reach: i64) -> Option<u32> {
    let at = |by: [i64; 3]| lattice.element_at([0, 1, 2].map(|a| cell[a] as i64 + by[a]));
    if let Some(element) = at([0; 3]) {
        return Some(element);
    }
    let around = || -reach..=reach;
    around()
        .flat_map(|z| around().flat_map(move |y| around().map(move |x| [x, y, z])))
        .filter_map(|by| Some((by.iter().map(|c| c * c).sum::<i64>(), at(by)?)))
        .min()
        .map(|(_, element)| element)
}

/// Gives nodes without an element that of a neighbour, layer by layer from those that have one.
fn spread(elements: &mut [Option<u32>], [nx, ny, nz]: [usize; 3]) {
    let mut front: Vec<usize> = (0..elements.len()).filter(|&n| elements[n].is_some()).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for n in front {
            let (x, y, z) = (n % nx, n / nx % ny, n / nx / ny);
            let beside = [
                (x > 0).then(|| n - 1),
                (x + 1 < nx).then(|| n + 1),
                (y > 0).then(|| n - nx),
                (y + 1 < ny).then(|| n + nx),
                (z > 0).then(|| n - nx * ny),
                (z + 1 < nz).then(|| n + nx * ny),
            ];
            for m in beside.into_iter().flatten() {
                if elements[m].is_none() {
                    elements[m] = elements[n];
                    next.push(m);
                }
            }
        }
        front = next;
    }
}

/// Returns the structure of cells over the body: 0 for none, else one more than its place in the scene's list.
pub fn label_grid(lattice: &Lattice) -> (GridInfo, Vec<u8>) {
    let steps = Steps::over(lattice, MAX_LABEL_CELLS);
    let label = |[i, j, k]: [usize; 3]| {
        let element = lattice.element_of_cell(i, j, k);
        // 255 structures at most, so that one more still fits.
        element.map_or(0, |e| lattice.structure(e).saturating_add(1))
    };
    (steps.info(lattice), steps.cells().map(label).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::TissueParameters;
    use crate::scene::Scene;
    use crate::tissue::{ChainMailTissue, Held, TissueModel};

    #[test]
    fn every_node_stands_for_the_nearest_element_and_bounds_hold() {
        for name in stylet_settings::BUILTIN_SCENES {
            let lattice = Scene::builtin(name).expect("built in").lattice;
            let grid = NodeGrid::of(&lattice);
            let count = grid.info.node_count().expect("sane");
            println!(
                "{name}: {:?} nodes, {:.2} mm",
                grid.info.dims,
                grid.info.spacing_m * 1e3
            );
            assert!(
                count == grid.elements.len() && (1000..=MAX_NODES).contains(&count),
                "{count}"
            );
            let [nx, ny, _] = grid.info.dims.map(|d| d as usize);
            for (n, &element) in grid.elements.iter().enumerate() {
                let at = [n % nx, n / nx % ny, n / nx / ny];
                let place: Vec<f64> = (0..3)
                    .map(|a| grid.info.origin_m[a] + at[a] as f64 * grid.info.spacing_m)
                    .collect();
                let cell = [0, 1, 2].map(|a| (place[a] / lattice.spacing_m) as usize);
                if let Some(here) = lattice.element_of_cell(cell[0], cell[1], cell[2]) {
                    assert_eq!(element, here, "a node in tissue stands for the element it lies in");
                }
            }
        }
    }

    #[test]
    fn displacements_at_nodes_are_those_of_their_elements() {
        let scene = Scene::builtin("paper").expect("built in");
        let limits = TissueParameters::default().validate().expect("defaults");
        let mut tissue = ChainMailTissue::new(&scene, limits);
        let element = scene.nodes.elements[scene.nodes.elements.len() / 2];
        let rest = scene.lattice.rest_m(element);
        let held = Held {
            element,
            position_m: [rest[0] + 2e-3, rest[1], rest[2] + 6e-3],
            patch_m: 0.0,
        };
        tissue.step(Some(held), 5e-3);
        let body = tissue.deformed();
        let mut displacements_m = vec![[f32::NAN; 3]; scene.nodes.elements.len()];
        body.write_displacements(&scene.nodes.elements, &mut displacements_m);
        for (displacements_m, &element) in displacements_m.iter().zip(&scene.nodes.elements) {
            let (now, rest) = (body.position_m(element), scene.lattice.rest_m(element));
            for a in 0..3 {
                assert!((f64::from(displacements_m[a]) - (now[a] - rest[a])).abs() < 1e-8);
            }
        }
        assert!(displacements_m.iter().any(|u| u[2] > 4e-3), "the body has moved");
    }

    /// `cargo test --profile quick -p stylet-sim --lib time_to_write_displacements -- --ignored --nocapture`
    #[test]
    #[ignore = "a measurement"]
    fn time_to_write_displacements() {
        for name in stylet_settings::BUILTIN_SCENES {
            let scene = Scene::builtin(name).expect("built in");
            let limits = TissueParameters::default().validate().expect("defaults");
            let mut tissue = ChainMailTissue::new(&scene, limits);
            let mut displacements_m = vec![[0.0; 3]; scene.nodes.elements.len()];
            let mut times_us: Vec<f64> = (0..1000)
                .map(|_| {
                    // As in the loop, other memory is touched in between.
                    tissue.step(None, 5e-3);
                    let body = tissue.deformed();
                    let start = std::time::Instant::now();
                    body.write_displacements(&scene.nodes.elements, &mut displacements_m);
                    start.elapsed().as_secs_f64() * 1e6
                })
                .collect();
            times_us.sort_by(f64::total_cmp);
            println!(
                "{name}: {} nodes, p50 {:.1} us, p99 {:.1} us",
                displacements_m.len(),
                times_us[500],
                times_us[990]
            );
        }
    }

    #[test]
    fn labels_count_as_many_cells_as_there_are_elements() {
        let scene = Scene::builtin("pelvis").expect("built in");
        let (info, labels) = label_grid(&scene.lattice);
        assert_eq!(info.spacing_m, scene.lattice.spacing_m, "all cells fit");
        let tissue = labels.iter().filter(|&&l| l != 0).count();
        assert_eq!(tissue, scene.lattice.element_count());
        let extents = scene.lattice.extents(scene.structures.len());
        for (number, extent) in extents.iter().enumerate() {
            let cells = labels.iter().filter(|&&l| usize::from(l) == number + 1).count();
            assert_eq!(cells as u32, extent.elements, "{}", scene.structures[number].name);
        }
    }
}
