//! Marks, exercises and promises out of a record.

use super::{Reader, RequestError, whole};
use crate::exercise::ExerciseNumber;
use crate::request::{MARK_BEFORE_RANGE_S, Mark, Request, VALID_RANGE_S};
use crate::{Command, CommandKind, EXERCISE_STIFFNESS_RANGE, Exercise, MOST_MOVED_M};

impl Reader<'_> {
    pub(super) fn keep_moving(&mut self) -> Request {
        let valid_s = self.within("time for which the motion goes on, in s,", VALID_RANGE_S);
        Request::KeepMoving { valid_s }
    }

    pub(super) fn mark(&mut self, command: &Command) -> Mark {
        let before_s = self.within("time before the request, in s,", MARK_BEFORE_RANGE_S);
        let words = command.text.exact().filter(|words| !words.trim().is_empty());
        if words.is_none() {
            self.errors.push(RequestError::InvalidText);
        }
        Mark {
            text: words.unwrap_or_default().to_owned(),
            before_s,
        }
    }

    pub(super) fn exercise(&mut self) -> Exercise {
        let known = [ExerciseNumber::DeviceLost, ExerciseNumber::BodyMoved].map(|n| f64::from(n as u32));
        let number = self.within("number of an exercise", known);
        let found = whole(number).and_then(|n| ExerciseNumber::try_from(n).ok());
        let (exercise, count) = match found {
            // What is missing is no reason for a second refusal.
            Some(ExerciseNumber::StiffTissue) if self.values.len() == 2 => {
                let factor = self.within("factor on the stiffness", EXERCISE_STIFFNESS_RANGE);
                (Exercise::StiffTissue { factor }, Some(2))
            }
            Some(ExerciseNumber::BodyMoved) if self.values.len() == 4 => {
                let moved = Exercise::BodyMoved { by_m: self.place() };
                let range = [0.0, MOST_MOVED_M];
                self.limit(1, "distance that the body is moved, in m,", moved.value(), range);
                (moved, Some(4))
            }
            Some(ExerciseNumber::DeviceLost) => (Exercise::DeviceLost, Some(1)),
            _ => (Exercise::DeviceLost, None),
        };
        if count != Some(self.values.len()) && self.errors.is_empty() {
            let count = self.values.len();
            self.errors.push(RequestError::count(CommandKind::BeginExercise, count));
        }
        exercise
    }
}
