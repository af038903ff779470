//! Refinement of the counts by the fit: for a doubtful signal, one seed more and one fewer are
//! fitted too.
//!
//! The signal of a component alone does not distinguish two strong seeds from three faint ones; the
//! fit of the voxels does.

use super::components::Component;
use super::counts::{Counts, MOST_OFF};
use super::shape::Line;
use super::split::{Fitted, Fitter};

/// Probability by the signal below which single seeds are fitted again; seeds that touch another
/// always are.
const SURE: f64 = 0.98;
/// Reduction of the sum of squares that another count must bring, unless the number of seeds
/// requires it.
const WORTHWHILE: f64 = 12.0;
/// Largest cost of a count that the number of seeds requires; beyond it a doubt is reported.
const MOST_COST: f64 = 400.0;
/// Most changes.
const CHANGES: usize = 8;

/// Present fits of the components.
pub struct Fits {
    /// Seeds of each component.
    pub lines: Vec<Vec<Line>>,
    /// Seeds with the statistics of their fit.
    pub fitted: Vec<Fitted>,
    /// Contribution of all seeds to every voxel.
    pub field: Vec<f64>,
    /// Value of the tissue around each component above that of the volume.
    pub tissue: Vec<f64>,
}

/// Another count for a component, with its seeds and the increase of the sum of squares, including
/// that of the signal. More seeds always explain the voxels a little better, which does not justify
/// a count that the signal excludes.
struct Change {
    component: usize,
    lines: Vec<Line>,
    cost: f64,
    is_more: bool,
}

impl Fitter<'_> {
    /// Changes counts by one if the fit requires it: towards the number of seeds if `wanted`, and
    /// between components.
    pub fn settle(&self, components: &[Component], fits: &mut Fits, counts: &mut Counts, wanted: Option<usize>) {
        let is_open = |n: &usize| counts.seeds[*n] > 1 || (counts.seeds[*n] == 1 && counts.probability(*n) < SURE);
        let doubtful = (0..components.len()).filter(is_open);
        let mut changes: Vec<Change> = Vec::new();
        for n in doubtful.collect::<Vec<_>>() {
            changes.extend(self.changes(components, fits, counts, n));
        }
        if wanted.is_none() {
            // Streaks are explained better by each further seed, which the signal does not have.
            changes.retain(|change| is_of_signal(counts, change));
        }
        for _ in 0..CHANGES {
            let total: usize = counts.seeds.iter().sum();
            let Some(chosen) = choose(&changes, total, wanted) else {
                return;
            };
            for Change {
                component: n, lines, ..
            } in chosen.iter().map(|&at| &changes[at])
            {
                let (n, lines) = (*n, lines.clone());
                self.spread(&components[n], &fits.lines[n], -1.0, &mut fits.field);
                let task = self.task(&components[n], Some(&fits.field), fits.tissue[n]);
                counts.seeds[n] = lines.len();
                fits.fitted[n] = self.fitted(&task, &lines);
                self.spread(&components[n], &lines, 1.0, &mut fits.field);
                fits.lines[n] = lines;
            }
            let changed: Vec<usize> = chosen.iter().map(|&at| changes[at].component).collect();
            changes.retain(|change| !changed.contains(&change.component));
            for n in changed {
                changes.extend(self.changes(components, fits, counts, n));
            }
            if wanted.is_none() {
                changes.retain(|change| is_of_signal(counts, change));
            }
        }
    }

    /// Tries one seed more, and one fewer if one remains.
    fn changes(&self, components: &[Component], fits: &mut Fits, by_signal: &Counts, n: usize) -> Vec<Change> {
        let component = &components[n];
        let own = fits.lines[n].clone();
        self.spread(component, &own, -1.0, &mut fits.field);
        let task = self.task(component, Some(&fits.field), fits.tissue[n]);
        self.spread(component, &own, 1.0, &mut fits.field);
        let before = self.residuals(&task, &own).norm_squared();
        let others = [own.len().checked_sub(1).filter(|&count| count > 0), Some(own.len() + 1)];
        let other = |count: usize| {
            let mut lines = self.starts(&task, component, count);
            self.improve(&task, &mut lines);
            self.exchange(&task, component, &mut lines);
            let of_signal = by_signal.cost(n, count) - by_signal.cost(n, own.len());
            Change {
                component: n,
                cost: self.residuals(&task, &lines).norm_squared() - before + of_signal,
                is_more: count > own.len(),
                lines,
            }
        };
        others.into_iter().flatten().map(other).collect()
    }
}

/// Returns whether the signal of a component allows a change of its count.
fn is_of_signal(counts: &Counts, change: &Change) -> bool {
    (counts.signal(change.component) - change.lines.len() as f64).abs() < MOST_OFF
}

/// Returns the indices of the changes to make next; none without a gain.
fn choose(changes: &[Change], total: usize, wanted: Option<usize>) -> Option<Vec<usize>> {
    let best = |is_more: bool, but: Option<usize>| {
        let fits = |&at: &usize| changes[at].is_more == is_more && Some(changes[at].component) != but;
        let all = (0..changes.len()).filter(fits);
        all.min_by(|&a, &b| changes[a].cost.total_cmp(&changes[b].cost))
    };
    let Some(wanted) = wanted else {
        let one = [best(true, None), best(false, None)].into_iter().flatten();
        let one = one.min_by(|&a, &b| changes[a].cost.total_cmp(&changes[b].cost))?;
        return (changes[one].cost < -WORTHWHILE).then(|| vec![one]);
    };
    if total != wanted {
        let one = best(total < wanted, None)?;
        return (changes[one].cost < MOST_COST).then(|| vec![one]);
    }
    let more = best(true, None)?;
    let fewer = best(false, Some(changes[more].component))?;
    (changes[more].cost + changes[fewer].cost < -WORTHWHILE).then(|| vec![more, fewer])
}
