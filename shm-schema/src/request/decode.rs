//! From a [`Command`] of any bytes to a [`Request`], or every reason against it.

mod exercise;
mod prescribed;

use super::*;
use crate::check::{MAX_COORDINATE_M, is_unit};
use crate::{MAX_COMMAND_VALUES, MAX_EARLIER_NEEDLES, MAX_LEFT_NEEDLES, Reason, Refusal, RefusalCode};

/// What is wrong with one record. `at` is the place of the first value concerned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// No request has this number.
    #[error("command number {0} is not known; host and core differ")]
    UnknownCommand(u32),
    /// More or fewer values than the payload has.
    #[error("{kind:?} takes {}; {count} values came", takes(*kind))]
    Count {
        /// The request.
        kind: CommandKind,
        /// Values that came.
        count: u32,
    },
    /// A value is infinite or not a number.
    #[error("value {at} is not a finite number")]
    NotFinite {
        /// Place of the value.
        at: u32,
    },
    /// No parameter has this number.
    #[error("parameter number {number} is not known; there are {}", crate::PARAMETER_COUNT)]
    UnknownParameter {
        /// Place of the value.
        at: u32,
        /// The number that came.
        number: f64,
    },
    /// A coordinate is farther than [`MAX_COORDINATE_M`].
    #[error("the place {place_m:?} must be within {} m", MAX_COORDINATE_M)]
    TooFar {
        /// Place of its first value.
        at: u32,
        /// The place that came, m.
        place_m: [f64; 3],
    },
    /// A direction that is not a unit vector.
    #[error("the direction {direction:?} is not a unit vector")]
    NotUnit {
        /// Place of its first value.
        at: u32,
        /// The direction that came.
        direction: [f64; 3],
    },
    /// A speed, an acceleration or a distance outside its limits.
    #[error("{what} is {value}; it must be {low} to {high}")]
    OutOfLimits {
        /// Place of the value.
        at: u32,
        /// Name of the quantity with its unit.
        what: &'static str,
        /// The value that came.
        value: f64,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// A needle that stays in has a whole number, from 1 on.
    #[error("no needle has the number {number}")]
    NoNeedle {
        /// Place of the value.
        at: u32,
        /// The number that came.
        number: f64,
    },
    /// Words that cannot be shown, or none.
    #[error("the words are empty, or no UTF-8 of one line in {} bytes", crate::MARK_BYTES)]
    InvalidText,
    /// No built-in scene has this number.
    #[error("there is no built-in scene number {number}; from 0 they are {}", BUILTIN_SCENES.join(", "))]
    UnknownScene {
        /// The number that came.
        number: f64,
    },
}

/// Everything that is wrong with one record; at least one problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", crate::refusal::lines(.0))]
pub struct RequestErrors(pub Vec<RequestError>);

impl From<RequestError> for RequestErrors {
    fn from(error: RequestError) -> Self {
        Self(vec![error])
    }
}

impl RequestError {
    pub(super) fn count(kind: CommandKind, count: usize) -> Self {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        Self::Count { kind, count }
    }

    /// Reason code of a reply, and what it is about.
    pub fn reason(&self) -> (RefusalCode, u32) {
        match *self {
            Self::UnknownCommand(number) => (RefusalCode::UnknownCommand, number),
            Self::Count { count, .. } => (RefusalCode::ValueCount, count),
            Self::NotFinite { at } => (RefusalCode::NotFinite, at),
            Self::UnknownParameter { at, .. } => (RefusalCode::UnknownParameter, at),
            Self::TooFar { at, .. } => (RefusalCode::PlaceTooFar, at),
            Self::NotUnit { at, .. } => (RefusalCode::NotUnitDirection, at),
            Self::OutOfLimits { at, .. } => (RefusalCode::ValueOutOfLimits, at),
            Self::NoNeedle { at, .. } => (RefusalCode::NoLeftNeedle, at),
            Self::UnknownScene { .. } => (RefusalCode::UnknownScene, 0),
            Self::InvalidText => (RefusalCode::InvalidText, Reason::NO_SUBJECT),
        }
    }
}

