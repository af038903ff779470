//! Rasterisation of contours: a voxel belongs to a structure that covers at least half of it in the
//! plane of the slice.

use super::super::super::element::short;
use super::super::super::overlap;
use super::super::images::Grid;
use super::planes::{Polygon, WIDEST, by_height};
use super::solid::Solid;
use super::{Contoured, SAME_PLANE_M};
use crate::error::ContentError;
use std::ops::Range;

/// Number of lines across each row of voxels along which coverage is measured.
const LINES: usize = 4;
/// Most crossings of lines and edges in one file; a pelvis on fine images has some million.
const MAX_CROSSINGS: f64 = 1e7;
/// Most voxels checked and painted in one file; a whole pelvis has some ten million.
const MAX_VOXELS_TOUCHED: f64 = 1.5e8;
const MAX_RUNS: f64 = 2e7;

/// Range of columns, the end exclusive, in a row of a slice.
#[derive(Clone, Copy)]
struct Run {
    row: u32,
    from: u32,
    to: u32,
}

/// Share of the work allowed for a file that is done so far.
#[derive(Default)]
struct Work(f64);

impl Work {
    fn spend(&mut self, count: f64, most: f64) -> Result<(), ContentError> {
        self.0 += count / most;
        match self.0 <= 1.0 {
            true => Ok(()),
            false => Err(
                "its contours are too large or too many to be drawn; export fewer structures, or ones with fewer corners"
                    .into(),
            ),
        }
    }
}

/// Returns the labels 1, 2, ... of the structures in their order, and their overlaps in words.
pub fn labels(structures: &[Contoured], grid: &Grid) -> Result<(Vec<u8>, Vec<String>), ContentError> {
    let mut work = Work::default();
    let mut all = Vec::new();
    for structure in structures {
        all.push(runs(structure, grid, &mut work)?);
    }
    let painted: u32 = all.iter().flatten().map(|r| r.to - r.from).sum();
    work.spend(f64::from(painted), MAX_VOXELS_TOUCHED)?;
    let sizes: Vec<usize> = all
        .iter()
        .map(|runs| runs.iter().map(|r| (r.to - r.from) as usize).sum())
        .collect();
    let mut order: Vec<usize> = (0..all.len()).collect();
    // Larger ones first, so that structures inside them are painted over them.
    order.sort_by_key(|&s| (std::cmp::Reverse(sizes[s]), s));
    let mut labels = vec![0_u8; grid.dims.iter().product()];
    let mut taken = vec![0_usize; all.len() + 1];
    for s in order {
        for run in &all[s] {
            let row = run.row as usize * grid.dims[0];
            for label in &mut labels[row + run.from as usize..row + run.to as usize] {
                taken[usize::from(*label)] += 1;
                *label = s as u8 + 1;
            }
        }
    }
    let mut notes: Vec<String> = structures
        .iter()
        .zip(&sizes)
        .filter(|(_, size)| **size == 0)
        .map(|(c, _)| format!("{} covers no voxel of the images", short(&c.name)))
        .collect();
    let lost = structures.iter().zip(&taken[1..]).zip(&sizes);
    let lost = lost.map(|((structure, taken), size)| (short(&structure.name), *taken, *size));
    notes.extend(overlap::lost(lost, grid.frame.spacing_m.iter().product()));
    Ok((labels, notes))
}

fn runs(structure: &Contoured, grid: &Grid, work: &mut Work) -> Result<Vec<Run>, ContentError> {
    let Some(planes) = planes(structure, grid) else {
        return runs_of_solid(structure, grid, work);
    };
    let heights: Vec<f64> = planes.iter().map(|(h, _)| *h).collect();
    let mut runs = Vec::new();
    // A single plane fills the slice it is in.
    for (plane, [from, to]) in planes.iter().zip(slabs(&heights, 1.0)) {
        let mut covered: Option<Vec<Run>> = None;
        // Centres of slices from the lower end of a slab up to its upper end.
        let (first, last) = (
            (from - 1e-6).ceil().max(0.0),
            (to - 1e-6).ceil().min(grid.dims[2] as f64),
        );
        for slice in first as usize..last.max(0.0) as usize {
            if covered.is_none() {
                covered = Some(fill(&plane.1, [grid.dims[0], grid.dims[1]], work)?);
            }
            let covered = covered.as_deref().unwrap_or_default();
            work.spend(covered.len() as f64, MAX_RUNS)?;
            let base = (slice * grid.dims[1]) as u32;
            runs.extend(covered.iter().map(|r| Run {
                row: base + r.row,
                ..*r
            }));
        }
    }
    Ok(runs)
}

