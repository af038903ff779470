//! Reasons of a refusal: codes for programs, text for people.

use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;

/// Reason of a refusal, by stable number. The subject is [`Reason::NO_SUBJECT`] unless stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, TryFromPrimitive)]
#[repr(u32)]
pub enum RefusalCode {
    /// The number of the command is unknown. Subject: that number.
    UnknownCommand = 1,
    /// The payload is not a request of that number.
    Malformed = 2,
    /// There are too many or too few needles, seeds or changes. Subject: the number received.
    WrongCount = 3,
    /// A position is too far from the origin, or not a number.
    PlaceTooFar = 5,
    /// A direction is not a unit vector.
    NotUnitDirection = 6,
    /// A speed, acceleration, distance or parameter is outside its limits, or not a number.
    ValueOutOfLimits = 7,
    /// There is no built-in scene of that number.
    UnknownScene = 8,
    /// The words are not UTF-8 of one line, or empty.
    InvalidText = 9,
    /// A parameter is outside its limits. Subject: the parameter.
    ParameterOutOfLimits = 20,
    /// With these shear angles a cell of tissue could fold (paper eq. 1). Subject: one of the parameters involved.
    CellsFold = 21,
    /// The device cannot hold a spring of that stiffness. Subject: one of the parameters involved.
    TooStiff = 22,
    /// A model refuses values that the table allows.
    ParametersUnusable = 23,
    /// More requests than the core carries out at once.
    TooManyRequests = 40,
    /// The tip is outside the tissue.
    TipOutsideTissue = 41,
    /// Every seed has been placed.
    NoSeedLeft = 42,
    /// There is no seed to remove.
    NoSeedToUndo = 43,
    /// The needle is in the tissue.
    NeedleInTissue = 44,
    /// The simulated hand cannot reach the goal.
    BadGoal = 45,
    /// No needle in the tissue could be left there.
    NoNeedleToLeave = 46,
    /// The tip presses on a membrane, which would keep yielding under it.
    TipAtMembrane = 47,
    /// The maximum number of needles already stays in.
    NoRoomToLeave = 48,
    /// No needle of that number stays in. Subject: the number.
    NoLeftNeedle = 49,
    /// The hand is not at the tip of that needle.
    NotAtNeedle = 50,
    /// The needle is on no line, which a needle needs to stay in.
    NeedleWithoutLine = 51,
    /// The run's tissue model computes no forces.
    TissueWithoutStiffness = 52,
    /// The run has no second device.
    NoSecondDevice = 55,
    /// Another scene is being loaded.
    SceneLoading = 60,
    /// The uploaded volume is invalid.
    InvalidVolume = 61,
    /// The scene could not be built.
    SceneNotBuilt = 62,
    /// Another rehearsal is running.
    RehearsalRunning = 70,
    /// The rehearsal did not finish.
    RehearsalFailed = 71,
    /// The flight recording was not written.
    FlightNotSaved = 80,
    /// A fault of the core itself.
    Internal = 90,
}

impl RefusalCode {
    /// Returns the code; `None` if this build does not know the number.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::try_from(number).ok()
    }

    /// Returns the default text for people.
    pub fn message(self) -> &'static str {
        match self {
            Self::UnknownCommand => "the command is not known; host and core differ",
            Self::Malformed => "the command cannot be read; host and core differ",
            Self::WrongCount => "there are too many or too few needles, seeds or changes",
            Self::PlaceTooFar => "a place is too far away",
            Self::NotUnitDirection => "a direction is not a unit vector",
            Self::ValueOutOfLimits => "a speed, an acceleration or a distance is outside its limits",
            Self::UnknownScene => "there is no such built-in scene",
            Self::InvalidText => "the words are empty, longer than 96 bytes or not readable",
            Self::ParameterOutOfLimits => "outside its limits",
            Self::CellsFold => "with these shear angles cells fold over (eq. 1); lower one of them",
            Self::TooStiff => "stiffer than the device can hold",
            Self::ParametersUnusable => "the models cannot use these values together",
            Self::TooManyRequests => "too many requests at once; send fewer",
            Self::TipOutsideTissue => "the tip is outside the tissue: move it in before dropping a seed",
            Self::NoSeedLeft => "128 seeds are placed already; undo one first",
            Self::NoSeedToUndo => "no seed has been placed",
            Self::NeedleInTissue => "the needle is in the tissue: retract it first",
            Self::BadGoal => {
                "the goal for the hand needs a finite place, a direction, and a speed and acceleration above zero"
            }
            Self::NoNeedleToLeave => "there is no needle in the tissue to leave there",
            Self::TipAtMembrane => "the tip presses on a membrane: go through it or draw back, then leave the needle",
            Self::NoRoomToLeave => "4 needles stay in already: draw one out first",
            Self::NoLeftNeedle => "no needle of that number stays in the tissue",
            Self::NotAtNeedle => "bring the hand along that needle to within 2 mm of its tip, then take it up",
            Self::NeedleWithoutLine => {
                "the tissue was not prepared for this needle (no line): draw it back, wait, and go in again"
            }
            Self::TissueWithoutStiffness => {
                "the tissue of this run has no stiffness: start rt-core with --tissue chainmail or --tissue fem"
            }
            Self::NoSecondDevice => {
                "this run has no second device: start rt-core with --device-2 simulated, or another"
            }
            Self::SceneLoading => "another scene is being loaded; wait until it is ready",
            Self::InvalidVolume => "the volume is invalid",
            Self::SceneNotBuilt => "the scene could not be built",
            Self::RehearsalRunning => "another rehearsal runs; wait until it is done",
            Self::RehearsalFailed => "the rehearsal failed",
            Self::FlightNotSaved => "the flight recording was not written",
            Self::Internal => "rt-core failed; what it printed says where",
        }
    }
}

/// One reason of a refusal, as in a [`crate::Reply`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Reason {
    /// [`RefusalCode`] by number.
    pub code: u32,
    /// Subject of the reason; its meaning depends on the code.
    pub subject: u32,
}

impl Reason {
    /// Subject of a reason without one.
    pub const NO_SUBJECT: u32 = u32::MAX;

    /// Returns a reason with its subject.
    pub fn new(code: RefusalCode, subject: u32) -> Self {
        let code = code as u32;
        Self { code, subject }
    }

    /// Returns the code; `None` if this build does not know the number.
    pub fn code(&self) -> Option<RefusalCode> {
        RefusalCode::from_number(self.code)
    }
}

/// A refusal by the core.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Refusal {
    /// Reasons; at least one.
    pub reasons: Vec<Reason>,
    /// All reasons as text, one per line.
    pub text: String,
}

impl Refusal {
    /// Returns a refusal for a reason without a subject, explained by `text`.
    pub fn new(code: RefusalCode, text: impl Into<String>) -> Self {
        Self {
            reasons: vec![Reason::new(code, Reason::NO_SUBJECT)],
            text: text.into(),
        }
    }
}

impl From<RefusalCode> for Refusal {
    fn from(code: RefusalCode) -> Self {
        Self::new(code, code.message())
    }
}

pub(crate) fn lines(problems: &[impl std::fmt::Display]) -> String {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    lines.join("\n")
}
