//! All devices together: which are plugged in, which may not be read, and which one controls the needle.

use super::error::OpenError;
use super::found::Found;
use super::kind::{Button, Kind};
use super::state::{DeviceState, State, Taken, Wish};
use evdev::InputEvent;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::Duration;

/// A node appears before its rights are set: a device is reported only after it could not be opened this often.
const REPORTED_AFTER: u32 = 2;

/// Where devices are found: the system, or a test.
pub trait DeviceSource {
    /// An open device.
    type Device: OpenDevice;
    /// The devices that are plugged in now.
    fn list(&mut self) -> Vec<Found>;
    /// Opens one of them.
    fn open(&mut self, found: &Found) -> io::Result<Self::Device>;
    /// Waits until one of them has events, at most for this time.
    fn wait(&mut self, opened: &[&Self::Device], at_most: Duration);
}

/// An open device. Neither call may block.
pub trait OpenDevice {
    /// Appends new events; `WouldBlock` where there are none.
    fn fetch(&mut self, into: &mut Vec<InputEvent>) -> io::Result<()>;
    /// All of its axes and keys now.
    fn state(&self) -> io::Result<DeviceState>;
}

/// A device, as the window shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// Its name, for people.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// The stick or the cap must be at rest once before the needle follows it.
    pub was_released: bool,
}

/// What the window needs to know, as of the last reading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latest {
    /// The device that controls the needle: the one that was moved last.
    pub holder: Option<Device>,
    /// Speed that it asks for.
    pub wish: Wish,
    /// How often each of [`Button::ALL`] was pressed since the start.
    pub presses: [u32; Button::ALL.len()],
    /// Devices that are there and cannot be read, each with the reason and what to do.
    pub denied: Vec<String>,
    /// Name of the device that was unplugged last.
    pub disconnected: String,
    /// Number of devices that were unplugged since the start.
    pub disconnections: u32,
}

struct Held<O> {
    found: Found,
    opened: O,
    state: State,
}

/// Devices that are there, and what they asked for.
pub struct DeviceHub<G: DeviceSource> {
    source: G,
    held: Vec<Held<G::Device>>,
    refused: Vec<(PathBuf, u32, String)>,
    holder: Option<PathBuf>,
    latest: Latest,
    events: Vec<InputEvent>,
}

impl<G: DeviceSource> DeviceHub<G> {
    /// A hub without devices.
    pub fn new(source: G) -> Self {
        Self {
            source,
            held: Vec::new(),
            refused: Vec::new(),
            holder: None,
            latest: Latest::default(),
            events: Vec::new(),
        }
    }

    /// Adds devices that were plugged in since the last call, and removes unplugged ones.
    pub fn look(&mut self) {
        let list = self.source.list();
        let is_there = |path: &PathBuf| list.iter().any(|f| f.path == *path);
        let unplugged: Vec<PathBuf> = self
            .held
            .iter()
            .map(|h| h.found.path.clone())
            .filter(|p| !is_there(p))
            .collect();
        for path in unplugged {
            self.remove(&path);
        }
        self.refused.retain(|(path, ..)| is_there(path));
        for found in list {
            if !self.held.iter().any(|h| h.found.path == found.path) {
                self.add(found);
            }
        }
        let reported = self.refused.iter().filter(|(_, times, _)| *times >= REPORTED_AFTER);
        self.latest.denied = reported.map(|(.., why)| why.clone()).collect();
    }

    fn add(&mut self, found: Found) {
        let opened = self
            .source
            .open(&found)
            .and_then(|opened| Ok((opened.state()?, opened)));
        match opened {
            Ok((whole, opened)) => {
                self.refused.retain(|(path, ..)| *path != found.path);
                let state = State::new(found.kind, &whole);
                self.held.push(Held { found, opened, state });
            }
            Err(e) => {
                let why = OpenError::of(&found, e).to_string();
                match self.refused.iter_mut().find(|(path, ..)| *path == found.path) {
                    Some((_, times, text)) => (*times, *text) = (times.saturating_add(1), why),
                    None => self.refused.push((found.path, 1, why)),
                }
            }
        }
    }