fn takes(kind: CommandKind) -> String {
    match kind {
        CommandKind::SetParameters => "pairs of number and value".to_owned(),
        CommandKind::SetPlan => {
            format!(
                "nothing, or entry and direction, four values on the seeds, and at most {MAX_SEEDS} seeds of three values each"
            )
        }
        CommandKind::MoveHand => "8 values".to_owned(),
        CommandKind::MoveSecondHand => "8 values, and three more where it turns about its axis".to_owned(),
        CommandKind::LoadBuiltinScene | CommandKind::KeepMoving => "one number".to_owned(),
        CommandKind::DropSeed => "nothing, or the pitch of a strand".to_owned(),
        CommandKind::ExpectNeedle => "entry and direction, three values each".to_owned(),
        CommandKind::TakeNeedle => "the number of a needle".to_owned(),
        CommandKind::Mark => "how long ago, and words".to_owned(),
        CommandKind::BeginExercise => "the number of an exercise, and its factor or its three distances".to_owned(),
        CommandKind::DrawNeedle => "the number of a needle, and a speed".to_owned(),
        CommandKind::Rehearse => format!(
            "14 values, seven for each of at most {MAX_LEFT_NEEDLES} needles that stay in and at most {MAX_EARLIER_NEEDLES} that were there before, and 1 to {MAX_SEEDS} drops of three values each"
        ),
        _ => "no values".to_owned(),
    }
}

impl Request {
    /// Verifies kind, count and every value. The limits of a parameter are those of [`crate::ParameterSet::problems`],
    /// which needs the other parameters.
    pub fn decode(command: &Command) -> Result<Self, RequestErrors> {
        let number = command.kind;
        let kind = CommandKind::try_from(number).map_err(|_| RequestError::UnknownCommand(number))?;
        let count = command.value_count as usize;
        let values = command.values.get(..count);
        let values = values.filter(|v| count_fits(kind, v.len()));
        let values = values.ok_or_else(|| RequestError::count(kind, count))?;
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            return Err(RequestError::NotFinite { at: at as u32 }.into());
        }
        let mut reader = Reader::new(values);
        let request = reader.request(kind, command);
        match reader.errors.is_empty() {
            true => Ok(request),
            false => Err(RequestErrors(reader.errors)),
        }
    }
}

const PLAN_HEAD: usize = 10;
const REHEARSAL_HEAD: usize = 14;
const STABILISING: usize = 7;

fn count_fits(kind: CommandKind, count: usize) -> bool {
    let places_after = |head: usize| count.checked_sub(head).filter(|n| n % 3 == 0).map(|n| n / 3);
    match kind {
        CommandKind::SetParameters => count > 0 && count.is_multiple_of(2),
        CommandKind::SetPlan => count == 0 || places_after(PLAN_HEAD).is_some_and(|n| n <= MAX_SEEDS),
        CommandKind::MoveHand => count == 8,
        // With or without where it turns to about its axis.
        CommandKind::MoveSecondHand => matches!(count, 8 | 11),
        CommandKind::ExpectNeedle => count == 6,
        CommandKind::TakeNeedle | CommandKind::Mark | CommandKind::KeepMoving => count == 1,
        // Which of them the number says; see `Reader::exercise`.
        CommandKind::BeginExercise => matches!(count, 1 | 2 | 4),
        CommandKind::DrawNeedle => count == 2,
        // Without a value: loose, and the first scene.
        CommandKind::DropSeed | CommandKind::LoadBuiltinScene => count <= 1,
        // How many needles stay in, and how many were there before, are values; see `Reader::drops`.
        CommandKind::Rehearse => (0..=MAX_LEFT_NEEDLES + MAX_EARLIER_NEEDLES)
            .any(|n| places_after(REHEARSAL_HEAD + STABILISING * n).is_some_and(|n| (1..=MAX_SEEDS).contains(&n))),
        // A payload where there is none has always been ignored.
        _ => count <= MAX_COMMAND_VALUES,
    }
}

