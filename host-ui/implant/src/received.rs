//! A procedure as any host receives it, without control of the hand: the basis of a debrief when
//! another window plans and drives.

use crate::pairing;
use crate::plan::{Hole, Template};
use crate::score::{SeedPair, Trace, seed_of};
use nalgebra::Vector3;
use stylet_dose::Seed;
use stylet_host::link::Link;
use stylet_host::moments::{Moment, Moments};
use stylet_shm_schema::{HapticState, PlanInForce, Prescribed, SceneHeader, SeedPose, TickRecord, flags};

/// Largest distance, m, from a needle's axis at which a seed dropped before this host listened
/// belongs to it.
const OF_NEEDLE_M: f64 = 3e-3;
/// Distance from a hole beyond which a planned needle goes through none, m.
const BESIDE_HOLE_M: f64 = 0.5e-3;

/// Plan that was in force, and the number of seeds in the tissue when it came.
#[derive(Clone, Debug)]
struct ReceivedNeedle {
    plan: PlanInForce,
    first_seed: usize,
}

/// Procedure, from when this host began to listen.
#[derive(Clone, Debug, Default)]
pub struct ReceivedProcedure {
    trace: Trace,
    moments: Moments,
    scene: Option<SceneHeader>,
    needles: Vec<ReceivedNeedle>,
    /// Generation of the plan that was checked last.
    generation: Option<(u64, u64)>,
    seeds: Vec<SeedPose>,
    /// True once a snapshot came.
    has_begun: bool,
}

/// Planned seed and the one that was dropped for it, by its index among those in the tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedSeed {
    /// Needle that it was planned for, counted from 0.
    pub needle: usize,
    /// Planned seed.
    pub planned: Seed,
    /// Index of the dropped seed; `None` while it is missing.
    pub placed: Option<usize>,
}

impl ReceivedProcedure {
    /// Takes the data that arrived since the last call; `records` are those from the link.
    pub fn take(&mut self, link: &Link, records: &[TickRecord]) {
        // A reset begins a new procedure.
        if self.moments.take(link.events()) {
            self.begin_anew();
        }
        let scene = link.scene().map(|scene| scene.header);
        if scene.map(|s| s.id()) != self.scene.map(|s| s.id()) {
            self.begin_needles();
            self.scene = scene;
        }
        let direction = link.state().map_or([0.0, 0.0, 1.0], |s| s.needle_direction);
        self.trace.take(records, scene.as_ref().map(SceneHeader::id), direction);
        if let Some(snapshot) = link.snapshot() {
            let seeds = &snapshot.header.seeds[..snapshot.header.seed_count as usize];
            self.seeds.clear();
            self.seeds.extend_from_slice(seeds);
            self.take_plan(link.plan(), link.state());
            self.begin(link.state());
        }
    }

    /// Notes whether the procedure had begun before this host listened.
    fn begin(&mut self, state: Option<&HapticState>) {
        if !std::mem::replace(&mut self.has_begun, true) {
            let is_in_contact = state.is_some_and(|s| s.flags & flags::IN_CONTACT != 0);
            self.trace.is_from_middle = is_in_contact || !self.seeds.is_empty();
        }
    }

    fn begin_anew(&mut self) {
        self.trace = Trace::default();
        self.begin_needles();
    }

    fn begin_needles(&mut self) {
        (self.generation, self.scene) = (None, None);
        self.needles.clear();
        self.seeds.clear();
    }

    fn take_plan(&mut self, plan: Option<&PlanInForce>, state: Option<&HapticState>) {
        // The board is newer than the last picture.
        let seeds = state.map_or(self.seeds.len(), |s| s.seed_count as usize);
        if self.needles.last().is_some_and(|last| seeds < last.first_seed) {
            self.needles.clear();
            self.generation = None;
        }
        let Some(plan) = plan.filter(|p| p.generation > 0 && p.seed_count > 0) else {
            return;
        };
        let generation = (plan.session_id, plan.generation);
        // Earlier seeds are checked one by one.
        if self.generation == Some(generation) || self.needles.is_empty() && self.seeds.len() != seeds {
            return;
        }
        let number = plan.prescribed.needle;
        let again = self.needles.iter().find(|heard| heard.plan.prescribed.needle == number);
        let first_seed = match (again, number) {
            (_, 0) => 0,
            (Some(heard), _) => heard.first_seed,
            (None, _) if self.needles.is_empty() => seeds - own_seeds(plan, &self.seeds),
            (None, _) => seeds,
        };
        self.generation = Some(generation);
        // A needle that is planned again, or one by hand, replaces the received one.
        let goes_on = |of: &Prescribed| number > of.needle && of.needle > 0;
        self.needles.retain(|heard| goes_on(&heard.plan.prescribed));
        self.needles.push(ReceivedNeedle {
            plan: *plan,
            first_seed,
        });
    }

    /// Returns force and speed, and the motion of the hand.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Returns the marks, exercises and faults of this run of the core.
    pub fn moments(&self) -> &Moments {
        &self.moments
    }