    fn remove(&mut self, path: &PathBuf) {
        if let Some(at) = self.held.iter().position(|h| h.found.path == *path) {
            let held = self.held.remove(at);
            self.latest.disconnected = held.found.name;
            self.latest.disconnections = self.latest.disconnections.wrapping_add(1);
        }
        if self.holder.as_ref() == Some(path) {
            self.holder = None;
        }
    }

    /// Reads all devices at this time (s, of any clock that does not jump); a device that fails counts as unplugged.
    pub fn read(&mut self, now_s: f64) -> &Latest {
        let mut failed = Vec::new();
        for held in &mut self.held {
            self.events.clear();
            let read = read_one(held, &mut self.events, now_s, &mut self.latest.presses);
            if read.is_err() {
                failed.push(held.found.path.clone());
            }
        }
        for path in failed {
            self.remove(&path);
        }
        self.choose(now_s);
        &self.latest
    }

    /// One device at a time: another takes over only while the needle is at rest.
    fn choose(&mut self, now_s: f64) {
        let wish = |h: &Held<G::Device>| h.state.wish(now_s);
        let holds = |h: &&Held<G::Device>| Some(&h.found.path) == self.holder.as_ref();
        let present = self.held.iter().find(holds);
        let holder = present
            .filter(|h| wish(h) != Wish::REST)
            .or_else(|| self.held.iter().find(|h| wish(h) != Wish::REST))
            .or(present)
            .or(self.held.first());
        self.latest.wish = holder.map_or(Wish::REST, wish);
        self.latest.holder = holder.map(|h| Device {
            name: h.found.name.clone(),
            kind: h.found.kind,
            was_released: h.state.was_released(),
        });
        self.holder = holder.map(|h| h.found.path.clone());
    }

    /// Waits until a device has events, at most for this time.
    pub fn wait(&mut self, at_most: Duration) {
        let opened: Vec<&G::Device> = self.held.iter().map(|h| &h.opened).collect();
        self.source.wait(&opened, at_most);
    }
}

fn read_one<O: OpenDevice>(
    held: &mut Held<O>,
    events: &mut Vec<InputEvent>,
    now_s: f64,
    presses: &mut [u32; Button::ALL.len()],
) -> io::Result<()> {
    match held.opened.fetch(events) {
        Err(e) if ![ErrorKind::WouldBlock, ErrorKind::Interrupted].contains(&e.kind()) => return Err(e),
        _ => {}
    }
    let mut count = |button: Button| {
        let count = &mut presses[button as usize];
        *count = count.wrapping_add(1);
    };
    for event in events.drain(..) {
        match held.state.take(event, now_s) {
            Taken::Nothing => {}
            Taken::Pressed(button) => count(button),
            Taken::Lost => {
                let whole = held.opened.state()?;
                held.state.resync(&whole).into_iter().for_each(&mut count);
            }
        }
    }
    held.state.note_rest(now_s);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use evdev::{AbsInfo, AbsoluteAxisCode, AttributeSet, EventType, KeyCode};
    use std::cell::RefCell;
    use std::collections::VecDeque;
    use std::rc::Rc;

    type Queue = Rc<RefCell<VecDeque<io::Result<InputEvent>>>>;

    /// Two gamepads at most, with the events that they are to send.
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

        /// Away from the operator by so many of 100.
        fn pushes(&self, pad: usize, by: i32) {
            self.sends(pad, EventType::ABSOLUTE, AbsoluteAxisCode::ABS_Y.0, -by);
        }
    }

    fn holder(latest: &Latest) -> &str {
        latest.holder.as_ref().map_or("n/a", |h| h.name.as_str())
    }

    #[test]
    fn a_plugged_in_device_controls_the_needle_and_an_unplugged_one_leaves_it_at_rest_and_is_reported() {
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
        // ENODEV, what the kernel says of a device that was pulled out.
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
        // The stick of the device is in the middle.
        assert_eq!(hub.read(0.0).wish, Wish::REST);
    }

    #[test]
    fn a_device_without_permission_is_reported_with_its_cure_until_it_can_be_read() {
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
}
