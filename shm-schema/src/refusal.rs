//! Reasons of a refusal: codes for programs, text for people.

use bytemuck::{Pod, Zeroable};

coded!(
    /// Reason of a refusal, by stable number. The subject is [`Reason::NO_SUBJECT`] unless stated.
    RefusalCode:

    /// The number of the command is unknown. Subject: that number.
    UnknownCommand = 1, "the command is not known; host and core differ";
    /// The payload is not a request of that number.
    Malformed = 2, "the command cannot be read; host and core differ";
    /// There are too many or too few needles, seeds or changes. Subject: the number received.
    WrongCount = 3, "there are too many or too few needles, seeds or changes";
    /// A position is too far from the origin, or not a number.
    PlaceTooFar = 5, "a place is too far away";
    /// A direction is not a unit vector.
    NotUnitDirection = 6, "a direction is not a unit vector";
    /// A speed, acceleration, distance or parameter is outside its limits, or not a number.
    ValueOutOfLimits = 7, "a speed, an acceleration or a distance is outside its limits";
    /// There is no built-in scene of that number.
    UnknownScene = 8, "there is no such built-in scene";
    /// The words are not UTF-8 of one line, or empty.
    InvalidText = 9, "the words are empty, longer than 96 bytes or not readable";
    /// A parameter is outside its limits. Subject: the parameter.
    ParameterOutOfLimits = 20, "outside its limits";
    /// With these shear angles a cell of tissue could fold (paper eq. 1). Subject: one of the parameters involved.
    CellsFold = 21, "with these shear angles cells fold over (eq. 1); lower one of them";
    /// The device cannot hold a spring of that stiffness. Subject: one of the parameters involved.
    TooStiff = 22, "stiffer than the device can hold";
    /// A model refuses values that the table allows.
    ParametersUnusable = 23, "the models cannot use these values together";
    /// More requests than the core carries out at once.
    TooManyRequests = 40, "too many requests at once; send fewer";
    /// The tip is outside the tissue.
    TipOutsideTissue = 41, "the tip is outside the tissue: move it in before dropping a seed";
    /// Every seed has been placed.
    NoSeedLeft = 42, "128 seeds are placed already; undo one first";
    /// There is no seed to remove.
    NoSeedToUndo = 43, "no seed has been placed";
    /// The needle is in the tissue.
    NeedleInTissue = 44, "the needle is in the tissue: retract it first";
    /// The simulated hand cannot reach the goal.
    BadGoal = 45, "the goal for the hand needs a finite place, a direction, and a speed and acceleration above zero";
    /// No needle in the tissue could be left there.
    NoNeedleToLeave = 46, "there is no needle in the tissue to leave there";
    /// The tip presses on a membrane, which would keep yielding under it.
    TipAtMembrane = 47, "the tip presses on a membrane: go through it or draw back, then leave the needle";
    /// The maximum number of needles already stays in.
    NoRoomToLeave = 48, "4 needles stay in already: draw one out first";
    /// No needle of that number stays in. Subject: the number.
    NoLeftNeedle = 49, "no needle of that number stays in the tissue";
    /// The hand is not at the tip of that needle.
    NotAtNeedle = 50, "bring the hand along that needle to within 2 mm of its tip, then take it up";
    /// The needle is on no line, which a needle needs to stay in.
    NeedleWithoutLine = 51,
        "the tissue was not prepared for this needle (no line): draw it back, wait, and go in again";
    /// The run's tissue model computes no forces.
    TissueWithoutStiffness = 52,
        "the tissue of this run has no stiffness: start rt-core with --tissue chainmail or --tissue fem";
    /// The run has no second device.
    NoSecondDevice = 55, "this run has no second device: start rt-core with --device-2 simulated, or another";
    /// Another scene is being loaded.
    SceneLoading = 60, "another scene is being loaded; wait until it is ready";
    /// The uploaded volume is invalid.
    InvalidVolume = 61, "the volume is invalid";
    /// The scene could not be built.
    SceneNotBuilt = 62, "the scene could not be built";
    /// Another rehearsal is running.
    RehearsalRunning = 70, "another rehearsal runs; wait until it is done";
    /// The rehearsal did not finish.
    RehearsalFailed = 71, "the rehearsal failed";
    /// The flight recording was not written.
    FlightNotSaved = 80, "the flight recording was not written";
    /// A fault of the core itself.
    Internal = 90, "rt-core failed; what it printed says where";
);

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
    /// Reasons; none for a request that did not reach the core.
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

    /// Returns whether this is one of the reasons.
    pub fn is_for(&self, code: RefusalCode) -> bool {
        self.reasons.iter().any(|reason| reason.code() == Some(code))
    }
}

impl From<RefusalCode> for Refusal {
    fn from(code: RefusalCode) -> Self {
        Self::new(code, code.message())
    }
}
