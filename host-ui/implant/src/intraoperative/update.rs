//! Dose of the placed seeds, and a new plan for the remaining needles around them.

use crate::plan::optimise::{self, Engine, Figures, Objectives, Present, Search};
use crate::plan::{Anatomy, Compensation, Hole, ImplantPlan, Needle, NeedleSeed, PlanError};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, Seed, Source};

/// Number of needles of an implant whose first plan had fewer.
const USUAL_NEEDLES: usize = 25;

/// Source of the seeds' positions for a dose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SeedsFrom {
    /// Positions in the tissue, which a simulator knows.
    #[default]
    Tissue,
    /// Positions of the operator's marks.
    Marks,
}

impl SeedsFrom {
    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "actual positions",
            Self::Marks => "as marked",
        }
    }
}

/// Implant in the middle of its procedure.
pub struct Situation<'a> {
    /// Plan in progress.
    pub plan: &'a ImplantPlan,
    /// Number of its needles that were inserted: the first ones.
    pub begun: usize,
    /// Seeds in the tissue, scene frame.
    pub lying: Vec<Seed>,
    /// Seeds of inserted needles that are still to be dropped, as planned.
    pub to_drop: Vec<Seed>,
    /// Target and spared structures at present.
    pub anatomy: &'a Anatomy,
    /// Rehearsed needles, with the predicted places of their seeds. Seeds of other needles are
    /// assumed to rest as planned.
    pub rehearsed: &'a [(Needle, Compensation)],
    /// Dose of one seed.
    pub kernel: &'a DoseKernel,
    /// Source of the seeds.
    pub source: &'a Source,
}

/// Measures of the dose at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doses {
    /// Measures of the seeds in the tissue.
    pub now: Figures,
    /// Measures of all seeds if the plan is continued unchanged, with rehearsed seeds at their
    /// predicted places.
    pub continued: Figures,
}

/// New plan for the remaining needles.
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// Plan: inserted needles, unchanged, and then the new ones.
    pub plan: ImplantPlan,
    /// Number of its needles that were inserted.
    pub begun: usize,
    /// Doses before the update.
    pub doses: Doses,
    /// Measures of all seeds if the new needles go in.
    pub updated: Figures,
}

/// Findings and decision of the operator, for the debrief.
#[derive(Clone, Debug, PartialEq)]
pub struct Reviewed {
    /// The update, with doses in the contoured gland.
    pub update: Update,
    /// Number of seeds in the tissue.
    pub lying: usize,
    /// Source of the seeds' positions for the dose.
    pub seeds_from: SeedsFrom,
    /// The contoured gland against the true one.
    pub agreement: Option<super::Agreement>,
    /// Number of marked seeds, and of marks without a seed.
    pub marked: [usize; 2],
    /// Mean and largest distance of a mark from its seed, m.
    pub residuals_m: Option<[f64; 2]>,
    /// Remaining needles and seeds in the previous plan, and in the new one.
    pub left: [[usize; 2]; 2],
    /// True if the operator accepted the new plan.
    pub accepted: bool,
}

impl Situation<'_> {
    /// Computes measures now and with the plan continued; returns an error if the target has no
    /// volume.
    pub fn doses(&self) -> Result<Doses, PlanError> {
        self.doses_by(&Engine::new(self.kernel, optimise::bodies(self.anatomy)))
    }

    fn doses_by(&self, engine: &Engine) -> Result<Doses, PlanError> {
        Ok(Doses {
            now: self.figures(engine, &self.lying)?,
            continued: self.figures(engine, &self.with(self.plan))?,
        })
    }

    fn figures(&self, engine: &Engine, seeds: &[Seed]) -> Result<Figures, PlanError> {
        let figures = engine.histograms(seeds).figures(1.0, self.plan.prescription_gy);
        figures.ok_or(PlanError::NoDose)
    }

    /// Returns all seeds after the remaining needles of a plan.
    pub fn with(&self, plan: &ImplantPlan) -> Vec<Seed> {
        let left = left_of(plan, self.begun).iter().flat_map(|needle| self.resting(needle));
        self.lying.iter().chain(&self.to_drop).copied().chain(left).collect()
    }

    /// Returns the seeds of a needle at their predicted places.
    fn resting(&self, needle: &Needle) -> Vec<Seed> {
        let rehearsed = self.rehearsed.iter().find(|(of, _)| of == needle);
        let off_m = rehearsed.map_or(&[][..], |(_, done)| &done.after_m);
        let resting = needle.dose_seeds().enumerate().map(|(n, seed)| {
            let off_m = off_m.get(n).copied().unwrap_or_default();
            Seed {
                position_m: [0, 1, 2].map(|a| seed.position_m[a] + off_m[a]),
                ..seed
            }
        });
        resting.collect()
    }

    /// Searches for the remaining needles, through unused holes, with seeds of the available
    /// strength. `report` gets the completed share; if it breaks, the search is cancelled.
    pub fn update(&self, report: impl Fn(f32) -> ControlFlow<()>) -> Result<Update, PlanError> {
        let plan = self.plan;
        let begun = &plan.needles[..self.begun.min(plan.needles.len())];
        let strengths = |needles: &[Needle]| {
            needles
                .iter()
                .flat_map(|n| &n.seeds)
                .map(|s: &NeedleSeed| s.strength_u)
                .next()
        };
        let strength_u = strengths(left_of(plan, self.begun)).or_else(|| strengths(begun));
        let strength_u = strength_u.ok_or(PlanError::NoSeed)?;
        let present = Present {
            seeds: [&self.lying[..], &self.to_drop].concat(),
            holes: begun.iter().filter_map(|needle| needle.hole).collect::<Vec<Hole>>(),
        };
        let needles = USUAL_NEEDLES.max(plan.needles.len()).saturating_sub(begun.len()).max(1);
        let objectives = Objectives {
            needles,
            strengths_u: vec![strength_u],
            present,
            ..Objectives::new(self.source, plan.prescription_gy)
        };
        let search = Search::new(
            plan.template,
            self.anatomy,
            self.kernel,
            &plan.source,
            &objectives,
            &report,
        )?;
        let found = search.find(&objectives, &report)?;
        let updated = ImplantPlan {
            needles: [begun, &found.plan.needles[..]].concat(),
            ..plan.clone()
        };
        let engine = Engine::new(self.kernel, optimise::bodies(self.anatomy));
        Ok(Update {
            doses: self.doses_by(&engine)?,
            updated: self.figures(&engine, &self.with(&updated))?,
            begun: begun.len(),
            plan: updated,
        })
    }
}

impl Update {
    /// Returns whether the plan improves: limits are violated less than with the plan continued, or
    /// equally and the coldest tenth of the target gets more.
    pub fn improves(&self) -> bool {
        let order = |figures: &Figures| [figures.beyond(), -figures.d90];
        order(&self.updated) < order(&self.doses.continued)
    }
}

/// Returns the needles that are not inserted yet.
fn left_of(plan: &ImplantPlan, begun: usize) -> &[Needle] {
    &plan.needles[begun.min(plan.needles.len())..]
}

#[cfg(test)]
mod tests;
