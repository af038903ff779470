//! The state of one device from its events, and the speed that it requests. Needs no device.

use super::axis::Axis;
use crate::kind::{Button, Kind};
use crate::wish::{ProbeWish, SLOWEST_M_PER_S, Wish};
use crate::{ACROSS_M_PER_S, ALONG_M_PER_S, SLOW, TURN_RAD_PER_S};
use evdev::{
    AbsInfo, AbsoluteAxisCode, AttributeSet, EventSummary, InputEvent, KeyCode, RelativeAxisCode, SynchronizationCode,
};

/// Silence after which a relative axis is at rest, because its driver sends no zero when the cap is
/// released.
const RELATIVE_SILENCE_S: f64 = 0.1;

/// Kernel's whole state of a device at one moment.
#[derive(Debug, Default)]
pub struct DeviceState {
    /// Absolute axes with their range and position.
    pub axes: Vec<(AbsoluteAxisCode, AbsInfo)>,
    /// Keys that are down.
    pub keys: AttributeSet<KeyCode>,
}

/// Result of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    Nothing,
    Pressed(Button),
    /// Events were lost: the whole state must be read.
    Lost,
}

/// State of the axes: X to the right, Y towards the operator, Z down, as in drivers of sticks and
/// 3D mice.
pub struct State {
    kind: Kind,
    axes: [Option<Axis>; 3],
    counts: [i32; 3],
    /// Time of the last event of a relative axis; `None` for an absolute one.
    spoke_s: [Option<f64>; 3],
    keys: AttributeSet<KeyCode>,
    is_losing: bool,
    was_released: bool,
}

impl State {
    /// Creates a device that was just opened. Keys and sticks held now were not meant for this
    /// program, and must first be released.
    pub fn new(kind: Kind, whole: &DeviceState) -> Self {
        let mut state = Self {
            kind,
            axes: [None; 3],
            counts: [0; 3],
            spoke_s: [None; 3],
            keys: AttributeSet::new(),
            is_losing: false,
            was_released: false,
        };
        state.take_whole(whole);
        for (axis, counts) in state.axes.iter_mut().zip(&mut state.counts) {
            if axis.is_none() && kind == Kind::Mouse3d {
                (*axis, *counts) = (Some(Axis::relative()), 0);
            }
        }
        state.note_rest(0.0);
        state
    }

    /// Returns whether the stick or the cap has been at rest since the device was plugged in or
    /// stopped.
    pub fn was_released(&self) -> bool {
        self.was_released
    }

    pub fn take(&mut self, event: InputEvent, now_s: f64) -> Taken {
        if let EventSummary::Synchronization(_, code, _) = event.destructure() {
            return self.take_sync(code);
        }
        // Events between the loss and the next report are inconsistent (kernel: event-codes.txt,
        // SYN_DROPPED).
        if self.is_losing {
            return Taken::Nothing;
        }
        match event.destructure() {
            EventSummary::AbsoluteAxis(_, axis, counts) => self.set(usize::from(axis.0), counts, None),
            EventSummary::RelativeAxis(_, axis, counts) if axis.0 <= RelativeAxisCode::REL_Z.0 => {
                self.set(usize::from(axis.0), counts, Some(now_s));
            }
            // A set of keys panics at a number outside its range.
            EventSummary::Key(_, key, _) if !self.kind.has_use_for(key) => {}
            EventSummary::Key(_, key, 1) if !self.keys.contains(key) => {
                self.keys.insert(key);
                return self.pressed(key).map_or(Taken::Nothing, Taken::Pressed);
            }
            EventSummary::Key(_, key, 0) => self.keys.remove(key),
            _ => {}
        }
        Taken::Nothing
    }

    fn take_sync(&mut self, code: SynchronizationCode) -> Taken {
        match code {
            SynchronizationCode::SYN_DROPPED => self.is_losing = true,
            SynchronizationCode::SYN_REPORT if self.is_losing => {
                self.is_losing = false;
                return Taken::Lost;
            }
            _ => {}
        }
        Taken::Nothing
    }

