//! The thread that reads the devices, of normal priority, and the window's end of it, which never
//! waits.

use super::found::{Found, Places, find};
use super::hub::{DeviceHub, DeviceSource, OpenDevice};
use super::state::DeviceState;
use crate::kind::Button;
use crate::latest::Latest;
use crate::wish::{ProbeWish, Wish};
use evdev::InputEvent;
use evdev::raw_stream::RawDevice;
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use triple_buffer::{Input, Output, triple_buffer};

/// Period of the search for devices that were plugged in or unplugged.
const LOOK_EVERY: Duration = Duration::from_millis(1500);
/// Shortest time between two readings of a device, however much it sends.
const READ_EVERY: Duration = Duration::from_millis(4);
/// Longest time between two publications while the needle moves.
const MOVING_EVERY: Duration = Duration::from_millis(20);
/// Age at which a wish expires, because the thread has stopped.
const WISH_LASTS: Duration = Duration::from_millis(250);

/// Devices of this machine.
#[derive(Default)]
pub struct System {
    /// Folders of the search.
    pub places: Places,
}

impl DeviceSource for System {
    type Device = RawDevice;

    fn list(&mut self) -> Vec<Found> {
        find(&self.places)
    }

    fn open(&mut self, found: &Found) -> io::Result<RawDevice> {
        let mut options = std::fs::OpenOptions::new();
        let file = options.read(true).custom_flags(libc::O_NONBLOCK).open(&found.path)?;
        RawDevice::try_from(file)
    }

    fn wait(&mut self, opened: &[&RawDevice], at_most: Duration) {
        let mut polled: Vec<libc::pollfd> = opened
            .iter()
            .map(|device| libc::pollfd {
                fd: device.as_raw_fd(),
                events: libc::POLLIN,
                revents: 0,
            })
            .collect();
        let ms = at_most.as_millis().min(10_000) as libc::c_int;
        // SAFETY: `polled` is valid for reads and writes of its length, and the devices stay open meanwhile.
        unsafe { libc::poll(polled.as_mut_ptr(), polled.len() as libc::nfds_t, ms) };
        // Whatever woke the thread, it reads all devices next; an unplugged one fails there.
    }
}

impl OpenDevice for RawDevice {
    fn fetch(&mut self, into: &mut Vec<InputEvent>) -> io::Result<()> {
        into.extend(self.fetch_events()?);
        Ok(())
    }

    fn state(&self) -> io::Result<DeviceState> {
        Ok(DeviceState {
            axes: self.get_absinfo()?.collect(),
            keys: self.get_key_state()?,
        })
    }
}

/// Window's end of the thread.
pub struct Controllers {
    latest: Output<(Instant, Latest)>,
    thread: Option<JoinHandle<()>>,
    /// Channel whose end stops the thread.
    open: Option<Sender<()>>,
    counted: [u32; Button::ALL.len()],
    two_hands: Arc<AtomicBool>,
}

impl Controllers {
    /// Starts the search for devices.
    pub fn start<G: DeviceSource + Send + 'static>(source: G) -> Self
    where
        G::Device: Send,
    {
        let (input, latest) = triple_buffer(&(Instant::now(), Latest::default()));
        let (open, window) = channel();
        let two_hands = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&two_hands);
        let thread = std::thread::Builder::new()
            .name("controllers".to_owned())
            .spawn(move || read_all(DeviceHub::new(source), input, &window, &asked));
        Self {
            latest,
            thread: thread.ok(),
            open: Some(open),
            counted: [0; Button::ALL.len()],
            two_hands,
        }
    }

    /// Sets whether a second device moves the probe.
    pub fn use_two_hands(&self, two_hands: bool) {
        // SYNC: no other memory depends on it; the thread sees it within its next reading.
        self.two_hands.store(two_hands, Ordering::Relaxed);
    }

    /// Creates an end without a thread: no device ever holds the needle.
    pub fn none() -> Self {
        Self {
            latest: triple_buffer(&(Instant::now(), Latest::default())).1,
            thread: None,
            open: None,
            counted: [0; Button::ALL.len()],
            two_hands: Arc::default(),
        }
    }

    /// Returns the latest state, and the buttons pressed since the last call. Never waits.
    pub fn take(&mut self) -> (Latest, Vec<Button>) {
        let (at, latest) = self.latest.read();
        let mut latest = latest.clone();
        if at.elapsed() > WISH_LASTS {
            (latest.wish, latest.probe) = (Wish::REST, ProbeWish::default());
        }
        if self.open.is_some() && self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            (latest.holder, latest.probe_holder) = (None, None);
            latest.denied = vec![
                "Gamepads and 3D mice are not read: the thread for it has ended. Open the window again.".to_owned(),
            ];
        }
        let mut pressed = Vec::new();
        for button in Button::ALL {
            let (now, before) = (latest.presses[button as usize], self.counted[button as usize]);
            pressed.extend((0..now.wrapping_sub(before)).map(|_| button));
        }
        self.counted = latest.presses;
        (latest, pressed)
    }
}