    /// Returns the moments of this procedure.
    pub fn own_moments(&self) -> Vec<Moment> {
        self.moments.since(self.trace.began_ns().unwrap_or(u64::MAX))
    }

    /// Returns the prescription of the newest plan.
    pub fn prescribed(&self) -> Option<Prescribed> {
        self.needles.last().map(|heard| heard.plan.prescribed)
    }

    /// Returns the number of seeds in the tissue whose plan is unknown here.
    pub fn seeds_before(&self) -> usize {
        self.needles.first().map_or(self.seeds.len(), |heard| heard.first_seed)
    }

    /// Returns every planned seed of the received needles; `strength_u` is that of seeds by hand,
    /// and of plans without a strength.
    pub fn planned(&self, strength_u: f64) -> Vec<ReceivedSeed> {
        let of_needle = |(number, heard): (usize, &ReceivedNeedle)| {
            let (plan, count) = (&heard.plan, self.seeds.len());
            let next = self.needles.get(number + 1).map_or(count, |next| next.first_seed);
            let from = heard.first_seed.min(count);
            let own = &self.seeds[from..next.clamp(from, count)];
            let planned_m: Vec<[f64; 3]> = (plan.seeds.iter().take(plan.seed_count as usize))
                .map(|seed| seed.position_m)
                .collect();
            let pairs = match plan.prescribed.needle {
                0 => {
                    let dropped_at_m: Vec<[f64; 3]> = own.iter().map(|seed| seed.dropped_at_m).collect();
                    pairing::nearest(&planned_m, &dropped_at_m)
                }
                _ => pairing::in_order(planned_m.len(), &[], own.len()),
            };
            let seed = move |(position_m, placed): ([f64; 3], Option<usize>)| ReceivedSeed {
                needle: plan.prescribed.needle.saturating_sub(1) as usize,
                planned: Seed {
                    position_m,
                    axis: Some(plan.direction),
                    strength_u: match plan.prescribed {
                        Prescribed { needle: 0, .. } => strength_u,
                        known if known.strength_u == 0.0 => strength_u,
                        known => known.strength_u,
                    },
                },
                placed: placed.map(|place| from + place),
            };
            planned_m.into_iter().zip(pairs).map(seed).collect::<Vec<_>>()
        };
        self.needles.iter().enumerate().flat_map(of_needle).collect()
    }

    /// Returns the input of a score: the seeds in the tissue, each with its planned one, the missing
    /// ones, and those of the received needles that have no planned one.
    pub fn pairs(&self, strength_u: f64) -> (Vec<SeedPair>, Vec<Seed>, Vec<Seed>) {
        let template = self.scene.as_ref().map(Template::before);
        let hole = |planned_m, direction| template.and_then(|t| hole_of(&t, planned_m, direction));
        let (mut pairs, mut lost) = (Vec::new(), Vec::new());
        let mut has_plan = vec![false; self.seeds.len()];
        for heard in self.planned(strength_u) {
            let (planned, direction) = (heard.planned, heard.planned.axis.unwrap_or_default());
            let Some(pose) = heard.placed.and_then(|place| self.seeds.get(place)) else {
                lost.push(planned);
                continue;
            };
            heard.placed.into_iter().for_each(|place| has_plan[place] = true);
            let hole = hole(planned.position_m, direction);
            pairs.push(SeedPair::new((heard.needle, hole), planned, pose));
        }
        let others = (self.seeds_before()..self.seeds.len()).filter(|&n| !has_plan[n]);
        let unplanned = others.map(|n| seed_of(&self.seeds[n], strength_u)).collect();
        (pairs, lost, unplanned)
    }

    /// Returns whether every planned seed lies in the tissue, including those of the plan's last
    /// needle.
    pub fn is_whole(&self) -> bool {
        let is_last = |of: Prescribed| of.needle == of.last_needle;
        self.prescribed().is_some_and(is_last) && self.planned(0.0).iter().all(|seed| seed.placed.is_some())
    }
}

/// Returns the hole of the usual template on this line; `None` for a needle through no hole.
fn hole_of(template: &Template, place_m: [f64; 3], direction: [f64; 3]) -> Option<Hole> {
    let hole = template.nearest(place_m)?;
    let (off, direction) = (
        Vector3::from(template.hole_m(hole)) - Vector3::from(place_m),
        Vector3::from(direction),
    );
    ((off - direction * off.dot(&direction)).norm() < BESIDE_HOLE_M).then_some(hole)
}

/// Returns how many of the last seeds left a needle on the axis of the plan.
fn own_seeds(plan: &PlanInForce, seeds: &[SeedPose]) -> usize {
    let (entry, direction) = (Vector3::from(plan.entry_m), Vector3::from(plan.direction));
    let is_near = |seed: &&SeedPose| {
        let off = Vector3::from(seed.dropped_at_m) - entry;
        (off - direction * off.dot(&direction)).norm() <= OF_NEEDLE_M
    };
    let own = seeds.iter().rev().take_while(is_near).count();
    own.min(plan.seed_count as usize)
}

#[cfg(test)]
mod tests;
