//! Two fake gamepads: control, unplugging and missing rights.

use super::*;
use crate::kind::Kind;
use evdev::{AbsInfo, AbsoluteAxisCode, AttributeSet, EventType, KeyCode};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

type Queue = Rc<RefCell<VecDeque<io::Result<InputEvent>>>>;

/// Two gamepads at most, with the events that they will send.
#[derive(Clone, Default)]
struct Table {
    there: Rc<RefCell<Vec<&'static str>>>,
    locked: Rc<RefCell<bool>>,
    queues: [Queue; 2],
}

struct Pad(Queue);

impl DeviceSource for Table {
    type Device = Pad;

    fn list(&mut self) -> Vec<Found> {
        let found = |name: &&str| Found {
            path: PathBuf::from(name),
            name: format!("pad {name}"),
            kind: Kind::Gamepad,
        };
        self.there.borrow().iter().map(found).collect()
    }

    fn open(&mut self, found: &Found) -> io::Result<Pad> {
        if *self.locked.borrow() {
            return Err(ErrorKind::PermissionDenied.into());
        }
        Ok(Pad(self.queues[usize::from(found.path.ends_with("b"))].clone()))
    }

    fn wait(&mut self, _: &[&Pad], _: Duration) {}
}

impl OpenDevice for Pad {
    fn fetch(&mut self, into: &mut Vec<InputEvent>) -> io::Result<()> {
        while let Some(event) = self.0.borrow_mut().pop_front() {
            into.push(event?);
        }
        Err(ErrorKind::WouldBlock.into())
    }

    fn state(&self) -> io::Result<DeviceState> {
        Ok(DeviceState {
            axes: vec![(AbsoluteAxisCode::ABS_Y, AbsInfo::new(0, -100, 100, 0, 0, 0))],
            keys: AttributeSet::new(),
        })
    }
}

