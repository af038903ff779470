//! The state of one device from its events, and the speed that it asks for. Needs no device.

use super::axis::Axis;
use super::kind::{Button, Kind};
use super::{ACROSS_M_PER_S, ALONG_M_PER_S, SLOW, SLOWEST_M_PER_S};
use evdev::{
    AbsInfo, AbsoluteAxisCode, AttributeSet, EventSummary, InputEvent, KeyCode, RelativeAxisCode, SynchronizationCode,
};

/// A driver with relative axes sends no zero when the cap is released: an axis without events for so long is at rest.
const RELATIVE_SILENCE_S: f64 = 0.1;

/// How fast the hand wants the tip to go.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// Along the needle, positive inwards.
    pub along_m_per_s: f64,
    /// Across the template, as seen from the perineum: to the right, and up.
    pub across_m_per_s: [f64; 2],
}

impl Wish {
    pub const REST: Self = Self {
        along_m_per_s: 0.0,
        across_m_per_s: [0.0; 2],
    };

    pub fn slower(self, by: f64) -> Self {
        Self {
            along_m_per_s: self.along_m_per_s * by,
            across_m_per_s: self.across_m_per_s.map(|v| v * by),
        }
    }
}

/// All that the kernel knows of a device at one moment.
#[derive(Debug, Default)]
pub struct DeviceState {
    pub axes: Vec<(AbsoluteAxisCode, AbsInfo)>,
    pub keys: AttributeSet<KeyCode>,
}

/// What an event was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    Nothing,
    Pressed(Button),
    /// Events are missing: the whole state must be read.
    Lost,
}

/// X to the right, Y towards the operator, Z down, as drivers of sticks and of 3D mice have it.
pub struct State {
    kind: Kind,
    axes: [Option<Axis>; 3],
    counts: [i32; 3],
    /// When a relative axis last spoke; `None` for an absolute one.
    spoke_s: [Option<f64>; 3],
    keys: AttributeSet<KeyCode>,
    is_losing: bool,
    was_released: bool,
}

impl State {
    /// A device that was just opened. What is held now was not pressed for this program, and must first be released.
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

    /// Whether the stick or the cap has been at rest since the device was plugged in, or since it was stopped.
    pub fn was_released(&self) -> bool {
        self.was_released
    }

