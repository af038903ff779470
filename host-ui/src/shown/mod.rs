//! Data of one frame, taken from the link once, so that no panel touches shared memory.

mod bend;
mod line;
mod metal;
mod outside;
mod parts;
mod second;
mod seeds;
mod tip;

use crate::dose_worker::DoseResult;
pub use crate::planner::Note;
use crate::planner::Planning;
pub use line::{LineWait, NeedleLine};
use nalgebra::Vector3;
pub use outside::Outside;
use outside::SeedPlaces;
pub use parts::{FrameCost, LoadState, TipOnPath, Watched};
pub use second::{SecondHand, Stepper};
pub use seeds::{SeedError, all_errors, own_errors};
use std::sync::Arc;
use stylet_controllers::Latest;
use stylet_host::link::{Link, LinkStatus};
use stylet_imaging::Bend;
use stylet_implant::plan::{HOLES, SEED_LENGTH_M, Template};
use stylet_implant::received::ReceivedSeed;
use stylet_implant::workflow::{Step, Waiting};
use stylet_shm_schema::{
    Class, EventKind, Fault, HapticState, LeftNeedlePose, ParametersInForce, Phase, PlanInForce, PlannedSeed, Relayed,
    SceneHeader, SecondState, SeedPose, Session, flags,
};

/// Length of the path beyond the deepest seed, for the needle and for drawing.
pub const PAST_LAST_SEED_M: f64 = 0.01;

#[derive(Clone, Default)]
pub struct Shown {
    pub instance: String,
    pub status: LinkStatus,
    pub session: Option<Session>,
    /// True if this window steps its core, which then has no timing to show.
    pub is_stepped: bool,
    /// Line to the core, if that runs on another machine.
    pub relayed: Option<Relayed>,
    /// Hosts connected over a relay of this machine.
    pub class: Option<Class>,
    pub state: Option<HapticState>,
    /// State of the second device.
    pub second: Option<SecondState>,
    pub stepper: Stepper,
    pub scene: Option<SceneHeader>,
    /// Plan in force, if it has at least one seed.
    pub plan: Option<PlanInForce>,
    pub parameters: Option<ParametersInForce>,
    pub seeds: Vec<SeedPose>,
    pub seed_places: SeedPlaces,
    /// True if the tip is in the body without contact, as after a reset: it meets no tissue until it has been outside.
    pub is_free_inside: bool,
    /// Planned seeds, from the plans in force that were received.
    pub heard: Vec<ReceivedSeed>,
    /// Number of seeds that the last reset removed, until another is dropped.
    pub removed: usize,
    /// Displacement of the body, and of its seeds, by an exercise.
    pub body_moved_m: [f64; 3],
    /// Bend of the needle in the last snapshot.
    pub bend: Bend,
    /// Needles that stay in while another moves.
    pub left: Vec<LeftNeedlePose>,
    pub snapshot_residual: Option<f64>,
    pub line_wait: LineWait,
    pub invalid_dropped: u64,
    /// Step of the scripted procedure during and after its run.
    pub running: bool,
    pub run_step: Option<Step>,
    /// Needle of the script and number of needles, counted from 0; `None` for one needle.
    pub run_needle: Option<(usize, usize)>,
    /// Condition for which the script waits, and for how long.
    pub run_waits: Option<Waiting>,
    /// Needle with which the script would continue, and number of needles, counted from 0; `None`
    /// if it would begin.
    pub continues_at: Option<(usize, usize)>,
    /// Last answer for the operator.
    pub note: Option<Note>,
    pub load: LoadState,
    /// Recording shown instead of a core, and whether one is being read.
    pub watched: Option<Watched>,
    pub reads_recording: bool,
    /// Dose of the placed seeds, or of the plan.
    pub dose: Option<Arc<DoseResult>>,
    /// Reason why the dose is unknown.
    pub dose_trouble: Option<&'static str>,
    pub planning: Planning,
    /// Number of refused requests that the operator has not dismissed, and the last reason.
    pub refusals: u64,
    pub last_refusal: String,
    /// Last fault of this run without a re-arming; if the core ended, its reason.
    pub last_fault: String,
    /// Tick at which the core last stopped the needle because the sender of its motion fell silent.
    pub given_up_at: Option<u64>,
    /// Gamepads and 3D mice, and whether this window has the focus that they need.
    pub controllers: Latest,
    pub has_focus: bool,
    /// Run of the core that is not real-time, as only its badge says.
    pub reduced: Option<u64>,
    /// Device that was unplugged, until the message is dismissed or a device is plugged in.
    pub disconnected: Option<String>,
    pub cost: FrameCost,
}

