//! Validates every value of a request, or lists every reason against it.

use super::*;
use crate::check::{MAX_COORDINATE_M, is_unit};
use crate::{
    BUILTIN_SCENES, EXERCISE_STIFFNESS_RANGE, MARK_BYTES, MAX_EARLIER_NEEDLES, MAX_LEFT_NEEDLES, MAX_SEEDS,
    MOST_MOVED_M, MOST_PLANNED_NEEDLES, PRESCRIPTION_RANGE_GY, Reason, Refusal, RefusalCode, SEED_STRENGTH_RANGE_U,
    Text,
};

/// One problem with a request.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// No request has this number.
    #[error("command number {0} is not known; host and core differ")]
    UnknownCommand(u32),
    /// The payload is not a request of that kind.
    #[error("the {kind:?} command cannot be read; host and core differ")]
    Malformed {
        /// Kind of the request.
        kind: CommandKind,
    },
    /// The request does not fit into a record.
    #[error("the {kind:?} command names more than fits into one request")]
    TooLong {
        /// Kind of the request.
        kind: CommandKind,
    },
    /// A list has too many or too few entries.
    #[error("{count} {what} came; there must be {least} to {most}")]
    Count {
        /// Name of the entries.
        what: &'static str,
        /// Number received.
        count: usize,
        /// Smallest number.
        least: usize,
        /// Largest number.
        most: usize,
    },
    /// A position is farther out than [`MAX_COORDINATE_M`].
    #[error("the place {0:?} must be within {MAX_COORDINATE_M} m")]
    TooFar([f64; 3]),
    /// A direction is not a unit vector.
    #[error("the direction {0:?} is not a unit vector")]
    NotUnit([f64; 3]),
    /// A value is outside its limits.
    #[error("{what} is {value}; it must be {low} to {high}")]
    OutOfLimits {
        /// Name of the quantity with its unit.
        what: &'static str,
        /// The value received.
        value: f64,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// Needles are numbered from 1 on.
    #[error("no needle has the number 0")]
    NoNeedle,
    /// The words cannot be shown, or are empty.
    #[error("the words are empty, or no UTF-8 of one line in {MARK_BYTES} bytes")]
    InvalidText,
    /// No built-in scene has this number.
    #[error("there is no built-in scene number {number}; from 0 they are {}", BUILTIN_SCENES.join(", "))]
    UnknownScene {
        /// The number received.
        number: u32,
    },
}

impl RequestError {
    /// Returns the reason for a reply.
    pub fn reason(&self) -> Reason {
        let alone = |code| Reason::new(code, Reason::NO_SUBJECT);
        match *self {
            Self::UnknownCommand(number) => Reason::new(RefusalCode::UnknownCommand, number),
            Self::Malformed { .. } => alone(RefusalCode::Malformed),
            Self::TooLong { .. } => alone(RefusalCode::WrongCount),
            Self::Count { count, .. } => Reason::new(RefusalCode::WrongCount, u32::try_from(count).unwrap_or(u32::MAX)),
            Self::TooFar(_) => alone(RefusalCode::PlaceTooFar),
            Self::NotUnit(_) => alone(RefusalCode::NotUnitDirection),
            Self::OutOfLimits { .. } => alone(RefusalCode::ValueOutOfLimits),
            Self::NoNeedle => Reason::new(RefusalCode::NoLeftNeedle, 0),
            Self::UnknownScene { number } => Reason::new(RefusalCode::UnknownScene, number),
            Self::InvalidText => alone(RefusalCode::InvalidText),
        }
    }
}

/// All problems with one request; at least one.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", crate::refusal::lines(.0))]
pub struct RequestErrors(pub Vec<RequestError>);

impl From<RequestError> for RequestErrors {
    fn from(error: RequestError) -> Self {
        Self(vec![error])
    }
}

impl From<RequestErrors> for Refusal {
    fn from(errors: RequestErrors) -> Self {
        Self {
            reasons: errors.0.iter().map(RequestError::reason).collect(),
            text: errors.to_string(),
        }
    }
}

impl Request {
    /// Returns the request, or every reason against it.
    pub(super) fn verified(self) -> Result<Self, RequestErrors> {
        let mut verify = Verify::default();
        verify.request(&self);
        match verify.0.is_empty() {
            true => Ok(self),
            false => Err(RequestErrors(verify.0)),
        }
    }
}

/// Collects the errors of one request.
#[derive(Default)]
struct Verify(Vec<RequestError>);

impl Verify {
    fn request(&mut self, request: &Request) {
        match request {
            Request::SetParameters(changes) => self.parameters(changes),
            Request::SetPlan(Some(needle)) => self.planned(needle),
            Request::MoveHand(hand) => self.hand(hand),
            Request::MoveSecondHand(probe) => {
                self.hand(&probe.hand);
                probe.up.iter().for_each(|up| self.direction(up));
            }
            Request::DropSeed { strand_pitch_m } => self.pitch(*strand_pitch_m),
            Request::LoadBuiltinScene(number) => {
                let (number, is_known) = (*number, (*number as usize) < BUILTIN_SCENES.len());
                self.ensure(is_known, || RequestError::UnknownScene { number });
            }
            Request::Rehearse(run) => self.rehearsal(run),
            Request::ExpectNeedle(axis) => self.axis(&axis.entry_m, &axis.direction),
            Request::TakeNeedle(number) => self.number(*number),
            Request::DrawNeedle { number, speed_m_per_s } => {
                self.number(*number);
                self.within("the speed in m/s", *speed_m_per_s, SPEED_RANGE_M_PER_S);
            }
            Request::Mark(mark) => {
                self.within("the time before the request in s", mark.before_s, MARK_BEFORE_RANGE_S);
                let words = Text::<MARK_BYTES>::new(&mark.text);
                let can_be_shown = words.exact() == Some(&mark.text) && !mark.text.trim().is_empty();
                self.ensure(can_be_shown, || RequestError::InvalidText);
            }
            Request::BeginExercise(exercise) => self.exercise(*exercise),
            Request::KeepMoving { valid_s } => self.within("the promised time in s", *valid_s, VALID_RANGE_S),
            Request::SetPlan(None)
            | Request::Engage
            | Request::Disengage
            | Request::Reset
            | Request::UndoSeed
            | Request::Shutdown
            | Request::SaveFlight
            | Request::StopHand
            | Request::LeaveNeedle
            | Request::EndExercises
            | Request::StopSecondHand => {}
        }
    }

