//! Validates every value of a request, or lists every reason against it.

use super::*;
use crate::check::{MAX_COORDINATE_M, is_unit};
use crate::{
    BUILTIN_SCENES, EXERCISE_STIFFNESS_RANGE, MARK_BYTES, MAX_EARLIER_NEEDLES, MAX_LEFT_NEEDLES, MAX_SEEDS,
    MOST_MOVED_M, MOST_PLANNED_NEEDLES, PRESCRIPTION_RANGE_GY, Reason, Refusal, RefusalCode, SEED_STRENGTH_RANGE_U,
    Text,
};

const NONE: u32 = Reason::NO_SUBJECT;

impl Request {
    /// Returns the request, or every reason against it.
    pub(super) fn verified(self) -> Result<Self, Refusal> {
        let Verify { reasons, lines } = Verify::of(&self);
        let text = lines.join("\n");
        match reasons.is_empty() {
            true => Ok(self),
            false => Err(Refusal { reasons, text }),
        }
    }
}

/// Reasons against one request, and a line of text for each.
#[derive(Default)]
struct Verify {
    reasons: Vec<Reason>,
    lines: Vec<String>,
}

impl Verify {
    fn of(request: &Request) -> Self {
        let mut this = Self::default();
        match request {
            Request::SetParameters(changes) => this.parameters(changes),
            Request::SetPlan(Some(needle)) => this.planned(needle),
            Request::MoveHand(hand) => this.hand(hand),
            Request::MoveSecondHand(probe) => {
                this.hand(&probe.hand);
                probe.up.iter().for_each(|up| this.direction(up));
            }
            Request::DropSeed { strand_pitch_m } => this.pitch(*strand_pitch_m),
            Request::LoadBuiltinScene(number) => {
                let is_known = (*number as usize) < BUILTIN_SCENES.len();
                this.ensure(is_known, (RefusalCode::UnknownScene, *number), || {
                    let known = BUILTIN_SCENES.join(", ");
                    format!("there is no built-in scene number {number}; from 0 they are {known}")
                });
            }
            Request::Rehearse(run) => this.rehearsal(run),
            Request::ExpectNeedle(axis) => this.axis(&axis.entry_m, &axis.direction),
            Request::TakeNeedle(number) => this.number(*number),
            Request::DrawNeedle { number, speed_m_per_s } => {
                this.number(*number);
                this.within("the speed in m/s", *speed_m_per_s, SPEED_RANGE_M_PER_S);
            }
            Request::Mark(mark) => {
                this.within("the time before the request in s", mark.before_s, MARK_BEFORE_RANGE_S);
                let words = Text::<MARK_BYTES>::new(&mark.text);
                let can_be_shown = words.exact() == Some(&mark.text) && !mark.text.trim().is_empty();
                this.text(can_be_shown);
            }
            Request::BeginExercise(exercise) => this.exercise(*exercise),
            Request::KeepMoving { valid_s } => this.within("the promised time in s", *valid_s, VALID_RANGE_S),
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
        this
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
        self.text(of.source.exact().is_some());
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
        self.ensure(number > 0, (RefusalCode::NoLeftNeedle, 0), || {
            "no needle has the number 0".to_owned()
        });
    }

    fn axis(&mut self, place_m: &[f64; 3], direction: &[f64; 3]) {
        self.places(&[*place_m]);
        self.direction(direction);
    }

    // Comparisons with NaN are false, here and below.
    fn places(&mut self, places_m: &[[f64; 3]]) {
        for place_m in places_m {
            let is_near = place_m.iter().all(|c| c.abs() <= MAX_COORDINATE_M);
            self.ensure(is_near, (RefusalCode::PlaceTooFar, NONE), || {
                format!("the place {place_m:?} must be within {MAX_COORDINATE_M} m")
            });
        }
    }

    fn direction(&mut self, direction: &[f64; 3]) {
        self.ensure(is_unit(direction), (RefusalCode::NotUnitDirection, NONE), || {
            format!("the direction {direction:?} is not a unit vector")
        });
    }

    fn within(&mut self, what: &'static str, value: f64, [low, high]: [f64; 2]) {
        self.ensure(
            (low..=high).contains(&value),
            (RefusalCode::ValueOutOfLimits, NONE),
            || format!("{what} is {value}; it must be {low} to {high}"),
        );
    }

    fn count(&mut self, what: &'static str, count: usize, least: usize, most: usize) {
        let subject = u32::try_from(count).unwrap_or(u32::MAX);
        self.ensure(
            (least..=most).contains(&count),
            (RefusalCode::WrongCount, subject),
            || format!("{count} {what} came; there must be {least} to {most}"),
        );
    }

    fn text(&mut self, can_be_shown: bool) {
        self.ensure(can_be_shown, (RefusalCode::InvalidText, NONE), || {
            format!("the words are empty, or no UTF-8 of one line in {MARK_BYTES} bytes")
        });
    }

    fn ensure(&mut self, holds: bool, (code, subject): (RefusalCode, u32), text: impl FnOnce() -> String) {
        if !holds {
            self.reasons.push(Reason::new(code, subject));
            self.lines.push(text());
        }
    }
}