/// Rasterises contours across the slices: a voxel belongs to the enclosed body if five of nine
/// points in it do.
fn runs_of_solid(structure: &Contoured, grid: &Grid, work: &mut Work) -> Result<Vec<Run>, ContentError> {
    let solid = Solid::across(structure, grid.frame.spacing_m[2])?;
    let [low, high] = solid.extent(&grid.frame);
    let range = |a: usize| {
        let first = low[a].floor().clamp(0.0, grid.dims[a] as f64) as usize;
        first..(high[a].ceil() + 1.0).clamp(0.0, grid.dims[a] as f64) as usize
    };
    let touched: usize = (0..3).map(|a| range(a).len()).product();
    work.spend(touched as f64, MAX_VOXELS_TOUCHED)?;
    let holds = |at: [usize; 3]| {
        let part = |n: usize| {
            let place = [0, 1, 2].map(|a| at[a] as f64 + if n >> a & 1 == 0 { -0.25 } else { 0.25 });
            solid.contains(grid.frame.place_m(place).into())
        };
        // With the centre as the ninth there is no tie, which would favour one side.
        let middle = solid.contains(grid.frame.place_m(at.map(|i| i as f64)).into());
        (0..8).filter(|&n| part(n)).count() + usize::from(middle) >= 5
    };
    let mut runs: Vec<Run> = Vec::new();
    for k in range(2) {
        for j in range(1) {
            let row = (k * grid.dims[1] + j) as u32;
            for i in range(0).filter(|&i| holds([i, j, k])) {
                let at = i as u32;
                match runs.last_mut() {
                    Some(run) if run.row == row && run.to == at => run.to = at + 1,
                    _ => runs.push(Run {
                        row,
                        from: at,
                        to: at + 1,
                    }),
                }
            }
        }
    }
    work.spend(runs.len() as f64, MAX_RUNS)?;
    Ok(runs)
}

/// Returns the contours by the height of their plane, in slices; `None` if they do not lie in the
/// slices.
pub fn planes(structure: &Contoured, grid: &Grid) -> Option<Vec<(f64, Vec<Polygon>)>> {
    let step_m = grid.frame.spacing_m[2];
    let mut placed = Vec::new();
    for contour in &structure.contours {
        let corners: Vec<[f64; 3]> = contour.iter().map(|p| grid.frame.index_of(*p)).collect();
        let height = corners.iter().map(|c| c[2]).sum::<f64>() / corners.len() as f64;
        let off_m = corners.iter().map(|c| (c[2] - height).abs()).fold(0.0, f64::max) * step_m;
        if off_m > 10.0 * SAME_PLANE_M {
            return None;
        }
        placed.push((height, corners.into_iter().map(|[x, y, _]| [x, y]).collect()));
    }
    Some(by_height(placed, SAME_PLANE_M / step_m))
}

/// Returns the slab of each plane: half-way to its neighbours, but no farther than half of the
/// usual distance across a gap; `single` is the thickness of one without neighbours.
pub fn slabs(heights: &[f64], single: f64) -> Vec<[f64; 2]> {
    let mut gaps: Vec<f64> = heights.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let usual = gaps.get(gaps.len() / 2).copied().unwrap_or(single);
    let half = |gap: f64| if gap > WIDEST * usual { usual / 2.0 } else { gap / 2.0 };
    (0..heights.len())
        .map(|i| {
            let below = if i > 0 {
                half(heights[i] - heights[i - 1])
            } else {
                usual / 2.0
            };
            let above = heights.get(i + 1).map_or(usual / 2.0, |next| half(next - heights[i]));
            [heights[i] - below, heights[i] + above]
        })
        .collect()
}

