//! A core in this process, as in a web page: its messages reach the inbox without a bridge.

use super::UNANSWERED;
use super::inbox::Inbox;
use super::intake::{Intake, Published};
use super::outgoing::Outgoing;
use super::thread::lock;
use std::sync::{Arc, Mutex, mpsc};
use stylet_shm_schema::{Command, Request, UploadHeader, VALID_RANGE_S};
use web_time::{Duration, Instant};

/// Longest time between two runs of the core.
const PASS: Duration = Duration::from_millis(2);

/// A core in this process. A page runs it once a frame, by [`super::Link::poll`].
pub trait LocalCore: 'static {
    /// Takes a request of a host.
    fn command(&mut self, command: &Command);

    /// Takes a volume, and its cells.
    fn upload(&mut self, header: &UploadHeader, cells: &[u8]);

    /// Steps both loops up to the present time, and publishes what is new.
    fn run(&mut self, publish: &mut dyn FnMut(Published<'_>));
}

/// The core, and the way of its messages.
pub struct Here<C> {
    core: C,
    host_id: u64,
    inbox: Arc<Mutex<Inbox>>,
    asked: mpsc::Receiver<Outgoing>,
    intake: Intake,
    promised_until: Option<Instant>,
}

impl<C: LocalCore> Here<C> {
    pub fn new(core: C, host_id: u64, inbox: Arc<Mutex<Inbox>>, asked: mpsc::Receiver<Outgoing>) -> Self {
        Self {
            core,
            host_id,
            inbox,
            asked,
            intake: Intake::of(host_id),
            promised_until: None,
        }
    }

    /// Hands over what the host asked, runs the core, and returns the time to wait.
    pub fn pass(&mut self) -> Duration {
        while let Ok(outgoing) = self.asked.try_recv() {
            match outgoing {
                Outgoing::Command(command) => self.core.command(&command),
                Outgoing::Upload(header, cells) => self.core.upload(&header, &cells),
                Outgoing::Promise(until) => self.promised_until = Some(until),
                // No relay serves a core of this process.
                Outgoing::Lease(_) => {}
            }
        }
        self.renew(Instant::now());
        let (intake, inbox) = (&mut self.intake, &self.inbox);
        // Locked for each message: the host takes its data while the loops run.
        self.core.run(&mut |message| {
            intake.take(&mut lock(inbox), message);
        });
        let (now, inbox) = (Instant::now(), &mut *lock(inbox));
        (inbox.pulse.moved, inbox.pulse.looked) = (Some(now), Some(now));
        inbox.pulse.has_board = true;
        PASS
    }

    /// Renews the host's motions while it promises them. Each renewal is as long as one may be: a page takes all ticks of
    /// a frame at once, and the core does not outlive its host.
    fn renew(&mut self, now: Instant) {
        let valid_s = VALID_RANGE_S[1];
        // A page runs the core only while it draws, and may draw once a second.
        let late_s = if cfg!(target_family = "wasm") { 5.0 } else { valid_s };
        let holds = |until: Instant| now < until + Duration::from_secs_f64(late_s);
        if !self.promised_until.is_some_and(holds) {
            return;
        }
        if let Ok(command) = (Request::KeepMoving { valid_s }).encode(self.host_id, UNANSWERED) {
            self.core.command(&command);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{Link, LinkStatus};
    use bytemuck::Zeroable;
    use stylet_shm_schema::{CommandKind, HandMove, Instance, Reply, SCHEMA_VERSION, Session, TickRecord};

    /// Core of one tick in each run, which accepts everything, and forwards the kinds of its commands.
    struct Core {
        tick: u64,
        asked: Vec<Command>,
        kinds: mpsc::Sender<u32>,
    }

    impl LocalCore for Core {
        fn command(&mut self, command: &Command) {
            self.asked.push(*command);
            let _ = self.kinds.send(command.kind);
        }

        fn upload(&mut self, _: &UploadHeader, _: &[u8]) {}

        fn run(&mut self, publish: &mut dyn FnMut(Published<'_>)) {
            let mut session = Session::zeroed();
            (session.session_id, session.schema_version, session.period_ns) = (7, SCHEMA_VERSION, 1_000_000);
            publish(Published::Session(&session));
            self.tick += 1;
            let record = TickRecord {
                session_id: 7,
                tick: self.tick,
                ..TickRecord::zeroed()
            };
            // Another run's tick is not part of this one.
            let other = TickRecord {
                session_id: 6,
                ..record
            };
            publish(Published::Records(&[record, other]));
            for command in self.asked.drain(..) {
                let of = (command.host_id, command.command_id);
                publish(Published::Reply(&Reply::new(7, of, Ok(self.tick))));
            }
        }
    }

    #[test]
    fn a_core_in_this_process_is_heard_and_obeys() {
        let (kinds, asked) = mpsc::channel();
        let core = move || {
            Ok::<_, String>(Core {
                tick: 0,
                asked: Vec::new(),
                kinds,
            })
        };
        let mut link = Link::here(Instance::new("here").expect("a name"), core);
        let begun = Instant::now();
        let mut until = |holds: &mut dyn FnMut(&mut Link) -> bool| {
            while !holds(&mut link) {
                assert!(begun.elapsed() < Duration::from_secs(20));
                std::thread::sleep(Duration::from_millis(1));
                link.poll();
            }
        };
        let mut ticks = Vec::new();
        until(&mut |link| {
            ticks.extend(link.take_records().iter().map(|record| record.tick));
            ticks.len() > 3
        });
        assert!(ticks.iter().copied().eq(1..=ticks.len() as u64), "{ticks:?}");
        let (tip_m, direction) = ([0.01; 3], [0.0, 0.0, 1.0]);
        let hand = HandMove {
            tip_m,
            direction,
            speed_m_per_s: 0.01,
            acceleration_m_per_s2: 1.0,
        };
        let mut id = None;
        until(&mut |link| {
            assert_eq!(link.status(), LinkStatus::Live);
            id = id.or_else(|| link.send(&Request::MoveHand(hand)).ok());
            id.is_some_and(|id| link.reply(id).is_some_and(|answer| answer.is_ok()))
        });
        // The motion goes on while this host polls.
        until(&mut |_| asked.try_iter().any(|kind| kind == CommandKind::KeepMoving as u32));
    }
}