    fn parameters(&mut self, changes: &[ParameterChange]) {
        self.count("changes of parameters", changes.len(), 1, crate::PARAMETER_COUNT);
        for change in changes {
            // Tighter limits are checked once all parameters are known.
            self.within("a parameter", change.value, [f64::MIN, f64::MAX]);
        }
    }

    fn planned(&mut self, needle: &PlannedNeedle) {
        self.axis(&needle.entry_m, &needle.direction);
        self.count("planned seeds", needle.seeds_m.len(), 0, MAX_SEEDS);
        self.places(&needle.seeds_m);
        let of = &needle.prescribed;
        for number in [of.needle, of.last_needle] {
            let range = [0.0, f64::from(MOST_PLANNED_NEEDLES)];
            self.within("the number of a planned needle", f64::from(number), range);
        }
        self.within("the strength of a seed in U", of.strength_u, SEED_STRENGTH_RANGE_U);
        self.within("the prescribed dose in Gy", of.dose_gy, PRESCRIPTION_RANGE_GY);
        self.ensure(of.source.exact().is_some(), || RequestError::InvalidText);
    }

    fn rehearsal(&mut self, run: &NeedleRehearsal) {
        self.axis(&run.entry_m, &run.direction);
        self.within("the insertion in m/s", run.insert_m_per_s, SPEED_RANGE_M_PER_S);
        self.within("the retraction in m/s", run.retract_m_per_s, SPEED_RANGE_M_PER_S);
        self.within("the approach in m/s", run.approach_m_per_s, SPEED_RANGE_M_PER_S);
        self.acceleration(run.acceleration_m_per_s2);
        self.within(
            "the end of the retraction in m from the entry",
            run.retract_to_m,
            RETRACT_RANGE_M,
        );
        self.pitch(run.strand_pitch_m);
        self.count("needles that stay in", run.stabilising.len(), 0, MAX_LEFT_NEEDLES);
        self.count("earlier needles", run.earlier.len(), 0, MAX_EARLIER_NEEDLES);
        for needle in run.stabilising.iter().chain(&run.earlier) {
            self.axis(&needle.entry_m, &needle.direction);
            self.within("the depth of a needle in m", needle.depth_m, LEFT_DEPTH_RANGE_M);
        }
        self.count("drops", run.drops_m.len(), 1, MAX_SEEDS);
        self.places(&run.drops_m);
    }

    fn exercise(&mut self, exercise: Exercise) {
        match exercise {
            Exercise::DeviceLost => {}
            Exercise::StiffTissue { factor } => {
                self.within("the factor on the stiffness", factor, EXERCISE_STIFFNESS_RANGE);
            }
            Exercise::BodyMoved { .. } => {
                self.within("the distance of the body in m", exercise.value(), [0.0, MOST_MOVED_M]);
            }
        }
    }

    fn hand(&mut self, hand: &HandMove) {
        self.axis(&hand.tip_m, &hand.direction);
        self.within("the speed in m/s", hand.speed_m_per_s, SPEED_RANGE_M_PER_S);
        self.acceleration(hand.acceleration_m_per_s2);
    }

    fn acceleration(&mut self, value: f64) {
        self.within("the acceleration in m/s2", value, ACCELERATION_RANGE_M_PER_S2);
    }

    fn pitch(&mut self, pitch_m: Option<f64>) {
        if let Some(pitch_m) = pitch_m {
            self.within("the pitch of a strand in m", pitch_m, STRAND_PITCH_RANGE_M);
        }
    }

    fn number(&mut self, number: u32) {
        self.ensure(number > 0, || RequestError::NoNeedle);
    }

    fn axis(&mut self, place_m: &[f64; 3], direction: &[f64; 3]) {
        self.places(&[*place_m]);
        self.direction(direction);
    }

    // Comparisons with NaN are false, here and below.
    fn places(&mut self, places_m: &[[f64; 3]]) {
        for place_m in places_m {
            let is_near = place_m.iter().all(|c| c.abs() <= MAX_COORDINATE_M);
            self.ensure(is_near, || RequestError::TooFar(*place_m));
        }
    }

    fn direction(&mut self, direction: &[f64; 3]) {
        self.ensure(is_unit(direction), || RequestError::NotUnit(*direction));
    }

    fn within(&mut self, what: &'static str, value: f64, [low, high]: [f64; 2]) {
        self.ensure((low..=high).contains(&value), || RequestError::OutOfLimits {
            what,
            value,
            low,
            high,
        });
    }

    fn count(&mut self, what: &'static str, count: usize, least: usize, most: usize) {
        self.ensure((least..=most).contains(&count), || RequestError::Count {
            what,
            count,
            least,
            most,
        });
    }

    fn ensure(&mut self, holds: bool, error: impl FnOnce() -> RequestError) {
        if !holds {
            self.0.push(error());
        }
    }
}
