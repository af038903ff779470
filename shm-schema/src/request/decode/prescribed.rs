//! What planned seeds are, out of a record.

use super::{Reader, RequestError, whole};
use crate::{
    Command, MOST_PLANNED_NEEDLES, PRESCRIPTION_RANGE_GY, Prescribed, SEED_STRENGTH_RANGE_U, SOURCE_BYTES, Text,
};

impl Reader<'_> {
    pub(super) fn prescribed(&mut self, command: &Command) -> Prescribed {
        let (needle, last_needle) = (self.planned_number(), self.planned_number());
        let source = command.text.exact().filter(|words| words.len() <= SOURCE_BYTES);
        if source.is_none() {
            self.errors.push(RequestError::InvalidText);
        }
        Prescribed {
            needle,
            last_needle,
            strength_u: self.within("strength of a seed in U", SEED_STRENGTH_RANGE_U),
            dose_gy: self.within("prescribed dose in Gy", PRESCRIPTION_RANGE_GY),
            source: Text::new(source.unwrap_or_default()),
        }
    }

    fn planned_number(&mut self) -> u32 {
        let at = self.at as u32;
        let number = self.within("number of a needle", [0.0, f64::from(MOST_PLANNED_NEEDLES)]);
        whole(number).unwrap_or_else(|| {
            self.errors.push(RequestError::NoNeedle { at, number });
            0
        })
    }
}
