//! Device events, and the speed that follows from them.

use super::*;
use evdev::EventType;

const Y: u16 = AbsoluteAxisCode::ABS_Y.0;

fn event(kind: EventType, code: u16, value: i32) -> InputEvent {
    InputEvent::new(kind.0, code, value)
}

fn report() -> InputEvent {
    event(EventType::SYNCHRONIZATION, SynchronizationCode::SYN_REPORT.0, 0)
}

/// Feeds the events of one report; returns the result of each, without those that had none.
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
fn a_shoulder_button_slows_the_stick() {
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
fn a_stick_plugged_in_deflected_must_be_released_first() {
    let mut state = State::new(Kind::Gamepad, &stick(-32768));
    assert_eq!(state.wish(0.0), Wish::REST);
    feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -30000)]);
    assert_eq!(state.wish(0.0), Wish::REST);
    feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, 0)]);
    feed(&mut state, 0.0, &[(EventType::ABSOLUTE, Y, -30000)]);
    assert!(state.wish(0.0).along_m_per_s > 0.0);
}

#[test]
fn stop_holds_until_the_stick_is_released() {
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
fn a_button_counts_once_per_press() {
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
fn only_the_dominant_direction_of_a_cap_counts() {
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
    // Stopped while pressed: silence counts as release.
    feed(&mut state, 3.0, &press);
    feed(&mut state, 3.0, &[(EventType::KEY, KeyCode::BTN_1.0, 1)]);
    assert!(!state.was_released());
    state.note_rest(3.2);
    feed(&mut state, 3.3, &press);
    assert!(state.wish(3.3).along_m_per_s > 0.0);
}

#[test]
fn any_event_gives_a_valid_wish() {
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

#[test]
fn a_stick_either_advances_or_turns_the_probe() {
    const X: u16 = AbsoluteAxisCode::ABS_X.0;
    let mut state = State::new(Kind::Gamepad, &stick(0));
    feed(
        &mut state,
        0.0,
        &[(EventType::ABSOLUTE, Y, -32768), (EventType::ABSOLUTE, X, 9000)],
    );
    let wish = state.probe_wish(0.0);
    assert!(
        (wish.along_m_per_s - 0.04).abs() < 1e-6 && wish.turn_rad_per_s == 0.0,
        "{wish:?}"
    );
    feed(
        &mut state,
        0.0,
        &[(EventType::ABSOLUTE, Y, 0), (EventType::ABSOLUTE, X, -32768)],
    );
    let wish = state.probe_wish(0.0);
    assert!(
        wish.along_m_per_s == 0.0 && (wish.turn_rad_per_s + 0.7).abs() < 1e-3,
        "{wish:?}"
    );
    assert_eq!(wish.slower(SLOW).turn_rad_per_s, wish.turn_rad_per_s * SLOW);
}
