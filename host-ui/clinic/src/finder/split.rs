//! Fit of components by seeds: least squares over place, direction and signal of each (Levenberg
//! and Marquardt).

use super::Search;
use super::components::{Component, place_m};
use super::counts::{Counts, median};
use super::level::Level;
use super::settle::Fits;
use super::shape::{Line, Look, Patch};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use stylet_files::VoxelValues;

/// Parameters of a seed: place in mm (three), two turns in rad, signal.
const PARAMETERS: usize = 6;
const M_PER_MM: f64 = 1e-3;
/// Steps of the numerical derivatives, in those units.
const STEPS: [f64; PARAMETERS] = [0.02, 0.02, 0.02, 0.02, 0.02, 0.01];
const ITERATIONS: usize = 40;
/// Standard deviation of the signal of one seed, as a share.
const SIGNAL_SPREAD: f64 = 0.1;
/// Standard deviation of a seed's direction about the common one, as a sine.
const TURN_SPREAD: f64 = 0.4;
/// Rows of a seed in addition to the voxels: its signal, and two of its direction.
const OWN_ROWS: usize = 3;
/// Deviation of the model from a real seed, as a share of the highest voxel.
const OFF_SHAPE: f64 = 0.05;
/// Candidate blurs of scanners, m.
const BLURS_M: [f64; 6] = [0.3e-3, 0.45e-3, 0.6e-3, 0.75e-3, 0.95e-3, 1.2e-3];
/// Number of single seeds for the estimate of the blur.
const CALIBRATED: usize = 10;
/// Number of passes over all components.
const SWEEPS: usize = 3;

/// Fitted seeds of a component.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fitted {
    /// Seeds, each with the standard deviation of its place, in m; none for an object that is not a
    /// seed.
    pub seeds: Vec<(Line, f64)>,
    /// Share of the squared signal that they explain.
    pub explained: f64,
}

/// Fitter of the components of one volume.
pub struct Fitter<'a> {
    /// The CT.
    pub volume: &'a VoxelValues<f32>,
    /// Reference values of voxels.
    pub level: &'a Level,
    /// Model of the seeds.
    pub look: Look,
    /// Common direction of all seeds, and two perpendicular to it.
    pub axes: [Vector3<f64>; 3],
}

/// Fit of a component in progress.
pub struct Task {
    /// Voxels.
    pub patch: Patch,
    /// Values above the tissue, without the contribution of neighbours.
    pub data: Vec<f64>,
    /// Weight of each residual.
    per_value: f64,
    /// Value from which data are saturated.
    saturated: f64,
}

impl<'a> Fitter<'a> {
    /// Creates a fitter with the blur and the signal that fit single seeds best.
    pub fn calibrated(
        volume: &'a VoxelValues<f32>,
        level: &'a Level,
        search: &Search,
        components: &[Component],
        counts: &Counts,
    ) -> Self {
        let look = Look {
            length_m: search.length_m,
            diameter_m: search.diameter_m,
            blur_m: BLURS_M[2],
            signal: counts.of_one.max(f64::MIN_POSITIVE),
        };
        let mut fitter = Self {
            volume,
            level,
            look,
            axes: [Vector3::z(), Vector3::x(), Vector3::y()],
        };
        let mut singles: Vec<usize> = (0..components.len()).filter(|&n| counts.seeds[n] == 1).collect();
        // Those whose signal is nearest to that of one seed.
        singles.sort_by(|a, b| {
            (counts.signal(*a) - 1.0)
                .abs()
                .total_cmp(&(counts.signal(*b) - 1.0).abs())
        });
        singles.truncate(CALIBRATED);
        let tasks: Vec<(Task, &Component)> = singles
            .iter()
            .map(|&n| (fitter.task(&components[n], None, components[n].tissue), &components[n]))
            .collect();
        let mut best = (f64::INFINITY, fitter.look, Matrix3::zeros());
        for blur_m in BLURS_M {
            fitter.look = Look { blur_m, ..look };
            let (mut cost, mut amounts, mut turns) = (0.0, Vec::new(), Matrix3::zeros());
            for (task, component) in &tasks {
                let mut lines = vec![fitter.start(component, &task.data)];
                cost += fitter.improve(task, &mut lines);
                amounts.push(lines[0].amount);
                turns += lines[0].axis * lines[0].axis.transpose();
            }
            if cost < best.0 && !amounts.is_empty() {
                let signal = look.signal * median(amounts);
                best = (cost, Look { blur_m, signal, ..look }, turns);
            }
        }
        fitter.look = best.1;
        if best.0.is_finite() {
            let eigen = best.2.symmetric_eigen();
            let axis: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
            let [across, other] = two_across(&axis);
            fitter.axes = [axis, across, other];
        }
        fitter
    }