    /// Takes the whole state after a loss. Buttons that are newly down were pressed in between.
    pub fn resync(&mut self, whole: &DeviceState) -> Vec<Button> {
        let before = std::mem::replace(&mut self.keys, AttributeSet::new());
        self.take_whole(whole);
        // The kernel keeps no state of relative axes.
        for (counts, spoke_s) in self.counts.iter_mut().zip(&mut self.spoke_s) {
            if spoke_s.take().is_some() {
                *counts = 0;
            }
        }
        let new: Vec<KeyCode> = self.keys.iter().filter(|k| !before.contains(*k)).collect();
        new.into_iter().filter_map(|key| self.pressed(key)).collect()
    }

    /// Returns the speed that the device requests at this time.
    pub fn wish(&self, now_s: f64) -> Wish {
        if !self.was_released {
            return Wish::REST;
        }
        let [right, back, down] = [0, 1, 2].map(|axis| self.share(axis, now_s));
        let slow = self.slow();
        let speed = |share: f64, full: f64| {
            let speed = share * full * slow;
            if speed.abs() < SLOWEST_M_PER_S { 0.0 } else { speed }
        };
        match self.kind {
            Kind::Gamepad => Wish {
                along_m_per_s: speed(-back, ALONG_M_PER_S),
                ..Wish::REST
            },
            // A hand that presses also slides a little: only the dominant direction counts.
            Kind::Mouse3d if down.abs() >= right.hypot(back) => Wish {
                along_m_per_s: speed(down, ALONG_M_PER_S),
                ..Wish::REST
            },
            Kind::Mouse3d => Wish {
                along_m_per_s: 0.0,
                across_m_per_s: [speed(right, ACROSS_M_PER_S), speed(-back, ACROSS_M_PER_S)],
            },
        }
    }

    /// Returns the speed that the device requests of the probe at this time: in, out and a turn.
    pub fn probe_wish(&self, now_s: f64) -> ProbeWish {
        if !self.was_released {
            return ProbeWish::default();
        }
        let [right, back, down] = [0, 1, 2].map(|axis| self.share(axis, now_s));
        let along = match self.kind {
            Kind::Gamepad => -back,
            Kind::Mouse3d => down,
        };
        // A hand that pushes also leans a little to the side.
        let (along, turn) = if along.abs() >= right.abs() {
            (along, 0.0)
        } else {
            (0.0, right)
        };
        ProbeWish {
            along_m_per_s: along * ALONG_M_PER_S * self.slow(),
            turn_rad_per_s: turn * TURN_RAD_PER_S * self.slow(),
        }
    }

    fn slow(&self) -> f64 {
        let is_slowed = self.keys.iter().any(|k| self.kind.slows(k));
        if is_slowed { SLOW } else { 1.0 }
    }

    fn take_whole(&mut self, whole: &DeviceState) {
        for (code, info) in &whole.axes {
            if let Some(slot) = self.axes.get_mut(usize::from(code.0)) {
                (*slot, self.counts[usize::from(code.0)]) = (Axis::absolute(info), info.value());
            }
        }
        self.keys = whole.keys.iter().collect();
    }

    fn set(&mut self, axis: usize, counts: i32, spoke_s: Option<f64>) {
        if let Some(slot) = self.counts.get_mut(axis) {
            (*slot, self.spoke_s[axis]) = (counts, spoke_s);
        }
    }

    fn pressed(&mut self, key: KeyCode) -> Option<Button> {
        let button = self.kind.button(key)?;
        if button == Button::Stop {
            self.was_released = false;
        }
        Some(button)
    }

    /// Notes an axis at rest. Must also be called without events, because relative axes rest by
    /// being silent.
    pub fn note_rest(&mut self, now_s: f64) {
        self.was_released |= (0..3).all(|axis| self.ignores(axis) || self.share(axis, now_s) == 0.0);
    }

    /// Returns whether an axis is ignored: the second stick and the triggers of a gamepad have any
    /// rest position.
    fn ignores(&self, axis: usize) -> bool {
        self.kind == Kind::Gamepad && axis > usize::from(AbsoluteAxisCode::ABS_Y.0)
    }

    fn share(&self, axis: usize, now_s: f64) -> f64 {
        let is_silent = self.spoke_s[axis].is_some_and(|spoke| now_s - spoke > RELATIVE_SILENCE_S);
        match &self.axes[axis] {
            Some(range) if !is_silent => range.share(self.counts[axis]),
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests;