/// Fills by the even-odd rule: the overlap of two contours of a plane is a hole, and so is the end
/// of a keyhole.
fn fill(polygons: &[Polygon], [columns, rows]: [usize; 2], work: &mut Work) -> Result<Vec<Run>, ContentError> {
    let mut crossed: Vec<(u32, f64)> = Vec::new();
    for polygon in polygons {
        let next = polygon.iter().cycle().skip(1);
        for (a, b) in polygon.iter().zip(next) {
            cross(*a, *b, rows, &mut crossed, work)?;
        }
    }
    crossed.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut runs = Vec::new();
    let mut covered = Coverage::new(columns);
    for of_row in crossed.chunk_by(|a, b| a.0 / LINES as u32 == b.0 / LINES as u32) {
        for line in of_row.chunk_by(|a, b| a.0 == b.0) {
            covered.add_line(line);
        }
        work.spend(covered.touched.len() as f64, MAX_VOXELS_TOUCHED)?;
        covered.take_row(of_row[0].0 / LINES as u32, &mut runs);
    }
    Ok(runs)
}

/// Records where an edge crosses the lines. A voxel reaches half a step to each side of its index.
fn cross(
    a: [f64; 2],
    b: [f64; 2],
    rows: usize,
    crossed: &mut Vec<(u32, f64)>,
    work: &mut Work,
) -> Result<(), ContentError> {
    let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
    let line_of = |y: f64| (y + 0.5) * LINES as f64 - 0.5;
    let most = (rows * LINES) as f64;
    let first = line_of(low[1]).ceil().clamp(0.0, most);
    let last = line_of(high[1]).ceil().clamp(0.0, most);
    work.spend(last - first, MAX_CROSSINGS)?;
    for line in first as usize..last as usize {
        let y = (line as f64 + 0.5) / LINES as f64 - 0.5;
        let share = (y - low[1]) / (high[1] - low[1]);
        crossed.push((line as u32, low[0] + share * (high[0] - low[0])));
    }
    Ok(())
}

/// Coverage of each voxel by the lines of one row.
struct Coverage {
    /// Coverage of voxels in which a line begins or ends.
    ends: Vec<f64>,
    /// Difference, from the voxel before, in coverage by lines that pass right through.
    through: Vec<f64>,
    /// Columns outside of which coverage is zero.
    touched: Range<usize>,
}

impl Coverage {
    fn new(columns: usize) -> Self {
        Self {
            ends: vec![0.0; columns + 1],
            through: vec![0.0; columns + 1],
            touched: 0..0,
        }
    }

    /// Adds a line with its crossings in order.
    fn add_line(&mut self, line: &[(u32, f64)]) {
        let columns = self.ends.len() - 1;
        for pair in line.chunks_exact(2) {
            let [from, to] = [pair[0].1 + 0.5, pair[1].1 + 0.5].map(|x| x.clamp(0.0, columns as f64));
            let (first, last) = (from as usize, to as usize);
            self.touched = if self.touched.is_empty() {
                first..last + 1
            } else {
                self.touched.start.min(first)..self.touched.end.max(last + 1)
            };
            if first == last {
                self.ends[first] += to - from;
                continue;
            }
            self.ends[first] += (first + 1) as f64 - from;
            self.ends[last] += to - last as f64;
            self.through[first + 1] += 1.0;
            self.through[last] -= 1.0;
        }
    }

    /// Appends the runs of a row with coverage of at least half, and resets for the next row.
    fn take_row(&mut self, row: u32, runs: &mut Vec<Run>) {
        let (mut through, mut begun) = (0.0, None);
        let touched = std::mem::take(&mut self.touched);
        let columns = self.ends.len() - 1;
        for x in touched.clone() {
            through += self.through[x];
            let share = (through + self.ends[x]) / LINES as f64;
            match (share >= 0.5 - 1e-9 && x < columns, begun) {
                (true, None) => begun = Some(x as u32),
                (false, Some(from)) => {
                    runs.push(Run {
                        row,
                        from,
                        to: x as u32,
                    });
                    begun = None;
                }
                _ => {}
            }
        }
        if let Some(from) = begun {
            let to = touched.end as u32;
            runs.push(Run { row, from, to });
        }
        self.ends[touched.clone()].fill(0.0);
        self.through[touched].fill(0.0);
    }
}