    /// Fits every component; then again, with counts from the signal that remains once neighbours
    /// and surroundings are known.
    pub fn fit_all(
        &self,
        components: &[Component],
        first: &Counts,
        wanted: Option<usize>,
        count: impl Fn(&[f64]) -> Counts,
    ) -> (Vec<Fitted>, Counts) {
        let mut field = vec![0.0; self.volume.values.len()];
        let mut lines: Vec<Vec<Line>> = vec![Vec::new(); components.len()];
        let mut fits = vec![Fitted::default(); components.len()];
        let mut counts = first.clone();
        let mut tissue: Vec<f64> = components.iter().map(|component| component.tissue).collect();
        for sweep in 0..SWEEPS {
            for (n, component) in components.iter().enumerate() {
                if counts.seeds[n] == 0 && lines[n].is_empty() {
                    continue;
                }
                self.spread(component, &lines[n], -1.0, &mut field);
                tissue[n] = self.tissue_near(component, &lines[n], &field);
                let task = self.task(component, Some(&field), tissue[n]);
                if lines[n].len() != counts.seeds[n] {
                    lines[n] = self.starts(&task, component, counts.seeds[n]);
                }
                self.improve(&task, &mut lines[n]);
                if sweep == 1 {
                    self.exchange(&task, component, &mut lines[n]);
                }
                fits[n] = self.fitted(&task, &lines[n]);
                self.spread(component, &lines[n], 1.0, &mut field);
            }
            if sweep + 1 < SWEEPS {
                counts = count(&self.signals(components, &lines, &field, &tissue));
            }
        }
        let mut all = Fits {
            lines,
            fitted: fits,
            field,
            tissue,
        };
        self.settle(components, &mut all, &mut counts, wanted);
        (all.fitted, counts)
    }

    /// Returns the data of a component's fit, without the contribution of `neighbours` and `tissue`
    /// to its voxels.
    pub fn task(&self, component: &Component, neighbours: Option<&[f64]>, tissue: f64) -> Task {
        let of_others = |n: &usize| neighbours.map_or(0.0, |field| field[*n]);
        let data: Vec<f64> = component
            .voxels
            .iter()
            .zip(&component.excess)
            .map(|(n, e)| e - tissue - of_others(n))
            .collect();
        let highest = component.excess.iter().copied().fold(0.0, f64::max);
        let saturated = self
            .level
            .saturated
            .map_or(f64::INFINITY, |value| value - self.level.tissue);
        Task {
            patch: Patch::of(self.volume.dims, self.volume.frame.spacing_m, &component.voxels),
            data,
            per_value: 1.0 / self.level.noise.hypot(OFF_SHAPE * highest),
            saturated,
        }
    }

    /// Adds seeds to the field of all, in the box of their component with a margin for the
    /// neighbours.
    pub fn spread(&self, component: &Component, lines: &[Line], share: f64, field: &mut [f64]) {
        if lines.is_empty() {
            return;
        }
        let (dims, spacing_m) = (self.volume.dims, self.volume.frame.spacing_m);
        let patch = Patch::of(dims, spacing_m, &component.voxels);
        let voxels = patch.with_room(dims, 2);
        let patch = Patch::of(dims, spacing_m, &voxels);
        let mut values = vec![0.0; voxels.len()];
        lines
            .iter()
            .for_each(|line| patch.add(line, &self.look, share, &mut values));
        voxels.iter().zip(values).for_each(|(n, value)| field[*n] += value);
    }

    /// Returns one seed along the largest extent of the signal.
    fn start(&self, component: &Component, data: &[f64]) -> Line {
        let mut spread = Matrix3::zeros();
        let mut weight = 0.0;
        for (n, value) in component.voxels.iter().zip(data) {
            let off = place_m(self.volume, *n) - component.middle_m;
            spread += off * off.transpose() * value.max(0.0);
            weight += value.max(0.0);
        }
        // Voxels are longer along some axes, which is not the seed's extent.
        let sides = Vector3::from(self.volume.frame.spacing_m);
        let spread =
            spread / weight.max(f64::MIN_POSITIVE) - Matrix3::from_diagonal(&sides.component_mul(&sides)) / 12.0;
        let eigen = spread.symmetric_eigen();
        let longest = eigen.eigenvalues.imax();
        Line {
            middle_m: component.middle_m,
            axis: eigen.eigenvectors.column(longest).normalize(),
            amount: 1.0,
        }
    }

    /// Returns the residuals in standard deviations: voxels, then the signals of the seeds.
    pub fn residuals(&self, task: &Task, lines: &[Line]) -> DVector<f64> {
        let voxels = task.data.len();
        let mut model = vec![0.0; voxels];
        lines
            .iter()
            .for_each(|line| task.patch.add(line, &self.look, 1.0, &mut model));
        DVector::from_fn(voxels + OWN_ROWS * lines.len(), |n, _| match n.checked_sub(voxels) {
            Some(own) => self.own_rows(&lines[own / OWN_ROWS])[own % OWN_ROWS],
            // A saturated value is only a lower bound.
            None if task.data[n] >= task.saturated && model[n] > task.data[n] => 0.0,
            None => (model[n] - task.data[n]) * task.per_value,
        })
    }