impl Shown {
    pub fn empty(instance: &str) -> Self {
        Self {
            instance: instance.to_owned(),
            has_focus: true,
            ..Self::default()
        }
    }

    pub fn take(&mut self, link: &Link) {
        self.status = link.status();
        self.session = link.session().copied();
        self.is_stepped = link.is_here();
        self.relayed = link.relayed().copied();
        self.class = link.class().copied();
        self.state = link.state().copied();
        self.second = link.second_state().copied();
        self.scene = link.scene().map(|s| s.header);
        self.plan = link.plan().filter(|p| p.generation > 0 && p.seed_count > 0).copied();
        self.parameters = link.parameters().copied();
        self.invalid_dropped = link.invalid_dropped();
        let refusals = link.events().iter().rev();
        let last = refusals.clone().find(|e| e.kind == EventKind::InvalidRefused as u32);
        self.last_refusal = last.map_or_else(String::new, |e| e.text.read());
        let mut newest = link.events().iter().rev().map(|e| (EventKind::from_number(e.kind), e));
        let of_fault = newest.find(|(kind, _)| matches!(kind, Some(EventKind::FaultRaised | EventKind::Rearmed)));
        let raised = of_fault.filter(|(kind, _)| *kind == Some(EventKind::FaultRaised));
        self.last_fault = raised.map_or_else(String::new, |(_, event)| event.text.read());
        let seeds_before = self.seeds.len();
        self.seeds.clear();
        self.bend.clear();
        self.left.clear();
        self.snapshot_residual = None;
        if let Some(snapshot) = link.snapshot() {
            self.bend.take(&snapshot.header);
            self.body_moved_m = snapshot.header.body_moved_m;
            let count = snapshot.header.seed_count as usize;
            self.seeds.extend(&snapshot.header.seeds[..count]);
            self.left.extend_from_slice(snapshot.header.left());
            self.snapshot_residual = Some(snapshot.header.residual);
        }
        self.take_tip(link);
        self.take_removed(seeds_before, link);
        self.take_given_up(link);
        self.take_line_wait();
    }

    /// Returns the drawn place of a seed, which follows the body.
    pub fn drawn_at_m(&self, seed: &SeedPose) -> [f64; 3] {
        [0, 1, 2].map(|a| seed.position_m[a] + self.body_moved_m[a])
    }

    pub fn is_live(&self) -> bool {
        matches!(self.status, LinkStatus::Live)
    }

    pub fn is_absent(&self) -> bool {
        matches!(self.status, LinkStatus::Absent { .. })
    }

    /// Returns whether the newest tick has a bit of [`flags`].
    pub fn has_flag(&self, flag: u32) -> bool {
        self.state.is_some_and(|s| s.flags & flag != 0)
    }

    pub fn is_engaged(&self) -> bool {
        self.has_flag(flags::ENGAGED)
    }

    /// Returns whether the force is engaged but waits, because it would begin with a jump.
    pub fn is_waiting(&self) -> bool {
        self.has_flag(flags::WAITING)
    }

    /// Returns the displacement of the tissue at the tip at which its linear answer folded, m; `None` if it has not.
    pub fn folded_from_m(&self) -> Option<f64> {
        self.state.map(|s| s.folded_from_m).filter(|m| *m > 0.0)
    }

    /// Returns whether the tissue at the tip is folded now.
    pub fn is_folded(&self) -> bool {
        self.has_flag(flags::FOLDED)
    }

    pub fn is_real_time(&self) -> bool {
        self.has_flag(flags::REAL_TIME)
    }

    pub fn has_punctured(&self) -> bool {
        self.has_flag(flags::PUNCTURED)
    }

    /// Returns the fault; `None` for a number that this program does not know, which is a fault too.
    pub fn fault(&self) -> Option<Fault> {
        Fault::from_number(self.state.map_or(0, |s| s.fault))
    }