/// Takes values in their order; what is wrong with one is noted, and reading goes on.
struct Reader<'a> {
    values: &'a [f64],
    at: usize,
    errors: Vec<RequestError>,
}

impl<'a> Reader<'a> {
    fn new(values: &'a [f64]) -> Self {
        let errors = Vec::new();
        Self { values, at: 0, errors }
    }

    fn request(&mut self, kind: CommandKind, command: &Command) -> Request {
        match kind {
            CommandKind::SetParameters => Request::SetParameters(self.rest(Self::change)),
            CommandKind::SetPlan if self.values.is_empty() => Request::SetPlan(None),
            CommandKind::SetPlan => Request::SetPlan(Some(PlannedNeedle {
                entry_m: self.place(),
                direction: self.direction(),
                prescribed: self.prescribed(command),
                seeds_m: self.rest(Self::place),
            })),
            CommandKind::MoveHand => Request::MoveHand(self.hand_move()),
            CommandKind::MoveSecondHand => Request::MoveSecondHand(ProbeMove {
                hand: self.hand_move(),
                up: (self.at < self.values.len()).then(|| self.direction()),
            }),
            CommandKind::DropSeed => Request::DropSeed {
                strand_pitch_m: (!self.values.is_empty())
                    .then(|| self.within("pitch of a strand in m", STRAND_PITCH_RANGE_M)),
            },
            CommandKind::Engage => Request::Engage,
            CommandKind::Disengage => Request::Disengage,
            CommandKind::Reset => Request::Reset,
            CommandKind::LoadBuiltinScene => Request::LoadBuiltinScene(self.scene()),
            CommandKind::UndoSeed => Request::UndoSeed,
            CommandKind::Shutdown => Request::Shutdown,
            CommandKind::SaveFlight => Request::SaveFlight,
            CommandKind::Rehearse => Request::Rehearse(NeedleRehearsal {
                entry_m: self.place(),
                direction: self.direction(),
                insert_m_per_s: self.within("insertion in m/s", SPEED_RANGE_M_PER_S),
                retract_m_per_s: self.within("retraction in m/s", SPEED_RANGE_M_PER_S),
                approach_m_per_s: self.within("approach in m/s", SPEED_RANGE_M_PER_S),
                acceleration_m_per_s2: self.within("acceleration in m/s2", ACCELERATION_RANGE_M_PER_S2),
                retract_to_m: self.within("place drawn back to, in m from the entry,", RETRACT_RANGE_M),
                strand_pitch_m: self.strand_pitch(),
                stabilising: self.needles("number of needles that stay in", MAX_LEFT_NEEDLES),
                earlier: self.needles("number of needles that were there before", MAX_EARLIER_NEEDLES),
                drops_m: self.drops(),
            }),
            CommandKind::StopHand => Request::StopHand,
            CommandKind::KeepMoving => self.keep_moving(),
            CommandKind::Mark => Request::Mark(self.mark(command)),
            CommandKind::BeginExercise => Request::BeginExercise(self.exercise()),
            CommandKind::EndExercises => Request::EndExercises,
            CommandKind::StopSecondHand => Request::StopSecondHand,
            CommandKind::LeaveNeedle => Request::LeaveNeedle,
            CommandKind::TakeNeedle => Request::TakeNeedle(self.needle()),
            CommandKind::DrawNeedle => Request::DrawNeedle {
                number: self.needle(),
                speed_m_per_s: self.within("speed in m/s", SPEED_RANGE_M_PER_S),
            },
            CommandKind::ExpectNeedle => Request::ExpectNeedle(NeedleAxis {
                entry_m: self.place(),
                direction: self.direction(),
            }),
        }
    }

    fn hand_move(&mut self) -> HandMove {
        HandMove {
            tip_m: self.place(),
            direction: self.direction(),
            speed_m_per_s: self.within("speed in m/s", SPEED_RANGE_M_PER_S),
            acceleration_m_per_s2: self.within("acceleration in m/s2", ACCELERATION_RANGE_M_PER_S2),
        }
    }

    /// 0 past the end, which the count forbids.
    fn next(&mut self) -> f64 {
        self.at += 1;
        self.values.get(self.at - 1).copied().unwrap_or_default()
    }

