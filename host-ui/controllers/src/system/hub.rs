//! All devices together: those plugged in, those that cannot be read, and the one that controls the
//! needle.

use super::error::OpenError;
use super::found::Found;
use super::state::{DeviceState, State, Taken};
use crate::kind::Button;
use crate::latest::{Device, Latest};
use crate::wish::{ProbeWish, Wish};
use evdev::InputEvent;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::Duration;

/// Failed attempts to open a device before it is reported, because its node appears before its
/// rights are set.
const REPORTED_AFTER: u32 = 2;

/// Source of devices: the system, or a test.
pub trait DeviceSource {
    /// An open device.
    type Device: OpenDevice;
    /// Returns the devices that are plugged in now.
    fn list(&mut self) -> Vec<Found>;
    /// Opens one of them.
    fn open(&mut self, found: &Found) -> io::Result<Self::Device>;
    /// Waits until one of them has events, at most for this time.
    fn wait(&mut self, opened: &[&Self::Device], at_most: Duration);
}

/// Open device. Neither call may block.
pub trait OpenDevice {
    /// Appends new events; returns `WouldBlock` if there are none.
    fn fetch(&mut self, into: &mut Vec<InputEvent>) -> io::Result<()>;
    /// Returns the present state of its axes and keys.
    fn state(&self) -> io::Result<DeviceState>;
}

struct Held<O> {
    found: Found,
    opened: O,
    state: State,
}

/// Connected devices and their requests.
pub struct DeviceHub<G: DeviceSource> {
    source: G,
    held: Vec<Held<G::Device>>,
    refused: Vec<(PathBuf, u32, String)>,
    holder: Option<PathBuf>,
    latest: Latest,
    events: Vec<InputEvent>,
    two_hands: bool,
}

impl<G: DeviceSource> DeviceHub<G> {
    /// Creates a hub without devices.
    pub fn new(source: G) -> Self {
        Self {
            source,
            held: Vec::new(),
            refused: Vec::new(),
            holder: None,
            latest: Latest::default(),
            events: Vec::new(),
            two_hands: false,
        }
    }

    /// Enables two hands: the device that controls the needle keeps it, and another one controls
    /// the probe.
    pub fn use_two_hands(&mut self, two_hands: bool) {
        self.two_hands = two_hands;
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

    /// Reads all devices at this time (s, of any monotonic clock); a device that fails counts as
    /// unplugged.
    pub fn read(&mut self, now_s: f64) -> &Latest {
        let mut failed = Vec::new();
        for held in &mut self.held {
            self.events.clear();
            // The thumb on the probe's device must not drop a seed.
            let stops_only = self.two_hands && Some(&held.found.path) != self.holder.as_ref();
            let presses = &mut self.latest.presses;
            let count = |button: Button| {
                if !stops_only || button == Button::Stop {
                    let count = &mut presses[button as usize];
                    *count = count.wrapping_add(1);
                }
            };
            let read = read_one(held, &mut self.events, now_s, count);
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

    /// Chooses one device: another takes over only while the needle is at rest.
    fn choose(&mut self, now_s: f64) {
        let wish = |h: &Held<G::Device>| h.state.wish(now_s);
        let holds = |h: &&Held<G::Device>| Some(&h.found.path) == self.holder.as_ref();
        let present = self.held.iter().find(holds);
        let holder = present
            .filter(|h| self.two_hands || wish(h) != Wish::REST)
            .or_else(|| self.held.iter().find(|h| wish(h) != Wish::REST))
            .or(present)
            .or(self.held.first());
        self.latest.wish = holder.map_or(Wish::REST, wish);
        let device = |h: &Held<G::Device>| Device {
            name: h.found.name.clone(),
            kind: h.found.kind,
            was_released: h.state.was_released(),
        };
        self.latest.holder = holder.map(device);
        let path = holder.map(|h| h.found.path.clone());
        let mut others = self.held.iter().filter(|h| Some(&h.found.path) != path.as_ref());
        let other = others.next().filter(|_| self.two_hands);
        self.latest.probe_holder = other.map(device);
        self.latest.probe = other.map_or_else(ProbeWish::default, |h| h.state.probe_wish(now_s));
        self.holder = path;
    }

    /// Waits until a device has events, up to a limit.
    pub fn wait(&mut self, at_most: Duration) {
        let opened: Vec<&G::Device> = self.held.iter().map(|h| &h.opened).collect();
        self.source.wait(&opened, at_most);
    }
}

fn read_one<O: OpenDevice>(
    held: &mut Held<O>,
    events: &mut Vec<InputEvent>,
    now_s: f64,
    mut count: impl FnMut(Button),
) -> io::Result<()> {
    match held.opened.fetch(events) {
        Err(e) if ![ErrorKind::WouldBlock, ErrorKind::Interrupted].contains(&e.kind()) => return Err(e),
        _ => {}
    }
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
mod tests;
