//! Changes of the plan, each one step to undo, and the limits on them.

use super::{Failure, Planner};
use crate::words::counted;
use stylet_implant::plan::{History, Hole, ImplantPlan, Row, exchange};
use stylet_shm_schema::MAX_SEEDS;
use web_time::{Duration, Instant};

/// Time within which changes of one needle count as one step to undo.
const ONE_STEP: Duration = Duration::from_millis(800);

impl Planner {
    pub(super) fn planned(&self) -> Result<&ImplantPlan, Failure> {
        self.plan().ok_or_else(|| "There is no plan yet; make one.".into())
    }

    /// Begins an empty plan.
    pub fn begin(&mut self) {
        let (Some(outlines), None) = (&self.planning.outlines, &self.history) else {
            return;
        };
        let plan = exchange::usual().map(|(source, prescription_gy)| ImplantPlan {
            template: outlines.template,
            source: source.model,
            prescription_gy,
            needles: Vec::new(),
        });
        match plan {
            Ok(plan) => self.put(plan),
            Err(why) => self.refuse(why),
        }
    }

    /// Discards the plan until [`Planner::restore`].
    pub fn discard(&mut self) {
        self.cancel();
        self.set_aside();
        (self.problems, self.planning.proposals) = (None, None);
        self.to_keep = true;
        self.change();
    }

    /// Adds a needle through the hole, with as many seeds as fill the target behind it, as strong as those of the plan;
    /// the first ones have `first_u`.
    pub fn add(&mut self, hole: Hole, first_u: f64) {
        let piece = self.planning.outlines.as_ref().map(|g| g.piece_m(hole));
        let strength_u = |plan: &ImplantPlan| {
            let seeds = plan.needles.iter().flat_map(|n| &n.seeds);
            seeds.map(|s| s.strength_u).next().unwrap_or(first_u)
        };
        self.edit(|plan| {
            let piece_m = piece
                .ok_or("The scene's anatomy is not ready yet; try again in a moment.")?
                .map_err(|why| format!("A needle through {hole} {why}; choose another hole."))?;
            let added = plan.with_needle(hole, piece_m[1])?;
            Ok::<_, Failure>(added.with_row(plan.needles.len(), Row::filling(piece_m, strength_u(plan)))?)
        });
    }

    /// Replaces the seeds of a needle; quick changes of one needle are one step to undo.
    pub fn set_row(&mut self, needle: usize, row: Row) {
        let last = self.drawn.filter(|(n, at)| *n == needle && at.elapsed() < ONE_STEP);
        let changed = self.planned().and_then(|plan| Ok(plan.with_row(needle, row)?));
        match changed.and_then(|plan| self.can_be(plan)) {
            Ok(plan) => {
                match &mut self.history {
                    Some(history) if last.is_some() => history.replace(plan),
                    Some(history) => history.put(plan),
                    None => {}
                }
                self.drawn = Some((needle, Instant::now()));
                self.change();
            }
            Err(why) => self.refuse(why),
        }
    }

    /// Changes the plan, or reports why it cannot be changed.
    pub fn edit<E: Into<Failure>>(&mut self, edit: impl FnOnce(&ImplantPlan) -> Result<ImplantPlan, E>) {
        match self
            .planned()
            .and_then(|plan| edit(plan).map_err(E::into))
            .and_then(|plan| self.can_be(plan))
        {
            Ok(plan) => self.put(plan),
            Err(why) => self.refuse(why),
        }
    }

    /// Undoes the last change.
    pub fn undo(&mut self) {
        self.step(History::undo, History::redo);
    }

    /// Redoes the change that was undone last.
    pub fn redo(&mut self) {
        self.step(History::redo, History::undo);
    }

    fn step(&mut self, step: fn(&mut History<ImplantPlan>) -> bool, back: fn(&mut History<ImplantPlan>) -> bool) {
        let Some(mut history) = self.history.take() else { return };
        let before = history.now().clone();
        if step(&mut history)
            && let Err(why) = self.keeps(&before, history.now())
        {
            back(&mut history);
            self.refuse(why);
        }
        self.history = Some(history);
        self.change();
    }

    pub(super) fn put(&mut self, plan: ImplantPlan) {
        match &mut self.history {
            Some(history) => history.put(plan),
            None => self.history = Some(History::new(plan)),
        }
        self.change();
    }

    /// Returns the plan if it keeps the inserted needles and fits the core.
    pub(super) fn can_be(&self, plan: ImplantPlan) -> Result<ImplantPlan, Failure> {
        if plan.seed_count() > MAX_SEEDS {
            let count = plan.seed_count();
            return Err(format!("That would be {count} seeds; at most {MAX_SEEDS} can be placed.").into());
        }
        match self.plan() {
            Some(before) => self.keeps(before, &plan).map(|()| plan),
            None => Ok(plan),
        }
    }

    fn keeps(&self, before: &ImplantPlan, after: &ImplantPlan) -> Result<(), Failure> {
        let begun = self.planning.progress.begun();
        let first = |plan: &ImplantPlan| plan.needles.iter().take(begun).cloned().collect::<Vec<_>>();
        if begun > 0 && first(before) != first(after) {
            let needles = counted(begun, "needle");
            return Err(format!("{needles} already inserted; only later ones can be changed.").into());
        }
        Ok(())
    }

    /// Marks plan or anatomy as changed.
    pub(super) fn change(&mut self) {
        self.revision += 1;
        let plan = self.history.as_ref().map(History::now);
        let needles = plan.map_or(&[][..], |p| &p.needles[..]);
        self.compensated.retain(|(needle, _)| needles.contains(needle));
    }
}