fn read_all<G: DeviceSource>(
    mut hub: DeviceHub<G>,
    mut latest: Input<(Instant, Latest)>,
    window: &Receiver<()>,
    two_hands: &AtomicBool,
) {
    let begun = Instant::now();
    let mut looked: Option<Instant> = None;
    while window.try_recv() == Err(TryRecvError::Empty) {
        if looked.is_none_or(|at| at.elapsed() >= LOOK_EVERY) {
            looked = Some(Instant::now());
            hub.look();
        }
        // SYNC: see `use_two_hands`.
        hub.use_two_hands(two_hands.load(Ordering::Relaxed));
        let read = hub.read(begun.elapsed().as_secs_f64()).clone();
        let is_moving = read.wish != Wish::REST || read.probe != ProbeWish::default();
        latest.write((Instant::now(), read));
        std::thread::sleep(READ_EVERY);
        let until_look = LOOK_EVERY.saturating_sub(looked.map_or(LOOK_EVERY, |at| at.elapsed()));
        hub.wait(if is_moving { MOVING_EVERY } else { until_look });
    }
}

#[cfg(test)]
mod tests {
    use super::super::found::tests::lay_down;
    use super::*;

    #[test]
    fn a_device_that_is_no_event_device_is_reported_and_never_read() {
        let folder = std::env::temp_dir().join(format!("stylet-reader-{}", std::process::id()));
        let places = Places {
            class: folder.join("class"),
            nodes: folder.join("nodes"),
        };
        lay_down(
            &places.class,
            "event1",
            "Pad",
            ["045e", "7cdb000000000000 0 0 0 0", "3003f", "0"],
        );
        std::fs::create_dir_all(&places.nodes).unwrap();
        std::fs::write(places.nodes.join("event1"), "no device").unwrap();
        let mut hub = DeviceHub::new(System { places });
        hub.look();
        assert_eq!(hub.read(0.0).denied, [""; 0], "its rights may follow");
        hub.look();
        let latest = hub.read(0.0);
        assert_eq!((latest.holder.clone(), latest.denied.len()), (None, 1));
        assert!(latest.denied[0].starts_with("Pad ("), "{:?}", latest.denied);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn an_ended_thread_leaves_no_wish() {
        struct Broken;
        impl DeviceSource for Broken {
            type Device = RawDevice;
            fn list(&mut self) -> Vec<Found> {
                panic!("on purpose")
            }
            fn open(&mut self, _: &Found) -> io::Result<RawDevice> {
                Err(io::ErrorKind::NotFound.into())
            }
            fn wait(&mut self, _: &[&RawDevice], _: Duration) {}
        }
        let mut controllers = Controllers::start(Broken);
        while !controllers.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            std::thread::sleep(Duration::from_millis(1));
        }
        let (latest, pressed) = controllers.take();
        assert_eq!((latest.wish, pressed.len()), (Wish::REST, 0));
        assert!(latest.denied[0].contains("has ended"));
        assert_eq!(Controllers::none().take().0, Latest::default());
    }
}