    /// Returns the deviation of a seed's signal and direction from the common ones.
    fn own_rows(&self, line: &Line) -> [f64; OWN_ROWS] {
        [
            (line.amount - 1.0) / SIGNAL_SPREAD,
            line.axis.dot(&self.axes[1]) / TURN_SPREAD,
            line.axis.dot(&self.axes[2]) / TURN_SPREAD,
        ]
    }

    fn jacobian(&self, task: &Task, lines: &[Line]) -> DMatrix<f64> {
        let voxels = task.data.len();
        let mut all = DMatrix::zeros(voxels + OWN_ROWS * lines.len(), PARAMETERS * lines.len());
        for seed in 0..lines.len() {
            for (p, step) in STEPS.iter().enumerate() {
                let side = |sign: f64| {
                    let mut change = [0.0; PARAMETERS];
                    change[p] = sign * step;
                    let moved = changed(&lines[seed], &change);
                    let mut values = vec![0.0; voxels];
                    task.patch.add(&moved, &self.look, task.per_value, &mut values);
                    values.extend(self.own_rows(&moved));
                    values
                };
                let (up, down) = (side(1.0), side(-1.0));
                for (n, (up, down)) in up.iter().zip(&down).enumerate() {
                    let row = if n < voxels { n } else { n + OWN_ROWS * seed };
                    all[(row, PARAMETERS * seed + p)] = (up - down) / (2.0 * step);
                }
            }
        }
        all
    }

    /// Moves seeds to the smallest sum of squares, and returns it.
    pub fn improve(&self, task: &Task, lines: &mut Vec<Line>) -> f64 {
        let mut residuals = self.residuals(task, lines);
        let (mut cost, mut damping) = (residuals.norm_squared(), 1e-2);
        for _ in 0..ITERATIONS {
            let jacobian = self.jacobian(task, lines);
            let (normal, slope) = (jacobian.transpose() * &jacobian, jacobian.transpose() * &residuals);
            let before = cost;
            while damping < 1e6 {
                let mut damped = normal.clone();
                for n in 0..damped.nrows() {
                    damped[(n, n)] += damping * normal[(n, n)].max(1e-6);
                }
                let step = damped.cholesky().map(|c| -c.solve(&slope));
                let moved: Option<Vec<Line>> = step.map(|step| {
                    let of_seed = |n: usize| std::array::from_fn(|p| step[PARAMETERS * n + p].clamp(-1.0, 1.0));
                    lines
                        .iter()
                        .enumerate()
                        .map(|(n, line)| changed(line, &of_seed(n)))
                        .collect()
                });
                if let Some(moved) = moved {
                    let after = self.residuals(task, &moved);
                    if after.norm_squared() < cost {
                        (cost, residuals, *lines) = (after.norm_squared(), after, moved);
                        damping = (damping / 5.0).max(1e-6);
                        break;
                    }
                }
                damping *= 5.0;
            }
            if cost > before * (1.0 - 1e-4) {
                break;
            }
        }
        cost
    }

    /// Returns the seeds of a component with the uncertainties of the fit.
    pub fn fitted(&self, task: &Task, lines: &[Line]) -> Fitted {
        let residuals = self.residuals(task, lines);
        let of_voxels: f64 = residuals.iter().take(task.data.len()).map(|r| r * r).sum();
        let whole: f64 = task.data.iter().map(|v| (v * task.per_value).powi(2)).sum();
        let jacobian = self.jacobian(task, lines);
        let mut normal = jacobian.transpose() * &jacobian;
        for n in 0..normal.nrows() {
            // A direction that the data do not determine is arbitrary.
            normal[(n, n)] += 1e-3;
        }
        // Noise and shape are in the weights; a worse fit is less certain.
        let spread = (of_voxels / task.data.len().max(1) as f64).max(1.0);
        let covariance = normal.try_inverse();
        let variance = |n: usize| covariance.as_ref().map_or(f64::INFINITY, |c| c[(n, n)]) * spread;
        let seed = |(n, line): (usize, &Line)| {
            let square = (0..3).map(|a| variance(PARAMETERS * n + a)).sum::<f64>();
            (*line, square.sqrt() * M_PER_MM)
        };
        Fitted {
            seeds: lines.iter().enumerate().map(seed).collect(),
            explained: 1.0 - of_voxels / whole.max(f64::MIN_POSITIVE),
        }
    }
}

/// Returns a seed after a change of place, direction and signal.
fn changed(line: &Line, by: &[f64; PARAMETERS]) -> Line {
    let [across, other] = two_across(&line.axis);
    Line {
        middle_m: line.middle_m + Vector3::new(by[0], by[1], by[2]) * M_PER_MM,
        axis: (line.axis + across * by[3] + other * by[4]).normalize(),
        amount: (line.amount + by[5]).clamp(0.4, 2.0),
    }
}

fn two_across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if axis.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    let across = axis.cross(&helper).normalize();
    [across, axis.cross(&across)]
}