    fn rest<T>(&mut self, mut read: impl FnMut(&mut Self) -> T) -> Vec<T> {
        let mut all = Vec::new();
        while self.at < self.values.len() {
            all.push(read(self));
        }
        all
    }

    fn place(&mut self) -> [f64; 3] {
        let at = self.at as u32;
        let place_m = [self.next(), self.next(), self.next()];
        if !place_m.iter().all(|c| c.abs() <= MAX_COORDINATE_M) {
            self.errors.push(RequestError::TooFar { at, place_m });
        }
        place_m
    }

    fn direction(&mut self) -> [f64; 3] {
        let at = self.at as u32;
        let direction = [self.next(), self.next(), self.next()];
        if !is_unit(&direction) {
            self.errors.push(RequestError::NotUnit { at, direction });
        }
        direction
    }

    fn within(&mut self, what: &'static str, range: [f64; 2]) -> f64 {
        let (at, value) = (self.at as u32, self.next());
        self.limit(at, what, value, range);
        value
    }

    fn limit(&mut self, at: u32, what: &'static str, value: f64, [low, high]: [f64; 2]) {
        if !(low..=high).contains(&value) {
            self.errors.push(RequestError::OutOfLimits {
                at,
                what,
                value,
                low,
                high,
            });
        }
    }

    /// 0 where the seeds are loose.
    fn strand_pitch(&mut self) -> Option<f64> {
        if self.values.get(self.at) == Some(&0.0) {
            self.next();
            return None;
        }
        Some(self.within("pitch of a strand in m", STRAND_PITCH_RANGE_M))
    }

    fn needles(&mut self, number: &'static str, most: usize) -> Vec<StabilisingNeedle> {
        let count = self.within(number, [0.0, most as f64]);
        let count = whole(count).filter(|&n| n as usize <= most).unwrap_or(0);
        let mut needle = |_| StabilisingNeedle {
            entry_m: self.place(),
            direction: self.direction(),
            depth_m: self.within("depth of a needle, in m,", LEFT_DEPTH_RANGE_M),
        };
        (0..count).map(&mut needle).collect()
    }

    /// Drops of a rehearsal: as many as are left.
    fn drops(&mut self) -> Vec<[f64; 3]> {
        let left = self.values.len().saturating_sub(self.at);
        if left == 0 || !left.is_multiple_of(3) || left / 3 > MAX_SEEDS {
            let count = self.values.len();
            self.errors.push(RequestError::count(CommandKind::Rehearse, count));
            return Vec::new();
        }
        self.rest(Self::place)
    }

    fn change(&mut self) -> ParameterChange {
        let (at, number, value) = (self.at as u32, self.next(), self.next());
        let id = whole(number).and_then(|n| ParameterId::try_from(n).ok());
        let id = id.unwrap_or_else(|| {
            self.errors.push(RequestError::UnknownParameter { at, number });
            ParameterId::MinStretch
        });
        ParameterChange { id, value }
    }

    fn needle(&mut self) -> u32 {
        let (at, number) = (self.at as u32, self.next());
        whole(number).filter(|&n| n > 0).unwrap_or_else(|| {
            self.errors.push(RequestError::NoNeedle { at, number });
            0
        })
    }

    fn scene(&mut self) -> u32 {
        let number = self.next();
        let known = whole(number).filter(|&n| (n as usize) < BUILTIN_SCENES.len());
        known.unwrap_or_else(|| {
            self.errors.push(RequestError::UnknownScene { number });
            0
        })
    }
}

/// The number when it is a whole one.
fn whole(number: f64) -> Option<u32> {
    let n = number as u32;
    (f64::from(n) == number).then_some(n)
}

impl From<RequestErrors> for Refusal {
    fn from(errors: RequestErrors) -> Self {
        let reasons = errors.0.iter().map(|error| {
            let (code, subject) = error.reason();
            Reason::new(code, subject)
        });
        Self {
            reasons: reasons.collect(),
            text: errors.to_string(),
        }
    }
}