    pub fn take(&mut self, event: InputEvent, now_s: f64) -> Taken {
        if let EventSummary::Synchronization(_, code, _) = event.destructure() {
            return self.take_sync(code);
        }
        // Between the loss and the next report nothing belongs together (kernel: event-codes.txt, SYN_DROPPED).
        if self.is_losing {
            return Taken::Nothing;
        }
        match event.destructure() {
            EventSummary::AbsoluteAxis(_, axis, counts) => self.set(usize::from(axis.0), counts, None),
            EventSummary::RelativeAxis(_, axis, counts) if axis.0 <= RelativeAxisCode::REL_Z.0 => {
                self.set(usize::from(axis.0), counts, Some(now_s));
            }
            // A set of keys panics at a number that it has no place for.
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

    /// After a loss. Buttons that are down now and were not before were pressed in between.
    pub fn resync(&mut self, whole: &DeviceState) -> Vec<Button> {
        let before = std::mem::replace(&mut self.keys, AttributeSet::new());
        self.take_whole(whole);
        // Of relative axes the kernel keeps no state.
        for (counts, spoke_s) in self.counts.iter_mut().zip(&mut self.spoke_s) {
            if spoke_s.take().is_some() {
                *counts = 0;
            }
        }
        let new: Vec<KeyCode> = self.keys.iter().filter(|k| !before.contains(*k)).collect();
        new.into_iter().filter_map(|key| self.pressed(key)).collect()
    }

    /// What the hand on the device wants at this time.
    pub fn wish(&self, now_s: f64) -> Wish {
        if !self.was_released {
            return Wish::REST;
        }
        let [right, back, down] = [0, 1, 2].map(|axis| self.share(axis, now_s));
        let slow = if self.keys.iter().any(|k| self.kind.slows(k)) {
            SLOW
        } else {
            1.0
        };
        let speed = |share: f64, full: f64| {
            let speed = share * full * slow;
            if speed.abs() < SLOWEST_M_PER_S { 0.0 } else { speed }
        };
        match self.kind {
            Kind::Gamepad => Wish {
                along_m_per_s: speed(-back, ALONG_M_PER_S),
                ..Wish::REST
            },
            // A hand that presses also slides a little: only the direction that is meant counts.
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

    /// To be called without events too: relative axes rest by being silent.
    pub fn note_rest(&mut self, now_s: f64) {
        self.was_released |= (0..3).all(|axis| self.ignores(axis) || self.share(axis, now_s) == 0.0);
    }

    /// The second stick and the triggers of a gamepad rest where they like.
    fn ignores(&self, axis: usize) -> bool {
        self.kind == Kind::Gamepad && axis != usize::from(AbsoluteAxisCode::ABS_Y.0)
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
mod tests {
    use super::*;
    use evdev::EventType;

    const Y: u16 = AbsoluteAxisCode::ABS_Y.0;

    fn event(kind: EventType, code: u16, value: i32) -> InputEvent {
        InputEvent::new(kind.0, code, value)
    }

    fn report() -> InputEvent {
        event(EventType::SYNCHRONIZATION, SynchronizationCode::SYN_REPORT.0, 0)
    }

    /// Events in one report, then what they were; `None` for those that were nothing.
    fn feed(state: &mut State, now_s: f64, events: &[(EventType, u16, i32)]) -> Vec<Taken> {
        let events = events.iter().map(|(kind, code, value)| event(*kind, *code, *value));
        let taken = events.chain([report()]).map(|e| state.take(e, now_s));
        let relevant = taken.filter(|t| *t != Taken::Nothing).collect();
        state.note_rest(now_s);
        relevant
    }

    fn stick(value: i32) -> DeviceState {
        let axis = |code, value| (code, AbsInfo::new(value, -32768, 32767, 16, 128, 0));
        DeviceState {
            axes: vec![axis(AbsoluteAxisCode::ABS_X, 0), axis(AbsoluteAxisCode::ABS_Y, value)],
            keys: AttributeSet::new(),
        }
    }

    fn cap() -> DeviceState {
        let axes = [
            AbsoluteAxisCode::ABS_X,
            AbsoluteAxisCode::ABS_Y,
            AbsoluteAxisCode::ABS_Z,
        ];
        DeviceState {
            axes: axes.map(|code| (code, AbsInfo::new(0, -350, 350, 0, 0, 0))).to_vec(),
            keys: AttributeSet::new(),
        }
    }

    #[test]
    fn a_stick_pushed_away_advances_at_full_speed_and_a_shoulder_button_makes_it_slow() {
        let mut state = State::new(Kind::Gamepad, &stick(0));
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -32768)]);
        assert!((state.wish(0.0).along_m_per_s - 0.04).abs() < 1e-6);
        feed(&mut state, 0.0, &[(EventType::KEY, KeyCode::BTN_TL.0, 1)]);
        assert!((state.wish(0.0).along_m_per_s - 0.01).abs() < 1e-6);
        feed(
            &mut state,
            0.0,
            &[(EventType::KEY, KeyCode::BTN_TL.0, 0), (EventType::ABSOLUTE, Y, 32767)],
        );
        assert!((state.wish(0.0).along_m_per_s + 0.04).abs() < 1e-6);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, 2000)]);
        assert_eq!(state.wish(0.0), Wish::REST);
    }

