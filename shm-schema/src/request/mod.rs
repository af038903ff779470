//! Requests of hosts, typed; [`Request::encode`] and [`Request::decode`] are the only way to and from a [`Command`].

mod verify;

use crate::{Command, Exercise, ParameterId, PlannedNeedle, Reason, Refusal, RefusalCode};
use bytemuck::Zeroable;
use num_enum::TryFromPrimitive;
use serde::{Deserialize, Serialize};
use strum::EnumDiscriminants;

/// Slowest and fastest speed of the simulated hand, m/s.
pub const SPEED_RANGE_M_PER_S: [f64; 2] = [1e-4, 1.0];
/// Range of the pitch between seed centres of a strand.
pub const STRAND_PITCH_RANGE_M: [f64; 2] = [1e-3, 0.06];
/// Smallest and largest acceleration of the simulated hand, m/s².
pub const ACCELERATION_RANGE_M_PER_S2: [f64; 2] = [1e-2, 100.0];
/// Range of the depth to which a rehearsed needle may be drawn back, from the entry along the needle, m.
pub const RETRACT_RANGE_M: [f64; 2] = [-0.5, 0.5];

/// Range of the depth from its entry at which a needle stays in during a rehearsal, m.
pub const LEFT_DEPTH_RANGE_M: [f64; 2] = [1e-3, 0.5];

/// Range of the age of a marked moment at its request, s: the words take time to type.
pub const MARK_BEFORE_RANGE_S: [f64; 2] = [0.0, 120.0];

/// Range of the time that a host can promise for its next renewal, s.
pub const VALID_RANGE_S: [f64; 2] = [0.02, 0.3];

/// One request of a host. The numbers are stable: [`CommandKind`] is derived from them, and [`Command::kind`] carries
/// them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, EnumDiscriminants)]
#[strum_discriminants(name(CommandKind), derive(TryFromPrimitive), allow(missing_docs))]
#[strum_discriminants(doc = "Kind of a [`Request`] by stable number, as [`Command::kind`] carries it.")]
#[repr(u32)]
pub enum Request {
    /// Change parameters. With the reply all are in force, or none.
    SetParameters(Vec<ParameterChange>) = 1,
    /// Publish a plan to all hosts; `None` withdraws it.
    SetPlan(Option<PlannedNeedle>) = 2,
    /// Set the goal of the simulated hand.
    MoveHand(HandMove) = 3,
    /// Leave a seed at the tip.
    DropSeed {
        /// For needles loaded with strands: pitch between seed centres, m, within [`STRAND_PITCH_RANGE_M`]. The seed is
        /// joined to the one dropped before it if that lies behind it on the same needle at about this pitch.
        strand_pitch_m: Option<f64>,
    } = 4,
    /// Turn the force on; also re-arms after a fault.
    Engage = 5,
    /// Ramp the force to zero.
    Disengage = 6,
    /// Bring the tissue to rest, remove the seeds, clear peaks and worst cases.
    Reset = 7,
    /// Run a built-in scene, by its index in [`crate::BUILTIN_SCENES`].
    LoadBuiltinScene(u32) = 8,
    /// Remove the last seed. After a reset, restore the seeds that it removed, until another is dropped.
    UndoSeed = 9,
    /// End `rt-core`.
    Shutdown = 10,
    /// Write the flight recording of both loops to disk.
    SaveFlight = 11,
    /// Simulate one needle ahead of time, from rest, in a separate body; a [`crate::Rehearsal`] is sent before the
    /// reply.
    Rehearse(NeedleRehearsal) = 12,
    /// Stop the simulated hand as fast as it can; only the core knows where that is. In a run with a second device,
    /// stop both hands.
    StopHand = 13,
    /// Announce the needle after the planned one, so that the core can prepare for it.
    ExpectNeedle(NeedleAxis) = 14,
    /// Leave the needle where it is; the hand is empty until it is out of the tissue, and takes a new one there.
    /// Refused if the tip is in no tissue or presses on a membrane, if the needle has no line, and beyond
    /// [`crate::MAX_LEFT_NEEDLES`].
    LeaveNeedle = 15,
    /// Take a needle that stays in, by its number, with the hand at its tip.
    TakeNeedle(u32) = 16,
    /// Draw out a needle that stays in, without the hand.
    DrawNeedle {
        /// Its number.
        number: u32,
        /// Speed, m/s, within [`SPEED_RANGE_M_PER_S`].
        speed_m_per_s: f64,
    } = 17,
    /// Add a moment with a few words to the events.
    Mark(Mark) = 18,
    /// Inject a fault for a trainee to find; replaces one of the same kind.
    BeginExercise(Exercise) = 19,
    /// Remove all injected faults. A reset does so as well.
    EndExercises = 20,
    /// Keep this host's motions going: both hands and needles being drawn out. A motion whose host is not heard within
    /// the promised time brakes, resumes if the host is heard within 0.3 s, and is given up after that
    /// ([`crate::EventKind::MotionGivenUp`]). A request that begins a motion promises 20 ms. A valid one is not
    /// answered.
    KeepMoving {
        /// Time for which the motion continues without another of these, s, within [`VALID_RANGE_S`].
        valid_s: f64,
    } = 21,
    /// Set the goal of the simulated hand that holds the second device.
    MoveSecondHand(ProbeMove) = 30,
    /// Stop that hand, but not the needle's.
    StopSecondHand = 31,
}

