//! The plan in the form that a frame shows, made once per change.

use super::jobs::JobProgress;
use super::needles::{NeedleProgress, NeedleState};
use super::outlines::AnatomyOutlines;
use super::review::ReviewShown;
use std::sync::Arc;
use stylet_dose::Seed;
use stylet_implant::plan::check::Problem;
use stylet_implant::plan::compensate::edges::Sensitive;
use stylet_implant::plan::first::FirstPlan;
use stylet_implant::plan::{Compensation, History, ImplantPlan, Needle};

/// State of plans of many needles that a frame shows.
#[derive(Clone, Default)]
pub struct Planning {
    /// Outlines; `None` until the scene's anatomy is known.
    pub outlines: Option<Arc<AnatomyOutlines>>,
    /// Plan; `None` without a plan of many needles.
    pub implant: Option<Arc<Implant>>,
    /// Background job for it, if one runs.
    pub job: Option<JobProgress>,
    /// Progress of its needles.
    pub progress: NeedleProgress,
    /// Plans of the last search, to choose from.
    pub proposals: Option<Arc<Vec<FirstPlan>>>,
    /// True if there is no plan, and a discarded one can be restored.
    pub can_restore: bool,
    /// Drawing on the live picture, and the update of the plan based on it.
    pub review: ReviewShown,
}

impl Planning {
    /// Returns the next needle that has seeds.
    pub fn next_needle(&self) -> Option<usize> {
        let needles = self.implant.as_ref()?.plan.needles.iter().enumerate();
        let mut left = needles.skip(self.progress.begun()).filter(|(_, n)| !n.seeds.is_empty());
        left.next().map(|(number, _)| number)
    }

    /// Returns whether there is a plan and none of its needles was inserted.
    pub fn waits(&self) -> bool {
        self.implant.is_some() && self.progress.begun() == 0
    }

    /// Returns the distance between two seeds of the present needle, centre to centre, m, if it is
    /// loaded with a strand.
    pub fn strand_pitch_m(&self) -> Option<f64> {
        self.at_work().and_then(|(_, needle)| needle.loading.pitch_m())
    }

    /// Returns the inserted needle, or the last one that was.
    pub fn at_work(&self) -> Option<(usize, &Needle)> {
        let number = self.progress.begun().checked_sub(1)?;
        Some((number, self.implant.as_ref()?.plan.needles.get(number)?))
    }

    /// Returns the depths at which it leaves the middles of its seeds, deepest first, m; empty if no needle of a plan
    /// is inserted.
    pub fn drops_m(&self) -> &[f64] {
        let drops = self.at_work().and_then(|(n, _)| self.implant.as_ref()?.drops_m.get(n));
        drops.map_or(&[], |d| d)
    }
}

/// Plan as shown.
pub struct Implant {
    /// Number that grows with every change.
    pub revision: u64,
    /// The plan.
    pub plan: ImplantPlan,
    /// All its seeds.
    pub seeds: Vec<Seed>,
    /// Problems of the plan; `None` until it was checked. During a new check, those of the previous
    /// plan.
    pub problems: Option<Arc<Vec<Problem>>>,
    /// State of each needle.
    pub states: Vec<NeedleState>,
    /// Mean distance of each needle's seeds from plan at rest, if it was rehearsed, m.
    pub rest_errors_m: Vec<Option<f64>>,
    /// Seeds of each needle that are close to an edge, if it was rehearsed.
    pub sensitive: Vec<Vec<Sensitive>>,
    /// Depths of the drops of each needle, by rehearsal or as planned, m.
    pub drops_m: Vec<Vec<f64>>,
    /// True if a change can be undone.
    pub can_undo: bool,
    /// True if a change can be redone.
    pub can_redo: bool,
}

impl Implant {
    pub(super) fn of(
        revision: u64,
        history: &History<ImplantPlan>,
        problems: Option<Arc<Vec<Problem>>>,
        progress: &NeedleProgress,
        compensated: &[(Needle, Compensation)],
    ) -> Self {
        let plan = history.now().clone();
        let found = |needle: &Needle| compensated.iter().find(|(n, _)| n == needle).map(|(_, done)| done);
        let rest_error_m = |needle: &Needle| {
            let done = found(needle)?;
            Some(done.errors_after_m().sum::<f64>() / done.after_m.len().max(1) as f64)
        };
        let sensitive = |needle: &Needle| found(needle).map_or_else(Vec::new, |done| done.sensitive.clone());
        let drops_m = |needle: &Needle| match found(needle) {
            Some(done) => done.drops.along_m.clone(),
            None => needle.seeds.iter().map(|s| s.along_m).collect(),
        };
        Self {
            revision,
            seeds: plan.seeds(),
            problems,
            states: (0..plan.needles.len()).map(|n| progress.state(n)).collect(),
            rest_errors_m: plan.needles.iter().map(rest_error_m).collect(),
            sensitive: plan.needles.iter().map(sensitive).collect(),
            drops_m: plan.needles.iter().map(drops_m).collect(),
            can_undo: history.can_undo(),
            can_redo: history.can_redo(),
            plan,
        }
    }
}
