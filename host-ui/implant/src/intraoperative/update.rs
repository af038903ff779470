//! Dose of what lies in the tissue now, and the needles that are left planned anew beside it.

use crate::plan::optimise::{self, Engine, Figures, Method, Objectives, Present, Search};
use crate::plan::{Anatomy, Compensation, Hole, ImplantPlan, Needle, NeedleSeed, PlanError};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, Seed, Source};

/// Needles of an implant where its first plan had fewer.
const USUAL_NEEDLES: usize = 25;

/// Which places of the seeds a dose is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SeedsFrom {
    /// As they lie in the tissue, which a simulator knows.
    #[default]
    Tissue,
    /// Where the operator marked them.
    Marks,
}

impl SeedsFrom {
    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "as they lie",
            Self::Marks => "as marked",
        }
    }
}

/// An implant in the middle of its procedure.
pub struct Situation<'a> {
    /// The plan that is carried out.
    pub plan: &'a ImplantPlan,
    /// Needles of it that were inserted: the first ones.
    pub begun: usize,
    /// Seeds in the tissue, scene frame.
    pub lying: Vec<Seed>,
    /// Seeds of inserted needles that are still to be dropped, as planned.
    pub to_drop: Vec<Seed>,
    /// Target and what is spared, as they are now.
    pub anatomy: &'a Anatomy,
    /// Needles that were rehearsed, with where their seeds would rest. Of those that were not, seeds are taken to rest as planned.
    pub rehearsed: &'a [(Needle, Compensation)],
    /// Dose of one seed.
    pub kernel: &'a DoseKernel,
    /// Source of the seeds.
    pub source: &'a Source,
}

/// Measures of the dose at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doses {
    /// Of the seeds that lie in the tissue.
    pub now: Figures,
    /// Of all seeds if the plan is carried on unchanged, those of needles that were rehearsed where they would rest.
    pub continued: Figures,
}

/// The needles that are left, planned anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// The plan: needles that were inserted, unchanged, and then the new ones.
    pub plan: ImplantPlan,
    /// Needles of it that were inserted.
    pub begun: usize,
    /// Before the update.
    pub doses: Doses,
    /// Of all seeds if the new needles go in.
    pub updated: Figures,
}

/// What the operator found out and decided, for the debrief.
#[derive(Clone, Debug, PartialEq)]
pub struct Reviewed {
    /// Needles that were inserted at that time.
    pub begun: usize,
    /// Seeds that lay in the tissue.
    pub lying: usize,
    /// Which places of the seeds the dose was of.
    pub seeds_from: SeedsFrom,
    /// The contoured gland against the true one.
    pub agreement: Option<super::Agreement>,
    /// Seeds that were marked, and marks that were of no seed.
    pub marked: [usize; 2],
    /// Mean and largest distance of a mark from its seed, m.
    pub residuals_m: Option<[f64; 2]>,
    /// Of the plan as it was, in the contoured gland.
    pub doses: Doses,
    /// Of the new plan, in the contoured gland.
    pub updated: Figures,
    /// Needles and seeds that were left in the plan as it was, and in the new one.
    pub left: [[usize; 2]; 2],
    /// Whether the operator took the new plan.
    pub accepted: bool,
}

/// An update that waits for a decision, with what the debrief keeps of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposed {
    /// The update.
    pub update: Update,
    /// What was found out; not accepted yet.
    pub reviewed: Reviewed,
}

impl Situation<'_> {
    /// Measures now and with the plan carried on; an error where the target has no volume.
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

    /// All seeds once the needles that are left in a plan are in.
    pub fn with(&self, plan: &ImplantPlan) -> Vec<Seed> {
        let left = left_of(plan, self.begun).iter().flat_map(|needle| self.resting(needle));
        self.lying.iter().chain(&self.to_drop).copied().chain(left).collect()
    }

    /// The seeds of a needle where they would rest.
    fn resting(&self, needle: &Needle) -> Vec<Seed> {
        let rehearsed = self.rehearsed.iter().find(|(of, _)| of == needle);
        let off_m = rehearsed.map_or(&[][..], |(_, done)| &done.after_m);
        let seeds = needle.seeds.iter().zip(needle.seeds_m()).enumerate();
        let resting = seeds.map(|(n, (seed, planned_m))| {
            let off_m = off_m.get(n).copied().unwrap_or_default();
            Seed {
                position_m: [0, 1, 2].map(|a| planned_m[a] + off_m[a]),
                axis: Some(needle.direction),
                strength_u: seed.strength_u,
            }
        });
        resting.collect()
    }

    /// Searches for the needles that are left, through holes that are not used yet, with seeds of the strength at hand. `report` gets
    /// the share that is done; where it breaks, the search is cancelled.
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
            ..Objectives::beside(present, strength_u, self.source, plan.prescription_gy)
        };
        let search = Search::new(
            plan.template,
            self.anatomy,
            self.kernel,
            &plan.source,
            &objectives,
            &report,
        )?;
        let found = search.find(&objectives, Method::default(), &report)?;
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
    /// Whether less is beyond the limits than with the plan carried on, or with as little the coldest tenth of the target gets more.
    pub fn improves(&self) -> bool {
        let order = |figures: &Figures| [figures.beyond(), -figures.d90];
        order(&self.updated) < order(&self.doses.continued)
    }
}

/// Needles that are not inserted yet.
fn left_of(plan: &ImplantPlan, begun: usize) -> &[Needle] {
    &plan.needles[begun.min(plan.needles.len())..]
}

#[cfg(test)]
mod tests;
