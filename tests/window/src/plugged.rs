//! Fake gamepads and 3D mice: the test writes their kernel events.

use evdev::{AbsInfo, AbsoluteAxisCode, AttributeSet, EventType, InputEvent, KeyCode};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stylet_controllers::{DeviceSource, DeviceState, Found, Kind, OpenDevice};

/// `ENODEV`, the kernel's answer for a device that was pulled out.
const NO_SUCH_DEVICE: i32 = 19;

/// One device at most; clones share the same table.
#[derive(Clone, Default)]
pub struct Table {
    there: Arc<Mutex<Option<Kind>>>,
    queue: Queue,
}

type Queue = Arc<Mutex<VecDeque<io::Result<InputEvent>>>>;

pub struct Plugged {
    queue: Queue,
}

impl Table {
    pub fn plug(&self, kind: Kind) {
        *self.there.lock().unwrap() = Some(kind);
    }

    pub fn unplug(&self) {
        *self.there.lock().unwrap() = None;
        let unplugged = io::Error::from_raw_os_error(NO_SUCH_DEVICE);
        self.queue.lock().unwrap().push_back(Err(unplugged));
    }

    /// Moves an axis to a share of its range, -1 to 1.
    pub fn axis(&self, axis: AbsoluteAxisCode, share: f64) {
        self.says(EventType::ABSOLUTE, axis.0, (share * 350.0) as i32);
    }

    pub fn press(&self, key: KeyCode) {
        self.says(EventType::KEY, key.0, 1);
        self.says(EventType::KEY, key.0, 0);
    }

    fn says(&self, kind: EventType, code: u16, value: i32) {
        let report = InputEvent::new(EventType::SYNCHRONIZATION.0, 0, 0);
        let mut queue = self.queue.lock().unwrap();
        queue.extend([Ok(InputEvent::new(kind.0, code, value)), Ok(report)]);
    }
}

impl DeviceSource for Table {
    type Device = Plugged;

    fn list(&mut self) -> Vec<Found> {
        let there = self.there.lock().unwrap();
        let found = there.map(|kind| Found {
            path: "/nodes/event7".into(),
            name: format!("Test {}", kind.name()),
            kind,
        });
        found.into_iter().collect()
    }

    fn open(&mut self, _: &Found) -> io::Result<Plugged> {
        Ok(Plugged {
            queue: self.queue.clone(),
        })
    }

    fn wait(&mut self, _: &[&Plugged], at_most: Duration) {
        std::thread::sleep(at_most.min(Duration::from_millis(10)));
    }
}

impl OpenDevice for Plugged {
    fn fetch(&mut self, into: &mut Vec<InputEvent>) -> io::Result<()> {
        while let Some(event) = self.queue.lock().unwrap().pop_front() {
            into.push(event?);
        }
        Err(ErrorKind::WouldBlock.into())
    }

    fn state(&self) -> io::Result<DeviceState> {
        let axes = [
            AbsoluteAxisCode::ABS_X,
            AbsoluteAxisCode::ABS_Y,
            AbsoluteAxisCode::ABS_Z,
        ];
        Ok(DeviceState {
            axes: axes.map(|a| (a, AbsInfo::new(0, -350, 350, 0, 0, 0))).to_vec(),
            keys: AttributeSet::new(),
        })
    }
}
