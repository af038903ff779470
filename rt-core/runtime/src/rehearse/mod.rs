//! Rehearses one needle ahead of time: the two loops of the run, in a separate body, as fast as they can.
//!
//! The model is the live one: the simulated hand and device, `HapticLoop::tick` and `TissueLoop::tick`, fed with a
//! simulated clock. Each rehearsal begins with tissue at rest, and the same needle gives the same bytes. Runs on a
//! thread of normal priority (`control/rehearsals.rs`).

mod motion;
mod rig;
mod scatter;
mod script;
mod standing;

use crate::background::goes_on;
use crate::lines::{LineBody, NoLine};
use crate::rt::world::World;
use motion::{Motion, TargetElements};
use nalgebra::Vector3;
use rig::Rig;
use scatter::Scatter;
use script::Script;
use standing::Standing;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_hw::{DeviceInfo, Hand};
use stylet_procedure::tolerance::STALLED_M;
use stylet_shm_schema::{
    MAX_LEFT_NEEDLES, MAX_SEEDS, NeedleAxis, NeedleRehearsal, ParameterProblems, ParameterSet, Reason, Refusal,
    RefusalCode, SeedPose, flags,
};
use stylet_sim::active::{Active, activate};
use stylet_sim::line::{LineError, LineStations, ReadyLine};
use stylet_sim::scene::{SceneError, SceneSource};
use stylet_sim::tissue::{TissueError, TissueSpec};

/// Longest rehearsal in simulated time; a longer one has failed.
const LONGEST_S: f64 = 900.0;

