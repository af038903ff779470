//! What a host may ask for, typed; [`Request::encode`] and [`Request::decode`] are the only way to and from a [`Command`].

mod verify;

pub use verify::{RequestError, RequestErrors};

use crate::{Command, Exercise, ParameterId, PlannedNeedle};
use bytemuck::Zeroable;
use num_enum::TryFromPrimitive;
use serde::{Deserialize, Serialize};
use strum::EnumDiscriminants;

/// Slowest and fastest speed of the simulated hand, m/s.
pub const SPEED_RANGE_M_PER_S: [f64; 2] = [1e-4, 1.0];
/// From middle to middle of two seeds of a strand.
pub const STRAND_PITCH_RANGE_M: [f64; 2] = [1e-3, 0.06];
/// Smallest and largest acceleration of the simulated hand, m/s².
pub const ACCELERATION_RANGE_M_PER_S2: [f64; 2] = [1e-2, 100.0];
/// How far from the entry a rehearsed needle may be drawn back to, along the needle, m.
pub const RETRACT_RANGE_M: [f64; 2] = [-0.5, 0.5];

/// How deep from its entry a needle that stays in is rehearsed, m.
pub const LEFT_DEPTH_RANGE_M: [f64; 2] = [1e-3, 0.5];

/// How long before its request a marked moment may lie, s: somebody types the words meanwhile.
pub const MARK_BEFORE_RANGE_S: [f64; 2] = [0.0, 120.0];

/// Shortest and longest time for which a host can promise to be heard again while what it moves goes on, s.
pub const VALID_RANGE_S: [f64; 2] = [0.02, 0.3];

/// One request of a host. The numbers are stable: [`CommandKind`] is made from them, and [`Command::kind`] carries them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, EnumDiscriminants)]
#[strum_discriminants(name(CommandKind), derive(TryFromPrimitive))]
#[strum_discriminants(doc = "Kind of a [`Request`] by stable number, as [`Command::kind`] carries it.")]
#[repr(u32)]
pub enum Request {
    /// Change parameters. All are in force with the reply, or none.
    #[strum_discriminants(doc = "[`Request::SetParameters`]")]
    SetParameters(Vec<ParameterChange>) = 1,
    /// Publish a plan to all hosts; `None` withdraws it.
    #[strum_discriminants(doc = "[`Request::SetPlan`]")]
    SetPlan(Option<PlannedNeedle>) = 2,
    /// Set the goal of the simulated hand.
    #[strum_discriminants(doc = "[`Request::MoveHand`]")]
    MoveHand(HandMove) = 3,
    /// Leave a seed at the tip.
    #[strum_discriminants(doc = "[`Request::DropSeed`]")]
    DropSeed {
        /// Where needles are loaded with strands: from middle to middle of two seeds, m, within [`STRAND_PITCH_RANGE_M`]. The
        /// seed is joined to the one dropped before it, where that is behind it by about so much on the same needle.
        strand_pitch_m: Option<f64>,
    } = 4,
    /// Turn the force on; also re-arms after a fault.
    #[strum_discriminants(doc = "[`Request::Engage`]")]
    Engage = 5,
    /// Ramp the force to zero.
    #[strum_discriminants(doc = "[`Request::Disengage`]")]
    Disengage = 6,
    /// Bring the tissue to rest, remove the seeds, clear peaks and worst cases.
    #[strum_discriminants(doc = "[`Request::Reset`]")]
    Reset = 7,
    /// Run a built-in scene, by its place in [`crate::BUILTIN_SCENES`].
    #[strum_discriminants(doc = "[`Request::LoadBuiltinScene`]")]
    LoadBuiltinScene(u32) = 8,
    /// Remove the last seed.
    #[strum_discriminants(doc = "[`Request::UndoSeed`]")]
    UndoSeed = 9,
    /// End `rt-core`.
    #[strum_discriminants(doc = "[`Request::Shutdown`]")]
    Shutdown = 10,
    /// Write the flight recording of both loops to disk.
    #[strum_discriminants(doc = "[`Request::SaveFlight`]")]
    SaveFlight = 11,
    /// Simulate one needle ahead of time, in a body of its own, from rest; a [`crate::Rehearsal`] is sent before the reply.
    #[strum_discriminants(doc = "[`Request::Rehearse`]")]
    Rehearse(NeedleRehearsal) = 12,
    /// Stop the simulated hand as fast as it can; only the core knows where that is. Of a run with a second device, both hands.
    #[strum_discriminants(doc = "[`Request::StopHand`]")]
    StopHand = 13,
    /// The needle that will come after the planned one: what it needs is prepared meanwhile.
    #[strum_discriminants(doc = "[`Request::ExpectNeedle`]")]
    ExpectNeedle(NeedleAxis) = 14,
    /// Leave the needle where it is; the hand is empty until it is out of the tissue, and takes up a new one there. Refused where the
    /// tip is in no tissue or presses on a membrane, where the needle has no line, and beyond [`crate::MAX_LEFT_NEEDLES`].
    #[strum_discriminants(doc = "[`Request::LeaveNeedle`]")]
    LeaveNeedle = 15,
    /// Take up again a needle that stays in, by its number, with the hand at its tip.
    #[strum_discriminants(doc = "[`Request::TakeNeedle`]")]
    TakeNeedle(u32) = 16,
    /// Draw a needle out that stays in, without the hand.
    #[strum_discriminants(doc = "[`Request::DrawNeedle`]")]
    DrawNeedle {
        /// Its number.
        number: u32,
        /// How fast, m/s, within [`SPEED_RANGE_M_PER_S`].
        speed_m_per_s: f64,
    } = 17,
    /// Put a moment with a few words among the events.
    #[strum_discriminants(doc = "[`Request::Mark`]")]
    Mark(Mark) = 18,
    /// Put a fault in, for a trainee to find; in place of one of the same kind.
    #[strum_discriminants(doc = "[`Request::BeginExercise`]")]
    BeginExercise(Exercise) = 19,
    /// Take every fault away that was put in. A reset does so as well.
    #[strum_discriminants(doc = "[`Request::EndExercises`]")]
    EndExercises = 20,
    /// Keep in motion what this host moves: both hands and needles that are drawn out. A motion whose host is not heard in the time that
    /// it promised brakes, goes on where the host is heard within 0.3 s, and is given up after that
    /// ([`crate::EventKind::MotionGivenUp`]). A request that begins a motion promises 20 ms. Not answered where it is valid.
    #[strum_discriminants(doc = "[`Request::KeepMoving`]")]
    KeepMoving {
        /// How long the motion goes on without another one of these, s, within [`VALID_RANGE_S`].
        valid_s: f64,
    } = 21,
    /// Set the goal of the simulated hand that holds the second device.
    #[strum_discriminants(doc = "[`Request::MoveSecondHand`]")]
    MoveSecondHand(ProbeMove) = 30,
    /// Stop that hand, and not the needle's.
    #[strum_discriminants(doc = "[`Request::StopSecondHand`]")]
    StopSecondHand = 31,
}