/// A moment and its description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// 1 to [`crate::MARK_BYTES`] bytes of UTF-8 without control characters.
    pub text: String,
    /// Age of the moment at the request, s, within [`MARK_BEFORE_RANGE_S`].
    pub before_s: f64,
}

/// Axis of a needle, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeedleAxis {
    /// Entry of the needle, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
}

/// New value of one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterChange {
    /// The parameter.
    pub id: ParameterId,
    /// The value, SI.
    pub value: f64,
}

/// Goal of the simulated hand, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandMove {
    /// Target of the tip, m.
    pub tip_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub direction: [f64; 3],
    /// Largest speed, m/s, within [`SPEED_RANGE_M_PER_S`].
    pub speed_m_per_s: f64,
    /// Largest acceleration, m/s², within [`ACCELERATION_RANGE_M_PER_S2`].
    pub acceleration_m_per_s2: f64,
}

/// Goal of the simulated hand that holds the ultrasound probe, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeMove {
    /// Goal of its tip.
    pub hand: HandMove,
    /// Unit vector for the tool's +y, the probe's middle beam; only its component perpendicular to the direction
    /// counts. Without it the hand does not roll the probe.
    pub up: Option<[f64; 3]>,
}

/// One needle to rehearse, scene frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeedleRehearsal {
    /// Entry of the needle, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
    /// Speed to the first drop, m/s.
    pub insert_m_per_s: f64,
    /// Speed between drops and out, m/s.
    pub retract_m_per_s: f64,
    /// Speed to the entry, m/s.
    pub approach_m_per_s: f64,
    /// Acceleration of the hand, m/s².
    pub acceleration_m_per_s2: f64,
    /// Depth to which the tip is drawn back at the end, from the entry, m, within [`RETRACT_RANGE_M`].
    pub retract_to_m: f64,
    /// As in [`Request::DropSeed`].
    pub strand_pitch_m: Option<f64>,
    /// Needles that go in first and stay, at most [`crate::MAX_LEFT_NEEDLES`].
    pub stabilising: Vec<StabilisingNeedle>,
    /// Needles that came and went before, to their depths and in order, at most [`crate::MAX_EARLIER_NEEDLES`]: each
    /// shifts the needles that stay, and the tissue that they hold, a little. Unused without needles that stay.
    pub earlier: Vec<StabilisingNeedle>,
    /// Seeds take no room: drops that look for edges lie nearer to each other than a seed is long.
    pub as_points: bool,
    /// Middle of each seed where the needle leaves it, m, in the order of the drops: 1 to [`crate::MAX_SEEDS`].
    pub drops_m: Vec<[f64; 3]>,
}

/// A needle that goes in, drops no seed, and stays while others come and go; scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilisingNeedle {
    /// Entry of the needle, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
    /// Depth of its tip from the entry, m, within [`LEFT_DEPTH_RANGE_M`].
    pub depth_m: f64,
}

impl CommandKind {
    /// True if a request of that number removes force or motion: it is sent both ways, and no limit delays it.
    pub fn is_stop(number: u32) -> bool {
        let stops = [Self::Disengage, Self::StopHand, Self::StopSecondHand, Self::Shutdown];
        stops.map(|kind| kind as u32).contains(&number)
    }
}

impl Request {
    /// Kind of the request, without its payload.
    pub fn kind(&self) -> CommandKind {
        self.into()
    }

    /// Encodes the request into the record that crosses the process. Checks only that it fits: [`Request::decode`]
    /// validates everything.
    pub fn encode(&self, host_id: u64, command_id: u64) -> Result<Command, Refusal> {
        let mut command = Command::zeroed();
        (command.host_id, command.command_id, command.kind) = (host_id, command_id, self.kind() as u32);
        let packed = postcard::to_slice(self, &mut command.payload);
        let too_long = |_| {
            let text = format!("the {:?} command names more than fits into one request", self.kind());
            Refusal::new(RefusalCode::WrongCount, text)
        };
        command.length = packed.map_err(too_long)?.len() as u32;
        Ok(command)
    }

    /// Decodes a record of any bytes and validates every value. Limits of parameters are checked by
    /// [`crate::ParameterSet::problems`], which needs the other parameters.
    pub fn decode(command: &Command) -> Result<Self, Refusal> {
        let number = command.kind;
        let kind = CommandKind::try_from(number).map_err(|_| Refusal {
            reasons: vec![Reason::new(RefusalCode::UnknownCommand, number)],
            text: format!("command number {number} is not known; host and core differ"),
        })?;
        let payload = command.payload.get(..command.length as usize);
        let unpacked = payload.and_then(|payload| postcard::take_from_bytes::<Self>(payload).ok());
        match unpacked {
            Some((request, [])) if request.kind() == kind => request.verified(),
            _ => {
                let text = format!("the {kind:?} command cannot be read; host and core differ");
                Err(Refusal::new(RefusalCode::Malformed, text))
            }
        }
    }
}

#[cfg(test)]
mod tests;
