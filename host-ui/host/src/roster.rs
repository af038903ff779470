//! Several cores at a glance, for whoever instructs: of each the state board and what it announces, and nothing that costs more.

use crate::moments::STOPPED;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node, Publisher, StateReader, Subscriber};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{
    Command, CommandKind, HapticState, Mark, PlanInForce, Relayed, Request, SCHEMA_VERSION, Session, check,
};

const PASS: Duration = Duration::from_millis(100);
const CONNECT_EVERY: Duration = Duration::from_secs(1);
/// Ports of a core that is silent for so long are made anew.
const ORDERS: usize = 64;

/// A trainee and the core that they sit at.
#[derive(Clone, Debug, PartialEq)]
pub struct Trainee {
    /// For people.
    pub name: String,
    /// Of their core, or of a relay in its place.
    pub instance: Instance,
}

/// What is known of one of them.
#[derive(Clone, Debug)]
pub struct Glance {
    /// Who it is.
    pub trainee: Trainee,
    /// When its core was heard last; `None` while it never was.
    pub heard: Option<Instant>,
    /// The last valid state.
    pub state: Option<HapticState>,
    /// The present run.
    pub session: Option<Session>,
    /// Seeds of the plan in force, and where it enters and goes.
    pub plan: Option<PlanInForce>,
    /// The line to the core, where that runs on another machine.
    pub relayed: Option<Relayed>,
}

/// All of them, seen by a thread of its own.
pub struct Roster {
    glances: Arc<Mutex<Vec<Glance>>>,
    stops: mpsc::SyncSender<usize>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Roster {
    /// Never fails and never blocks: a thread connects, as often as it must.
    pub fn start(trainees: Vec<Trainee>) -> Self {
        let glance = |trainee: &Trainee| Glance {
            trainee: trainee.clone(),
            heard: None,
            state: None,
            session: None,
            plan: None,
            relayed: None,
        };
        let glances = Arc::new(Mutex::new(trainees.iter().map(glance).collect::<Vec<_>>()));
        let (stops, asked) = mpsc::sync_channel::<usize>(ORDERS);
        let end = Arc::new(AtomicBool::new(false));
        let (into, ended) = (Arc::clone(&glances), Arc::clone(&end));
        let work = move || {
            let mut seats: Vec<Seat> = trainees.iter().map(|_| Seat::default()).collect();
            // SYNC: set when the roster is dropped; nothing but the flag is carried.
            while !ended.load(Ordering::Relaxed) {
                for (number, seat) in seats.iter_mut().enumerate() {
                    seat.pass(&trainees[number].instance, &into, number);
                }
                while let Ok(number) = asked.try_recv() {
                    if let Some(seat) = seats.get_mut(number) {
                        seat.stop();
                    }
                }
                std::thread::park_timeout(PASS);
            }
        };
        let thread = std::thread::Builder::new().name("roster".to_owned()).spawn(work).ok();
        Self {
            glances,
            stops,
            end,
            thread,
        }
    }

    /// As they are now.
    pub fn glances(&self) -> Vec<Glance> {
        lock(&self.glances).clone()
    }

    /// Stops the hand of one, and marks the moment. False where it could not be asked for.
    pub fn stop(&self, number: usize) -> bool {
        let taken = self.stops.try_send(number).is_ok();
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
        taken && self.thread.is_some()
    }
}

impl Drop for Roster {
    fn drop(&mut self) {
        // SYNC: read by the thread.
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

fn lock(glances: &Mutex<Vec<Glance>>) -> MutexGuard<'_, Vec<Glance>> {
    glances.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ports to one core. In this order they are dropped: the node last.
struct Ports {
    board: Option<(u64, StateReader)>,
    session: Subscriber<Session>,
    plan: Subscriber<PlanInForce>,
    relayed: Subscriber<Relayed>,
    commands: Publisher<Command>,
    stops: Publisher<Command>,
    node: Node,
}

impl Ports {
    fn new(instance: &Instance) -> Option<Self> {
        let node = Node::join(instance).ok()?;
        Some(Self {
            board: None,
            session: service::session::subscriber(&node).ok()?,
            plan: service::plan::subscriber(&node).ok()?,
            relayed: service::relayed::subscriber(&node).ok()?,
            commands: service::commands::publisher(&node).ok()?,
            stops: service::stops::publisher(&node).ok()?,
            node,
        })
    }
}

#[derive(Default)]
struct Seat {
    ports: Option<Ports>,
    tried: Option<Instant>,
    beat: (u64, u64),
    commands: u64,
}

impl Seat {
    fn pass(&mut self, instance: &Instance, glances: &Mutex<Vec<Glance>>, number: usize) {
        if self.tried.is_none_or(|at| at.elapsed() >= CONNECT_EVERY) {
            self.tried = Some(Instant::now());
            // Those of an epoch that is over go before others are made.
            self.ports = self.ports.take().filter(|ports| ports.node.is_current());
            self.ports = self.ports.take().or_else(|| Ports::new(instance));
        }
        let Some(ports) = &mut self.ports else { return };
        let newest = std::iter::from_fn(|| ports.session.receive())
            .filter(|s| s.schema_version == SCHEMA_VERSION && s.period_ns > 0)
            .max_by_key(|s| s.time_ns);
        let plan = std::iter::from_fn(|| ports.plan.receive()).last();
        let relayed = std::iter::from_fn(|| ports.relayed.receive()).last();
        let mut all = lock(glances);
        let Some(glance) = all.get_mut(number) else { return };
        if let Some(session) = newest {
            if glance.session.is_some_and(|old| old.session_id != session.session_id) {
                (glance.state, glance.plan, glance.relayed) = (None, None, None);
            }
            glance.session = Some(session);
        }
        let id = glance.session.map(|s| s.session_id);
        glance.plan = plan
            .filter(|p| id == Some(p.session_id) && check::plan(p).is_ok())
            .or(glance.plan);
        glance.relayed = relayed.filter(|r| id == Some(r.session_id)).or(glance.relayed);
        let Some(session) = glance.session else { return };
        if ports.board.as_ref().is_none_or(|(of, _)| *of != session.session_id) {
            let board = StateReader::open(&ports.node, session.session_id).ok();
            ports.board = board.map(|board| (session.session_id, board));
        }
        let state = ports.board.as_ref().map(|(_, board)| board.read());
        let state = state.filter(|state| check::state(state).is_ok());
        glance.state = state.or(glance.state);
        // What comes out of a dead core's memory does not move.
        let beat = (session.time_ns, glance.state.map_or(0, |s| s.tick));
        if beat != self.beat {
            self.beat = beat;
            glance.heard = Some(Instant::now());
        }
    }

    fn stop(&mut self) {
        let mark = Mark {
            text: STOPPED.to_owned(),
            before_s: 0.0,
        };
        for request in [Request::StopHand, Request::Mark(mark)] {
            self.commands += 1;
            // No reply is waited for: the list shows what the hand does.
            let command = request.encode(u64::from(std::process::id()) << 32, self.commands);
            if let (Some(ports), Ok(command)) = (&self.ports, command) {
                if CommandKind::is_stop(command.kind) {
                    let _ = ports.stops.send(command);
                }
                let _ = ports.commands.send(command);
            }
        }
    }
}