impl Table {
    fn with(there: &[&'static str]) -> (Self, DeviceHub<Self>) {
        let table = Self::default();
        *table.there.borrow_mut() = there.to_vec();
        let mut hub = DeviceHub::new(table.clone());
        hub.look();
        (table, hub)
    }

    fn sends(&self, pad: usize, kind: EventType, code: u16, value: i32) {
        let mut queue = self.queues[pad].borrow_mut();
        queue.push_back(Ok(InputEvent::new(kind.0, code, value)));
        queue.push_back(Ok(InputEvent::new(EventType::SYNCHRONIZATION.0, 0, 0)));
    }

    /// Pushes the stick away from the operator, in percent.
    fn pushes(&self, pad: usize, by: i32) {
        self.sends(pad, EventType::ABSOLUTE, AbsoluteAxisCode::ABS_Y.0, -by);
    }
}

fn holder(latest: &Latest) -> &str {
    latest.holder.as_ref().map_or("n/a", |h| h.name.as_str())
}

#[test]
fn an_unplugged_device_leaves_the_needle_at_rest() {
    let (table, mut hub) = Table::with(&[]);
    assert_eq!(holder(hub.read(0.0)), "n/a");
    table.there.borrow_mut().push("a");
    hub.look();
    assert_eq!(holder(hub.read(0.0)), "pad a");
    table.pushes(0, 100);
    assert!(hub.read(0.0).wish.along_m_per_s > 0.039);
    table.there.borrow_mut().clear();
    hub.look();
    let latest = hub.read(0.0);
    assert_eq!((holder(latest), latest.wish), ("n/a", Wish::REST));
    assert_eq!((latest.disconnected.as_str(), latest.disconnections), ("pad a", 1));
}

#[test]
fn a_device_that_fails_while_it_is_read_is_unplugged_at_once() {
    let (table, mut hub) = Table::with(&["a"]);
    table.pushes(0, 100);
    assert!(hub.read(0.0).wish != Wish::REST);
    // ENODEV, the kernel's answer for a device that was pulled out.
    table.queues[0]
        .borrow_mut()
        .push_back(Err(io::Error::from_raw_os_error(19)));
    let latest = hub.read(0.0);
    assert_eq!(
        (latest.wish, latest.disconnections, holder(latest)),
        (Wish::REST, 1, "n/a")
    );
}

#[test]
fn another_device_takes_over_only_while_the_needle_is_at_rest() {
    let (table, mut hub) = Table::with(&["a", "b"]);
    assert_eq!(holder(hub.read(0.0)), "pad a");
    table.pushes(1, 50);
    assert_eq!(holder(hub.read(0.0)), "pad b");
    table.pushes(0, -100);
    let latest = hub.read(0.0);
    assert_eq!(holder(latest), "pad b");
    assert!(latest.wish.along_m_per_s > 0.0, "the other one pulls in vain");
    table.pushes(1, 0);
    let latest = hub.read(0.0);
    assert_eq!(holder(latest), "pad a");
    assert!(latest.wish.along_m_per_s < 0.0);
}

#[test]
fn with_two_hands_the_other_device_drops_no_seed() {
    let (table, mut hub) = Table::with(&["a", "b"]);
    hub.use_two_hands(true);
    assert_eq!(holder(hub.read(0.0)), "pad a");
    table.pushes(1, 100);
    let latest = hub.read(0.0);
    assert_eq!(
        (holder(latest), latest.wish),
        ("pad a", Wish::REST),
        "the needle keeps its device"
    );
    assert_eq!(latest.probe_holder.as_ref().map(|h| h.name.as_str()), Some("pad b"));
    assert!(latest.probe.along_m_per_s > 0.039 && latest.probe.turn_rad_per_s == 0.0);
    for pad in [0, 1] {
        for key in [KeyCode::BTN_SOUTH, KeyCode::BTN_EAST] {
            table.sends(pad, EventType::KEY, key.0, 1);
        }
    }
    let presses = hub.read(0.0).presses;
    assert_eq!((presses[Button::Drop as usize], presses[Button::Stop as usize]), (1, 2));
    assert_eq!(hub.read(0.0).probe, ProbeWish::default(), "it must be released first");
    table.there.borrow_mut().pop();
    hub.look();
    let latest = hub.read(0.0);
    assert_eq!(
        (latest.probe_holder.clone(), latest.probe),
        (None, ProbeWish::default())
    );
    hub.use_two_hands(false);
    assert_eq!(hub.read(0.0).probe_holder, None);
}

#[test]
fn buttons_of_every_device_are_counted() {
    let (table, mut hub) = Table::with(&["a", "b"]);
    for pad in [0, 1] {
        table.sends(pad, EventType::KEY, KeyCode::BTN_SOUTH.0, 1);
    }
    table.sends(0, EventType::KEY, KeyCode::BTN_START.0, 1);
    let latest = hub.read(0.0);
    let pressed = |button: Button| latest.presses[button as usize];
    assert_eq!(
        (pressed(Button::Drop), pressed(Button::Engage), pressed(Button::Undo)),
        (2, 1, 0)
    );
}

#[test]
fn lost_events_have_the_state_read_again() {
    let (table, mut hub) = Table::with(&["a"]);
    table.pushes(0, 100);
    hub.read(0.0);
    table.sends(0, EventType::SYNCHRONIZATION, 3, 0);
    // The device's stick is in the middle.
    assert_eq!(hub.read(0.0).wish, Wish::REST);
}

#[test]
fn an_unreadable_device_is_reported_with_its_remedy() {
    let (table, mut hub) = Table::with(&[]);
    *table.locked.borrow_mut() = true;
    table.there.borrow_mut().push("a");
    hub.look();
    assert!(hub.read(0.0).denied.is_empty(), "rights follow the node");
    hub.look();
    let denied = hub.read(0.0).denied.clone();
    assert_eq!(denied.len(), 1);
    assert!(denied[0].contains("usermod -aG input"), "{denied:?}");
    *table.locked.borrow_mut() = false;
    hub.look();
    let latest = hub.read(0.0);
    assert_eq!((holder(latest), latest.denied.len()), ("pad a", 0));
}