    /// Returns the fault of either device that only a person ends; [`Fault::DeviceError`] for one
    /// that this program does not know.
    pub fn stands_fault(&self) -> Option<Fault> {
        let of_device = |fault: u32| (fault != 0).then(|| Fault::from_number(fault).unwrap_or(Fault::DeviceError));
        let own = self.state.and_then(|s| of_device(s.fault));
        own.or_else(|| self.second.and_then(|s| of_device(s.fault)))
    }

    pub fn phase(&self) -> &'static str {
        match self.state.map(|s| Phase::from_number(s.phase)) {
            None => "n/a",
            Some(None) => "unknown",
            Some(Some(phase)) => phase.name(),
        }
    }

    pub fn planned(&self) -> &[PlannedSeed] {
        self.plan.as_ref().map_or(&[], |plan| {
            let count = (plan.seed_count as usize).min(plan.seeds.len());
            &plan.seeds[..count]
        })
    }

    /// Returns the depth as it is shown everywhere: the distance of the tip along the needle from the
    /// template's face, in which the entries lie; negative before it.
    pub fn depth_m(&self) -> Option<f64> {
        let from_face = || {
            let (template, tip_m) = (Template::before(self.scene.as_ref()?), self.tip_m()?);
            Some(dot(
                [0, 1, 2].map(|a| tip_m[a] - template.middle_m[a]),
                template.inwards,
            ))
        };
        self.path_depth_m().or_else(from_face)
    }

    /// Returns the depth of the tip along the planned path, from the entry.
    pub fn path_depth_m(&self) -> Option<f64> {
        let (plan, tip) = (self.plan.as_ref()?, self.tip_m()?);
        Some(along(plan, tip))
    }

    /// Returns the depth of a place along the planned path.
    pub fn depth_of_m(&self, place_m: [f64; 3]) -> Option<f64> {
        Some(along(self.plan.as_ref()?, place_m))
    }

    /// Returns whether the seeds belong to one needle, not to a plan of many.
    pub fn is_one_needle_by_hand(&self) -> bool {
        self.planning.implant.is_none() && self.plan.is_none_or(|plan| plan.prescribed.needle == 0)
    }

    /// Returns the seeds of the present needle, in the order of dropping.
    pub fn own_seeds(&self) -> &[SeedPose] {
        let own = self.planning.progress.own_seeds(self.seeds.len());
        &self.seeds[own]
    }

    /// Returns the depth of the tip when the planned seed leaves it, with compensation.
    fn drop_depth_m(&self, plan: &PlanInForce, number: usize) -> f64 {
        let planned_m = || along(plan, self.planned()[number].position_m);
        self.planning.drops_m().get(number).copied().unwrap_or_else(planned_m) + 0.5 * SEED_LENGTH_M
    }

    /// Returns how far the needle may go along the path.
    pub fn path_length_m(&self) -> Option<f64> {
        let plan = self.plan.as_ref()?;
        let deepest = (0..self.planned().len())
            .map(|number| self.drop_depth_m(plan, number))
            .fold(0.0, f64::max);
        Some((deepest + PAST_LAST_SEED_M).min(0.3))
    }

    /// Returns the depth of the tip when the deepest planned seed leaves it.
    pub fn deepest_seed_m(&self) -> Option<f64> {
        Some(self.path_length_m()? - PAST_LAST_SEED_M)
    }

    /// Returns the depth of the tip when the deepest planned seed without a dropped one leaves it; `None` if there is
    /// none.
    pub fn next_seed_m(&self) -> Option<f64> {
        let plan = self.plan.as_ref()?;
        let rows = own_errors(self);
        let missing = rows.iter().filter(|row| row.placed.is_none());
        missing
            .map(|row| self.drop_depth_m(plan, row.planned))
            .max_by(f64::total_cmp)
    }

    /// Returns the depression of the membrane in front of the tip, as a share of its puncture
    /// depth; `None` without a membrane.
    pub fn membrane_tension(&self) -> Option<f64> {
        let is_pressed = |s: &&HapticState| s.flags & flags::IN_CONTACT != 0 && s.flags & flags::PUNCTURED == 0;
        let state = self.state.as_ref().filter(is_pressed)?;
        (state.puncture_depth_m > 0.0).then(|| (state.depth_m / state.puncture_depth_m).clamp(0.0, 1.0))
    }

    pub fn on_path_m(&self, depth_m: f64) -> Option<[f64; 3]> {
        let plan = self.plan.as_ref()?;
        Some([0, 1, 2].map(|i| plan.entry_m[i] + plan.direction[i] * depth_m))
    }

    /// Returns the place at a depth along the planned path and an offset to the right and up, as
    /// seen from the perineum.
    pub fn place_near_path_m(&self, depth_m: f64, offset_m: [f64; 2]) -> Option<[f64; 3]> {
        let on_path = self.on_path_m(depth_m)?;
        let Some((_, axes)) = self.across() else {
            return Some(on_path);
        };
        Some([0, 1, 2].map(|a| on_path[a] + axes[0][a] * offset_m[0] + axes[1][a] * offset_m[1]))
    }

    /// Returns the template, and its columns and rows projected perpendicular to the planned path.
    fn across(&self) -> Option<(Template, [Vector3<f64>; 2])> {
        let template = Template::before(self.scene.as_ref()?);
        let direction = Vector3::from(self.plan.as_ref()?.direction);
        let columns = Vector3::from(template.columns);
        let right = (columns - direction * direction.dot(&columns)).try_normalize(1e-3)?;
        Some((template, [right, right.cross(&direction)]))
    }

    pub fn tip_on_path(&self) -> Option<TipOnPath> {
        let (plan, tip) = (self.plan.as_ref()?, self.tip_m()?);
        let off = |from: [f64; 3], to: [f64; 3]| Vector3::from(to) - Vector3::from(from);
        let (offset_m, room_m) = self.across().map_or(([0.0; 2], [[0.0; 2]; 2]), |(template, axes)| {
            let half_m = f64::from(HOLES / 2) * template.pitch_m;
            let to_middle = off(plan.entry_m, template.middle_m);
            (
                axes.map(|axis| off(plan.entry_m, tip).dot(&axis)),
                axes.map(|axis| [-1.0, 1.0].map(|side| to_middle.dot(&axis) + side * half_m)),
            )
        });
        Some(TipOnPath {
            depth_m: along(plan, tip),
            length_m: self.path_length_m()?,
            offset_m,
            room_m,
            is_free: !self.is_in_tissue(),
        })
    }

    pub fn path_end_m(&self) -> Option<[f64; 3]> {
        self.on_path_m(self.path_length_m()?)
    }

    /// Returns the distance of the tip from the planned path.
    pub fn off_path_m(&self) -> Option<f64> {
        let (tip, foot) = (self.tip_m()?, self.on_path_m(self.path_depth_m()?)?);
        Some([0, 1, 2].map(|i| (tip[i] - foot[i]).powi(2)).iter().sum::<f64>().sqrt())
    }

    /// Returns the force that resists the insertion, against the needle's direction.
    pub fn resistance_n(&self) -> Option<f64> {
        let s = self.state.as_ref()?;
        Some(-dot(s.force_on_hand_n, s.needle_direction))
    }
}

fn along(plan: &PlanInForce, place_m: [f64; 3]) -> f64 {
    dot([0, 1, 2].map(|i| place_m[i] - plan.entry_m[i]), plan.direction)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    /// Skin of 12 mm seemed punctured at 8 mm, the depth of the gland's capsule.
    #[test]
    fn the_tension_is_that_of_the_membrane_in_front_of_the_tip() {
        let mut shown = Shown::empty("lab");
        let mut state = HapticState::zeroed();
        (state.flags, state.depth_m, state.puncture_depth_m) = (flags::IN_CONTACT, 6e-3, 12e-3);
        shown.state = Some(state);
        shown.parameters = Some(ParametersInForce::zeroed());
        let tension = shown.membrane_tension().expect("a membrane");
        assert!((tension - 0.5).abs() < 1e-12, "{tension}");
        state.puncture_depth_m = 0.0;
        shown.state = Some(state);
        assert_eq!(shown.membrane_tension(), None, "tissue without a membrane");
        (state.puncture_depth_m, state.flags) = (12e-3, flags::IN_CONTACT | flags::PUNCTURED);
        shown.state = Some(state);
        assert_eq!(shown.membrane_tension(), None);
    }
}
