//! The membranes that a needle met, from the tick records.

use stylet_shm_schema::{Fault, TickRecord, flags};

/// Membrane that gave way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Puncture {
    /// Distance by which the tip pressed it in before, m.
    pub pressed_m: f64,
    /// Largest force on the hand during that time, N.
    pub force_n: f64,
}

/// Punctures of the last insertion, in their order.
#[derive(Clone, Debug, Default)]
pub struct MetMembranes {
    punctures: Vec<Puncture>,
    fault: u32,
    pressed: Option<Puncture>,
    was_in_contact: bool,
    session: u64,
}

/// Most membranes on a path, more than any body has.
const MOST: usize = 16;

impl MetMembranes {
    /// Takes records in their order.
    pub fn take(&mut self, records: &[TickRecord]) {
        for record in records {
            let is_in_contact = record.flags & flags::IN_CONTACT != 0;
            if record.session_id != self.session || (is_in_contact && !self.was_in_contact) {
                (self.session, self.pressed) = (record.session_id, None);
                self.punctures.clear();
                self.fault = 0;
            }
            if record.fault != 0 {
                self.fault = record.fault;
            }
            self.was_in_contact = is_in_contact;
            let is_through = record.flags & flags::PUNCTURED != 0;
            if is_in_contact && !is_through {
                let force_n = record.force_on_hand_n.iter().map(|c| c * c).sum::<f64>().sqrt();
                let pressed = self.pressed.get_or_insert_default();
                pressed.pressed_m = pressed.pressed_m.max(record.depth_m);
                pressed.force_n = pressed.force_n.max(force_n);
            } else if let Some(gave_way) = self
                .pressed
                .take()
                .filter(|_| is_through && self.punctures.len() < MOST)
            {
                self.punctures.push(gave_way);
            }
        }
    }

    /// Returns the last fault since the insertion began; [`Fault::DeviceError`] for one that this
    /// program does not know.
    pub fn fault(&self) -> Option<Fault> {
        (self.fault != 0).then(|| Fault::from_number(self.fault).unwrap_or(Fault::DeviceError))
    }

    /// Returns the punctures of the last insertion, the outermost first.
    pub fn punctures(&self) -> &[Puncture] {
        &self.punctures
    }
}