/// A moment and what is to be said of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// 1 to [`crate::MARK_BYTES`] bytes of UTF-8 without control characters.
    pub text: String,
    /// How long before the request it was, s, within [`MARK_BEFORE_RANGE_S`].
    pub before_s: f64,
}

/// Where a needle goes in, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeedleAxis {
    /// Where the needle enters, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
}

/// New value of one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterChange {
    /// Which parameter.
    pub id: ParameterId,
    /// The value, SI.
    pub value: f64,
}

/// Goal of the simulated hand, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandMove {
    /// Where the tip goes, m.
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
    /// Of its tip.
    pub hand: HandMove,
    /// Unit vector where +y of the tool goes, the probe's middle beam, as far as that is square to the direction. Without it the hand
    /// does not turn the probe about its axis.
    pub up: Option<[f64; 3]>,
}

/// One needle to rehearse, scene frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeedleRehearsal {
    /// Where the needle enters, m.
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
    /// How far from the entry the tip is drawn back to at the end, m, within [`RETRACT_RANGE_M`].
    pub retract_to_m: f64,
    /// As in [`Request::DropSeed`].
    pub strand_pitch_m: Option<f64>,
    /// Needles that go in before it and stay, at most [`crate::MAX_LEFT_NEEDLES`].
    pub stabilising: Vec<StabilisingNeedle>,
    /// Needles that went that deep and came out again beside those that stay, in their order, at most [`crate::MAX_EARLIER_NEEDLES`]: each
    /// leaves those that stay, and the tissue that they hold, a little elsewhere. Nothing without needles that stay.
    pub earlier: Vec<StabilisingNeedle>,
    /// Where the tip leaves each seed, m, in the order of the drops: 1 to [`crate::MAX_SEEDS`].
    pub drops_m: Vec<[f64; 3]>,
}

/// A needle that goes in, leaves no seed, and stays while others come and go; scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilisingNeedle {
    /// Where the needle enters, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
    /// How far from the entry its tip stays, m, within [`LEFT_DEPTH_RANGE_M`].
    pub depth_m: f64,
}

impl CommandKind {
    /// A request of that number takes force or motion away: it is sent both ways, and no limit holds it up.
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

    /// Packs the request into the record that crosses the process. Verifies nothing but that it fits: [`Request::decode`] verifies
    /// everything.
    pub fn encode(&self, host_id: u64, command_id: u64) -> Result<Command, RequestErrors> {
        let mut command = Command::zeroed();
        (command.host_id, command.command_id, command.kind) = (host_id, command_id, self.kind() as u32);
        let packed = postcard::to_slice(self, &mut command.payload);
        command.length = packed.map_err(|_| RequestError::TooLong { kind: self.kind() })?.len() as u32;
        Ok(command)
    }

    /// Unpacks a record of any bytes and verifies every value. The limits of a parameter are those of
    /// [`crate::ParameterSet::problems`], which needs the other parameters.
    pub fn decode(command: &Command) -> Result<Self, RequestErrors> {
        let number = command.kind;
        let kind = CommandKind::try_from(number).map_err(|_| RequestError::UnknownCommand(number))?;
        let payload = command.payload.get(..command.length as usize);
        let unpacked = payload.and_then(|payload| postcard::take_from_bytes::<Self>(payload).ok());
        match unpacked {
            Some((request, [])) if request.kind() == kind => request.verified(),
            _ => Err(RequestError::Malformed { kind }.into()),
        }
    }
}

#[cfg(test)]
mod tests;
