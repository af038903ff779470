//! Several cores at a glance, for an instructor: the state board and the announcements of each, and nothing more
//! expensive.

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
/// Most orders queued for the thread.
const ORDERS: usize = 64;

/// A trainee and their core.
#[derive(Clone, Debug, PartialEq)]
pub struct Trainee {
    /// Name for people.
    pub name: String,
    /// Instance of their core, or of a relay in its place.
    pub instance: Instance,
}

/// State of one trainee.
#[derive(Clone, Debug)]
pub struct Glance {
    /// The trainee.
    pub trainee: Trainee,
    /// Time at which its core was last heard; `None` if never.
    pub heard: Option<Instant>,
    /// The last valid state.
    pub state: Option<HapticState>,
    /// The present run.
    pub session: Option<Session>,
    /// Plan in force: seeds, entry and direction.
    pub plan: Option<PlanInForce>,
    /// Connection to a core on another machine.
    pub relayed: Option<Relayed>,
}

/// All trainees, watched by a separate thread.
pub struct Roster {
    glances: Arc<Mutex<Vec<Glance>>>,
    stops: mpsc::SyncSender<usize>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Roster {
    /// Never fails and never blocks: a thread connects, and reconnects as needed.
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

    /// Returns the present state of all.
    pub fn glances(&self) -> Vec<Glance> {
        lock(&self.glances).clone()
    }

    /// Stops one trainee's hand, and marks the moment. False if the order could not be queued.
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

/// Ports to one core, dropped in this order: the node last.
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
            // Ports of a past epoch are dropped before new ones are made.
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
        // The memory of a dead core does not change.
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
            // The reply is ignored: the list shows what the hand does.
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