/// Failure of a rehearsal; the text is for people.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RehearseError {
    /// The scene cannot be built again.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its tissue cannot be set up.
    #[error(transparent)]
    World(#[from] TissueError),
    /// The needle's line cannot be prepared.
    #[error(transparent)]
    Line(#[from] NoLine),
    /// Parameters out of range, one per line.
    #[error(transparent)]
    Parameters(#[from] ParameterProblems),
    /// More drops than there are seeds.
    #[error("{0} drops; at most {MAX_SEEDS}")]
    TooManyDrops(usize),
    /// More needles than may stay in.
    #[error("{0} needles that stay in; at most {MAX_LEFT_NEEDLES}")]
    TooManyLeft(usize),
    /// Eq. 6 has no needle that stays in.
    #[error("with --tissue paper no needle can stay in: it has no lines")]
    NoneStaysIn,
    /// An earlier rehearsal ended without returning its body.
    #[error("the last rehearsal lost its body")]
    BodyLost,
    /// `stop` was set.
    #[error("rt-core ended during the rehearsal")]
    Stopped,
    /// The script would take a hand that leans on bone for a tip at its place, and leave the seeds there.
    #[error("bone stops the needle {0:.1} mm before its deepest drop")]
    Bone(f64),
    /// A loop refused an order.
    #[error("{}", why.message())]
    Refused {
        /// The loop's reason.
        why: RefusalCode,
        /// Number of the drop, from 0, that was refused or due next.
        drop: u32,
    },
    /// The procedure could not continue.
    #[error("in the rehearsal: {0}")]
    Procedure(#[from] stylet_procedure::StepFailure),
    /// The script did not end.
    #[error("the needle had not finished after {LONGEST_S} s of simulated time")]
    TooLong,
}

impl From<RehearseError> for Refusal {
    fn from(error: RehearseError) -> Self {
        let (code, subject) = match error {
            RehearseError::Refused { why, drop } => (why, drop),
            _ => (RefusalCode::RehearsalFailed, Reason::NO_SUBJECT),
        };
        Refusal {
            reasons: vec![Reason::new(code, subject)],
            text: error.to_string(),
        }
    }
}

/// The result of a rehearsal.
#[derive(Clone, Debug, PartialEq)]
pub struct Rehearsed {
    /// Seeds in the order of the drops, after the tissue has come to rest.
    pub seeds: Vec<SeedPose>,
    /// Times of the drops after the tip's first contact with tissue, s.
    pub dropped_after_s: Vec<f64>,
    /// Largest force on the hand, N.
    pub peak_force_n: f64,
    /// Largest displacement of tissue before the first puncture, m.
    pub displacement_before_puncture_m: f64,
    /// Largest displacement of tissue during the whole insertion, m.
    pub largest_displacement_m: f64,
    /// Largest shift of the target's centre during the whole insertion, m; of the whole body if there is no target.
    pub target_shift_m: f64,
    /// Largest deflection of the tip from a rigid needle's, m.
    pub deflection_m: f64,
    /// Simulated time of the rehearsal, s.
    pub simulated_s: f64,
}

/// A body to rehearse in, reused between rehearsals.
pub struct Stage {
    world: Option<Box<World>>,
    /// Body for lines, if the needles have lines.
    lines: Option<LineBody>,
    /// Lines of the last rehearsal, those of needles that stay in first: compensation rehearses the same needle several
    /// times.
    kept: Vec<(NeedleAxis, bool, ReadyLine)>,
    /// State of the needles that stay in after earlier ones.
    standing: Option<Standing>,
    device: DeviceInfo,
    hand: Hand,
    target: TargetElements,
}

impl Stage {
    /// Builds a copy of the scene, apart from the running one.
    pub fn build(
        source: &SceneSource,
        tissue: impl Into<TissueSpec>,
        device: DeviceInfo,
    ) -> Result<Self, RehearseError> {
        let tissue = tissue.into();
        let scene = source.build()?;
        let lines = LineBody::of_source(source, tissue)?;
        let active = activate(&ParameterSet::default(), &device)?;
        let world = World::new(scene, tissue, active.limits, 1)?;
        Ok(Self {
            target: TargetElements::of(&world.scene),
            world: Some(Box::new(world)),
            lines,
            kept: Vec::new(),
            standing: None,
            device,
            hand: Hand::steady(),
        })
    }

    /// Replaces the hand of later rehearsals; the first is [`Hand::steady`].
    pub fn take_hand(&mut self, hand: Hand) {
        self.hand = hand;
    }

    /// Limits later rehearsals to seeds and forces, in a fifth of the time. Tissue near the tip stays linear, which
    /// changes neither; the shift of the target is then the linear one.
    pub fn seeds_and_forces_alone(&mut self) {
        if let Some(world) = &mut self.world {
            world.looks_near_tip = false;
        }
    }

    /// Solves a line at rest for each needle, the one that leaves seeds last; none if the tissue needs none.
    fn lines(
        &mut self,
        run: &NeedleRehearsal,
        bends: bool,
        stop: &AtomicBool,
    ) -> Result<Vec<ReadyLine>, RehearseError> {
        let Some(body) = &self.lines else {
            return match run.stabilising.is_empty() {
                true => Ok(Vec::new()),
                false => Err(RehearseError::NoneStaysIn),
            };
        };
        let own = NeedleAxis {
            entry_m: run.entry_m,
            direction: run.direction,
        };
        let stabilising = run.stabilising.iter().map(|needle| NeedleAxis {
            entry_m: needle.entry_m,
            direction: needle.direction,
        });
        let wanted: Vec<NeedleAxis> = stabilising.chain([own]).collect();
        let same = self
            .kept
            .iter()
            .zip(&wanted)
            .take_while(|((of, bent, _), axis)| of == *axis && *bent == bends)
            .count();
        self.kept.truncate(same);
        for (number, axis) in wanted.iter().enumerate().skip(same) {
            let mut goes_on = || goes_on(stop);
            let others: Vec<_> = self.kept.iter().map(|(.., line)| line.stations.clone()).collect();
            let generation = number as u64 + 1;
            let line = body.prepare(generation, axis.entry_m, axis.direction, bends, &others, &mut goes_on);
            self.kept.push((*axis, bends, line.map_err(stopped)?));
        }
        Ok(self.kept.iter().map(|(.., line)| line.clone()).collect())
    }

    /// Solves a line for one more needle, without keeping it.
    fn line_beside(
        &self,
        generation: u64,
        run: &NeedleRehearsal,
        bends: bool,
        others: &[Arc<LineStations>],
        stop: &AtomicBool,
    ) -> Result<ReadyLine, RehearseError> {
        let body = self.lines.as_ref().ok_or(RehearseError::NoneStaysIn)?;
        let mut goes_on = || goes_on(stop);
        let line = body.prepare(generation, run.entry_m, run.direction, bends, others, &mut goes_on);
        line.map_err(stopped)
    }

    /// Rehearses from rest under these parameters; fails early when `stop` is set.
    pub fn rehearse(
        &mut self,
        run: &NeedleRehearsal,
        set: &ParameterSet,
        stop: &AtomicBool,
    ) -> Result<Rehearsed, RehearseError> {
        if run.drops_m.len() > MAX_SEEDS {
            return Err(RehearseError::TooManyDrops(run.drops_m.len()));
        }
        if run.stabilising.len() > MAX_LEFT_NEEDLES {
            return Err(RehearseError::TooManyLeft(run.stabilising.len()));
        }
        let active = activate(set, &self.device)?;
        let scattered = Scatter::of(set).map(|scatter| scatter.apply(run));
        let run = scattered.as_ref().unwrap_or(run);
        let lines = self.lines(run, active.force.bending.is_on(), stop)?;
        if let Some(in_bone_m) = lines.last().map(|line| in_bone_m(line, run)).filter(|m| *m > STALLED_M) {
            return Err(RehearseError::Bone(1e3 * in_bone_m));
        }
        if !run.stabilising.is_empty() && !run.earlier.is_empty() {
            return self.rehearse_after(run, set, &active, lines, stop);
        }
        let mut rig = self.rig(run, &active)?;
        rig.take_lines(lines);
        let outcome = perform(&mut rig, run, (Script::new(run), Motion::new(&self.target)), stop);
        self.world = Some(rig.into_world());
        outcome
    }

    /// Returns loops over the body at rest; [`Rig::into_world`] returns the body.
    fn rig(&mut self, run: &NeedleRehearsal, active: &Active) -> Result<Rig, RehearseError> {
        let mut world = self.world.take().ok_or(RehearseError::BodyLost)?;
        world.tissue.return_to_rest();
        world.set_limits(active.limits.clone());
        world.migration = active.migration;
        world.seeds_take_room = !run.as_points;
        Ok(Rig::new(world, active, (&self.device, self.hand), run))
    }
}

/// Returns how far the needle's deepest drop is behind bone.
fn in_bone_m(line: &ReadyLine, run: &NeedleRehearsal) -> f64 {
    let (way, _) = Script::way(run);
    let each_m = way
        .drops_m
        .iter()
        .map(|tip_m| line.hand.in_bone_m(line.hand.along_m(tip_m)));
    each_m.fold(0.0, f64::max)
}

fn stopped(why: NoLine) -> RehearseError {
    match why {
        NoLine::Line(LineError::Stopped) => RehearseError::Stopped,
        why => RehearseError::Line(why),
    }
}

fn perform(
    rig: &mut Rig,
    run: &NeedleRehearsal,
    (mut script, mut motion): (Script, Motion),
    stop: &AtomicBool,
) -> Result<Rehearsed, RehearseError> {
    if !script.is_at_needle() {
        drive(rig, stop, |rig, _| {
            script.advance(rig)?;
            Ok(script.is_at_needle())
        })?;
    }
    motion.begin(rig.deformed());
    rig.forget_peaks();
    let (mut displacement_before_puncture_m, mut deflection_m) = (0.0_f64, 0.0_f64);
    let (mut punctured, mut contact_s) = (false, None);
    let mut dropped_after_s = Vec::new();
    drive(rig, stop, |rig, has_tissue_moved| {
        if has_tissue_moved {
            motion.look(rig.displacement_m(), rig.deformed());
        }
        let state = rig.state();
        if state.flags & flags::IN_CONTACT != 0 {
            contact_s.get_or_insert(rig.seconds());
        }
        while dropped_after_s.len() < state.seed_count as usize {
            dropped_after_s.push(rig.seconds() - contact_s.unwrap_or(rig.seconds()));
        }
        deflection_m = deflection_m.max(Vector3::from(state.tip_deflection_m).norm());
        punctured |= state.flags & flags::PUNCTURED != 0;
        if !punctured {
            displacement_before_puncture_m = displacement_before_puncture_m.max(rig.displacement_m());
        }
        script.advance(rig)
    })?;
    Ok(Rehearsed {
        // Needles that stay in displace the tissue until they are drawn out, and seeds are planned in tissue at rest.
        seeds: match run.stabilising.is_empty() {
            true => rig.seeds(),
            false => rig.seeds_at_rest(),
        },
        dropped_after_s,
        peak_force_n: rig.state().peak_force_n,
        displacement_before_puncture_m,
        largest_displacement_m: motion.largest_m,
        target_shift_m: motion.target_m,
        deflection_m,
        simulated_s: rig.seconds(),
    })
}

/// Ticks until `advance` returns true; it is told whether the tissue loop ticked too.
fn drive(
    rig: &mut Rig,
    stop: &AtomicBool,
    mut advance: impl FnMut(&mut Rig, bool) -> Result<bool, RehearseError>,
) -> Result<(), RehearseError> {
    while rig.seconds() < LONGEST_S {
        if !goes_on(stop) {
            return Err(RehearseError::Stopped);
        }
        let has_tissue_moved = rig.tick();
        if advance(rig, has_tissue_moved)? {
            return Ok(());
        }
    }
    Err(RehearseError::TooLong)
}

#[cfg(test)]
mod tests;
