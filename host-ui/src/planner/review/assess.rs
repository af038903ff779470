//! The assessment of a moment of the procedure, on separate threads.

use super::super::Failure;
use super::super::needles::{NeedleProgress, NeedleState};
use super::{Drawn, is_near};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::sync::Arc;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Seed, Source};
use stylet_host::link::{SceneModel, Snapshot};
use stylet_implant::intraoperative::{Agreement, Doses, Marks, Reviewed, SeedsFrom, Situation, Solid, Transverse};
use stylet_implant::plan::{Anatomy, Compensation, ImplantPlan, Needle};
use stylet_surfaces::field::Field;

/// Plan, seeds and drawing at one time.
#[derive(Clone)]
pub(super) struct Moment {
    plan: ImplantPlan,
    begun: usize,
    /// Seeds at their actual positions.
    lying: Vec<Seed>,
    to_drop: Vec<Seed>,
    rehearsed: Vec<(Needle, Compensation)>,
    solid: Arc<Solid>,
    frame: Transverse,
    drawn: Drawn,
    seeds_from: SeedsFrom,
}

/// Assessment of a moment.
pub(super) struct Assessed {
    pub doses: Doses,
    pub marks: Marks,
    pub volume_m3: f64,
}

impl Moment {
    /// Creates a moment; `None` if no seed is in the tissue.
    pub fn of(
        plan: &ImplantPlan,
        (progress, rehearsed): (&NeedleProgress, &[(Needle, Compensation)]),
        (solid, frame): (Arc<Solid>, Transverse),
        (drawn, seeds_from): (&Drawn, SeedsFrom),
        snapshot: &Snapshot,
    ) -> Option<Self> {
        let header = &snapshot.header;
        let poses = &header.seeds[..header.seed_count as usize];
        let (count, begun) = (poses.len(), progress.begun().min(plan.needles.len()));
        let (mut lying, mut to_drop) = (Vec::new(), Vec::new());
        for (number, needle) in plan.needles.iter().enumerate().take(begun) {
            let own = &poses[progress.seeds_of(number, count)];
            let strength_u = |n: usize| needle.seeds.get(n).or(needle.seeds.first()).map(|s| s.strength_u);
            lying.extend(own.iter().enumerate().filter_map(|(n, pose)| {
                Some(Seed {
                    // Seeds in the frame of the scene's body.
                    position_m: [0, 1, 2].map(|a| pose.position_m[a] + header.body_moved_m[a]),
                    axis: Some(pose.axis),
                    strength_u: strength_u(n)?,
                })
            }));
            if progress.state(number) == NeedleState::Inserted {
                to_drop.extend(needle.seeds.iter().skip(own.len()).map(|seed| Seed {
                    position_m: needle.at_m(seed.along_m),
                    axis: Some(needle.direction),
                    strength_u: seed.strength_u,
                }));
            }
        }
        (!lying.is_empty()).then(|| Self {
            plan: plan.clone(),
            begun,
            lying,
            to_drop,
            rehearsed: rehearsed.to_vec(),
            solid,
            frame,
            drawn: drawn.clone(),
            seeds_from,
        })
    }