    #[test]
    fn the_needle_does_not_move_until_a_stick_that_came_deflected_was_let_go() {
        let mut state = State::new(Kind::Gamepad, &stick(-32768));
        assert_eq!(state.wish(0.0), Wish::REST);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -30000)]);
        assert_eq!(state.wish(0.0), Wish::REST);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, 0)]);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -30000)]);
        assert!(state.wish(0.0).along_m_per_s > 0.0);
    }

    #[test]
    fn stop_holds_until_the_stick_was_let_go() {
        let mut state = State::new(Kind::Gamepad, &stick(0));
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -32768)]);
        let taken = feed(&mut state, 0.0, &[(EventType::KEY, KeyCode::BTN_EAST.0, 1)]);
        assert_eq!(taken, [Taken::Pressed(Button::Stop)]);
        assert_eq!(state.wish(0.0), Wish::REST);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, 0)]);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -32768)]);
        assert!(state.wish(0.0).along_m_per_s > 0.0);
    }

    #[test]
    fn a_button_counts_once_and_not_when_it_was_held_before() {
        let mut whole = stick(0);
        whole.keys.insert(KeyCode::BTN_START);
        let mut state = State::new(Kind::Gamepad, &whole);
        let press = [
            (EventType::KEY, KeyCode::BTN_SOUTH.0, 1),
            (EventType::KEY, KeyCode::BTN_SOUTH.0, 2),
        ];
        assert_eq!(feed(&mut state, 0.0, &press), [Taken::Pressed(Button::Drop)]);
        assert_eq!(feed(&mut state, 0.0, &[(EventType::KEY, KeyCode::BTN_START.0, 1)]), []);
        feed(&mut state, 0.0, &[(EventType::KEY, KeyCode::BTN_START.0, 0)]);
        let again = feed(&mut state, 0.0, &[(EventType::KEY, KeyCode::BTN_START.0, 1)]);
        assert_eq!(again, [Taken::Pressed(Button::Engage)]);
    }

    #[test]
    fn after_lost_events_the_state_is_that_of_the_device() {
        let mut state = State::new(Kind::Gamepad, &stick(0));
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -32768)]);
        let dropped = (EventType::SYNCHRONIZATION, SynchronizationCode::SYN_DROPPED.0, 0);
        // Events between the loss and the report are ignored.
        let taken = feed(
            &mut state,
            0.0,
            &[
                dropped,
                (EventType::ABSOLUTE, Y, 32767),
                (EventType::KEY, KeyCode::BTN_SOUTH.0, 1),
            ],
        );
        assert_eq!(taken, [Taken::Lost]);
        assert!(state.wish(0.0).along_m_per_s > 0.0);
        let mut now = stick(0);
        now.keys.insert(KeyCode::BTN_EAST);
        assert_eq!(state.resync(&now), [Button::Stop]);
        state.note_rest(0.0);
        assert_eq!(state.wish(0.0), Wish::REST);
        feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -32768)]);
        assert!(state.wish(0.0).along_m_per_s > 0.0, "events count again");
    }

    #[test]
    fn of_a_cap_only_the_direction_that_is_meant_counts() {
        let mut state = State::new(Kind::Mouse3d, &cap());
        let push = |state: &mut State, xyz: [i32; 3]| {
            let events: Vec<_> = (0..3).map(|a| (EventType::ABSOLUTE, a, xyz[usize::from(a)])).collect();
            feed(state, 0.0, &events);
            state.wish(0.0)
        };
        let down = push(&mut state, [100, 60, 350]);
        assert!((down.along_m_per_s - 0.04).abs() < 1e-9 && down.across_m_per_s == [0.0; 2]);
        assert!(push(&mut state, [0, 0, -350]).along_m_per_s < -0.039);
        // To the right and away: right and up as seen from the perineum.
        let slid = push(&mut state, [350, -350, 40]);
        assert_eq!((slid.along_m_per_s, slid.across_m_per_s), (0.0, [0.01, 0.01]));
        assert_eq!(push(&mut state, [0; 3]), Wish::REST);
    }

    #[test]
    fn a_relative_cap_that_falls_silent_is_at_rest() {
        let mut state = State::new(Kind::Mouse3d, &DeviceState::default());
        let press = [(EventType::RELATIVE, RelativeAxisCode::REL_Z.0, 350)];
        feed(&mut state, 1.0, &press);
        assert!((state.wish(1.05).along_m_per_s - 0.04).abs() < 1e-9);
        assert_eq!(state.wish(1.2), Wish::REST);
        // Turning the cap moves nothing.
        feed(
            &mut state,
            2.0,
            &[(EventType::RELATIVE, RelativeAxisCode::REL_RZ.0, 350)],
        );
        assert_eq!(state.wish(2.0), Wish::REST);
        // Stopped while pressed: silence is letting go.
        feed(&mut state, 3.0, &press);
        feed(&mut state, 3.0, &[(EventType::KEY, KeyCode::BTN_1.0, 1)]);
        assert!(!state.was_released());
        state.note_rest(3.2);
        feed(&mut state, 3.3, &press);
        assert!(state.wish(3.3).along_m_per_s > 0.0);
    }

    #[test]
    fn any_event_gives_a_wish_that_the_core_takes() {
        let mut state = State::new(Kind::Mouse3d, &cap());
        let values = [i32::MIN, -351, -30, -1, 0, 29, 31, 40, 350, i32::MAX];
        for code in [0, 1, 2, 3, 40, u16::MAX] {
            for value in values {
                for kind in [EventType::ABSOLUTE, EventType::RELATIVE, EventType::KEY] {
                    feed(&mut state, 0.0, &[(kind, code, value)]);
                    let wish = state.wish(0.0);
                    for speed in [wish.along_m_per_s, wish.across_m_per_s[0], wish.across_m_per_s[1]] {
                        assert!(speed == 0.0 || (1e-4..=0.04).contains(&speed.abs()), "{speed}");
                    }
                }
            }
        }
    }
}
