//! Programs that end, hang or lose their readers while they move the hand: it is at rest within 5 mm and 0.4 s of its
//! owner's end, and keeps moving while it has an owner. A killed procedure used to leave a hand that moved on for 55 mm
//! and 5 s.
//!
//! The window and a gamepad are in `tests/window/src/senders.rs`; `make senders` makes fifty trials of each.

use crate::igtl::{further, needle_of, send};
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use stylet_tests::sender::{Place, Sender, Table, kinds, trial};
use stylet_tests::stage::Stage;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, program, repeats, scratch, until};

/// Speed of the insertion: the fastest published, mm/s.
const MM_PER_S: &str = "123";

#[test]
fn a_hand_rests_within_5_mm_and_400_ticks_of_its_procedures_end() {
    where_the_machine_runs(|| {
        let mut stage = Stage::open();
        let mut table = Table::begin("procedure");
        for (place, ending) in kinds() {
            let seen: Vec<_> = (0..repeats("SENDERS_TRIALS", 1))
                .map(|_| {
                    stage.draw_out();
                    let mut sender = Sender::start(procedure(&stage.core), ending);
                    // The path to the entry takes half a second, that in the tissue as long.
                    let after = Duration::from_secs_f64(0.25 * stage.random.unit());
                    trial(&mut stage.observer, &mut sender, (place, ending), after, BEGINS_WITHIN)
                })
                .collect();
            table.row((place, ending), &seen);
        }
        stage.close();
        table.end();
    });
}

const BEGINS_WITHIN: Duration = Duration::from_secs(20);

fn procedure(core: &Core) -> Command {
    let mut command = Command::new(program("host-ui"));
    command.args(["procedure", "--instance", core.instance.name()]);
    command.args(["--insert-speed", MM_PER_S, "--out"]);
    command.arg(scratch("motion-sender").join("out"));
    command
}

#[test]
fn a_hand_rests_within_5_mm_and_400_ticks_of_its_igtl_servers_end() {
    where_the_machine_runs(|| {
        let mut stage = Stage::open();
        let mut table = Table::begin("igtl");
        for (place, ending) in kinds() {
            let seen: Vec<_> = (0..repeats("SENDERS_TRIALS", 1))
                .map(|_| {
                    stage.draw_out();
                    if place == Place::Tissue {
                        stage.go_to_entry();
                    }
                    let port = free_port();
                    let mut sender = Sender::start(igtl(&stage.core, port), ending);
                    let by_mm = if place == Place::Air { -100.0 } else { 70.0 };
                    let tracker = Tracker::begin(port, by_mm);
                    let after = Duration::from_secs_f64(0.2 * stage.random.unit());
                    let trial = trial(&mut stage.observer, &mut sender, (place, ending), after, BEGINS_WITHIN);
                    drop(tracker);
                    trial
                })
                .collect();
            table.row((place, ending), &seen);
        }
        stage.close();
        table.end();
    });
}

fn igtl(core: &Core, port: u16) -> Command {
    let mut command = Command::new(program("host-ui"));
    command.args(["igtl", "--instance", core.instance.name(), "--hand", "Stylus"]);
    command.args(["--hand-speed", MM_PER_S, "--listen", &format!("127.0.0.1:{port}")]);
    command
}

/// Its output is not read, so it cannot report its port.
fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("bound").port()
}

/// A client that keeps sending the needle elsewhere until dropped.
struct Tracker {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Tracker {
    fn begin(port: u16, by_mm: f32) -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut stream = None;
            until(BEGINS_WITHIN, || {
                stream = TcpStream::connect(("127.0.0.1", port)).ok();
                stream.is_some()
            });
            let mut stream = stream.expect("it listens");
            let goal = further(needle_of(&mut stream), by_mm);
            let mut read = [0; 1 << 16];
            while !ends.load(Ordering::Relaxed) && send(&mut stream, "Stylus", goal).is_ok() {
                // A client that does not read is disconnected.
                stream.set_nonblocking(true).expect("a socket");
                while matches!(stream.read(&mut read), Ok(1..)) {}
                stream.set_nonblocking(false).expect("a socket");
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let thread = Some(thread);
        Self { is_over, thread }
    }
}

impl Drop for Tracker {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