    /// Returns whether the assessment would be the same.
    pub fn is_as(&self, other: &Self) -> bool {
        let near = |a: &[Seed], b: &[Seed]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_near(a.position_m, b.position_m))
        };
        self.drawn == other.drawn
            && self.seeds_from == other.seeds_from
            && self.begun == other.begun
            && self.plan == other.plan
            && self.rehearsed == other.rehearsed
            && near(&self.lying, &other.lying)
            && near(&self.to_drop, &other.to_drop)
    }

    fn marks(&self) -> Marks {
        let lying_m: Vec<[f64; 3]> = self.lying.iter().map(|seed| seed.position_m).collect();
        Marks::of(&lying_m, &self.drawn.marks_m)
    }

    /// Returns the seeds of the dose. A mark without a seed has no direction; a seed without a mark
    /// is left out.
    fn seeds(&self, marks: &Marks) -> Vec<Seed> {
        if self.seeds_from == SeedsFrom::Tissue {
            return self.lying.clone();
        }
        let of_mark = |(number, place_m): (usize, &[f64; 3])| {
            let is_its = |mark: &Option<(usize, f64)>| mark.is_some_and(|(n, _)| n == number);
            let seed = marks.of_seeds.iter().position(is_its);
            Seed {
                position_m: *place_m,
                axis: seed.and_then(|n| self.lying[n].axis),
                strength_u: self.lying[seed.unwrap_or(0)].strength_u,
            }
        };
        self.drawn.marks_m.iter().enumerate().map(of_mark).collect()
    }

    /// Returns the contoured gland, the spared structures as displaced by the tissue, and the true
    /// gland of the moment.
    fn anatomy(&self, rest: &Anatomy, scene: &SceneModel, snapshot: &Snapshot) -> Result<[Anatomy; 2], Failure> {
        let field =
            Field::of(scene.header.nodes, &snapshot.displacements_m).ok_or("The state of the tissue is unknown.")?;
        let to_m = |p: [f64; 3]| {
            let rest = Vector3::from(p);
            <[f64; 3]>::from(rest + field.displacement_m(rest))
        };
        let seen = self.solid.body(&self.frame, &rest.target.name)?;
        Ok([
            rest.seen_as(seen, &to_m)?,
            rest.seen_as(rest.target.moved(to_m)?, &to_m)?,
        ])
    }

    fn source(&self) -> Result<Source, Failure> {
        Ok(Source::named(&self.plan.source)?)
    }

    /// Computes the dose of the placed seeds, now and with the plan continued.
    pub fn assess(&self, rest: &Anatomy, scene: &SceneModel, snapshot: &Snapshot) -> Result<Assessed, Failure> {
        let source = self.source()?;
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let [seen, _] = self.anatomy(rest, scene, snapshot)?;
        let marks = self.marks();
        Ok(Assessed {
            doses: self.situation(&seen, &kernel, &source, self.seeds(&marks)).doses()?,
            volume_m3: seen.target.structure(VOLUME_PITCH_M).volume_m3(),
            marks,
        })
    }

    fn situation<'a>(
        &'a self,
        anatomy: &'a Anatomy,
        kernel: &'a DoseKernel,
        source: &'a Source,
        lying: Vec<Seed>,
    ) -> Situation<'a> {
        Situation {
            plan: &self.plan,
            begun: self.begun,
            lying,
            to_drop: self.to_drop.clone(),
            anatomy,
            rehearsed: &self.rehearsed,
            kernel,
            source,
        }
    }

    /// Replans the remaining needles.
    pub fn update(
        &self,
        rest: &Anatomy,
        scene: &SceneModel,
        snapshot: &Snapshot,
        report: &dyn Fn(f32) -> ControlFlow<()>,
    ) -> Result<Reviewed, Failure> {
        let source = self.source()?;
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let [seen, truth] = self.anatomy(rest, scene, snapshot)?;
        let marks = self.marks();
        let update = self
            .situation(&seen, &kernel, &source, self.seeds(&marks))
            .update(report)?;
        let left = |plan: &ImplantPlan| {
            let needles = &plan.needles[self.begun..];
            [needles.len(), needles.iter().map(|n| n.seeds.len()).sum()]
        };
        Ok(Reviewed {
            lying: self.lying.len(),
            seeds_from: self.seeds_from,
            agreement: Agreement::of(&seen.target, &truth.target),
            marked: [self.lying.len() - marks.without_mark(), marks.without_seed.len()],
            residuals_m: marks.residuals_m(),
            left: [left(&self.plan), left(&update.plan)],
            accepted: false,
            update,
        })
    }
}

/// Pitch that gives volumes to a tenth of a cubic centimetre.
const VOLUME_PITCH_M: f64 = 1.5e-3;
