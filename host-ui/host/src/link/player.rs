//! Plays a recording like a core: a thread puts its messages into the inbox, each at its time.

use super::inbox::Inbox;
use super::thread::lock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use stylet_shm_schema::{
    Event, EventKind, HapticState, ParametersInForce, PlanInForce, SecondRecord, SecondState, Session, TickRecord,
};
use web_time::{Duration, Instant};

pub use stylet_recordings::{Piece, Played, RecordingError, ShowError, played, played_of};

const PASS: Duration = Duration::from_millis(4);
/// Interval of the heartbeat, without which the host would consider the core silent while the recording is paused.
const BEAT: Duration = Duration::from_millis(20);

/// Event of a recording on its time line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeMark {
    /// Position, s.
    pub at_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
}

/// No other position is asked for.
const NONE: u64 = u64::MAX;

/// The host's control of a played recording.
#[derive(Clone)]
pub struct Playback {
    held: Arc<AtomicBool>,
    /// Position to which the host jumps, ns.
    asked_ns: Arc<AtomicU64>,
    /// Speed in thousandths of that of the recording.
    speed: Arc<AtomicU64>,
    at_ns: Arc<AtomicU64>,
    length_ns: u64,
    marks: Arc<[TimeMark]>,
}

impl Playback {
    pub(super) fn of(played: &Played) -> Self {
        let mark = |(time_ns, piece): &(u64, Piece)| match piece {
            Piece::Event(event) => Some(TimeMark {
                at_s: *time_ns as f64 * 1e-9,
                kind: EventKind::from_number(event.kind)?,
            }),
            _ => None,
        };
        Self {
            held: Arc::default(),
            asked_ns: Arc::new(AtomicU64::new(NONE)),
            speed: Arc::new(AtomicU64::new(1000)),
            at_ns: Arc::default(),
            length_ns: played.length_ns(),
            marks: played.pieces.iter().filter_map(mark).collect(),
        }
    }

    /// Pauses or resumes.
    pub fn hold(&self, held: bool) {
        // SYNC: read by `Player::pass`; nothing but the flag is carried. So with the flag and the number below.
        self.held.store(held, Ordering::Relaxed);
    }

    /// Jumps to a position, s.
    pub fn jump(&self, to_s: f64) {
        let to_ns = (to_s.max(0.0) * 1e9) as u64;
        // SYNC: taken by `Player::pass`.
        self.asked_ns.store(to_ns.min(self.length_ns), Ordering::Relaxed);
    }

    /// Plays at this multiple of the recorded speed.
    pub fn play_at(&self, speed: f64) {
        // SYNC: read by `Player::pass`.
        self.speed.store((speed * 1e3) as u64, Ordering::Relaxed);
    }

    /// Multiple of the recorded speed.
    pub fn speed(&self) -> f64 {
        // SYNC: stored by `play_at`.
        self.speed.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// Events in their order.
    pub fn marks(&self) -> Arc<[TimeMark]> {
        self.marks.clone()
    }

    /// True while paused.
    pub fn is_held(&self) -> bool {
        // SYNC: stored by `hold`.
        self.held.load(Ordering::Relaxed)
    }

    /// Position, s.
    pub fn at_s(&self) -> f64 {
        // SYNC: stored by `Player::pass`.
        self.at_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// Duration, s.
    pub fn length_s(&self) -> f64 {
        self.length_ns as f64 * 1e-9
    }

    /// True once all of it was shown.
    pub fn has_ended(&self) -> bool {
        // SYNC: stored by `Player::pass`.
        self.at_ns.load(Ordering::Relaxed) >= self.length_ns
    }
}

/// The thread's side.
pub struct Player {
    played: Arc<Played>,
    playback: Playback,
    inbox: Arc<Mutex<Inbox>>,
    /// Increased with each restart: ticks never go back within a run of the core.
    session: Session,
    next: usize,
    last: Option<TickRecord>,
    at: Duration,
    looked: Instant,
    beat: Instant,
}

impl Player {
    pub fn new(played: Arc<Played>, playback: Playback, inbox: Arc<Mutex<Inbox>>) -> Self {
        let mut player = Self {
            session: played.session,
            played,
            playback,
            inbox,
            next: 0,
            last: None,
            at: Duration::ZERO,
            looked: Instant::now(),
            beat: Instant::now(),
        };
        player.begin();
        player
    }

    fn begin(&mut self) {
        self.session.session_id = self.session.session_id.wrapping_add(1);
        (self.next, self.at) = (0, Duration::ZERO);
        self.last = None;
        lock(&self.inbox).begin(self.session);
    }

    /// Plays the messages that are due, and returns the time to wait.
    pub fn pass(&mut self) -> Duration {
        let now = Instant::now();
        // SYNC: set by `Playback::jump`.
        let asked_ns = self.playback.asked_ns.swap(NONE, Ordering::Relaxed);
        if asked_ns != NONE {
            let asked = Duration::from_nanos(asked_ns);
            if asked < self.at {
                self.begin();
            }
            self.at = asked;
        } else if !self.playback.is_held() {
            self.at += (now - self.looked).mul_f64(self.playback.speed());
        }
        self.looked = now;
        let length = Duration::from_nanos(self.played.length_ns());
        self.at = self.at.min(length);
        // SYNC: read by `Playback::at_s` and `has_ended`.
        self.playback.at_ns.store(self.at.as_nanos() as u64, Ordering::Relaxed);
        let inbox = &mut *lock(&self.inbox);
        let is_moving = self.next < self.played.pieces.len() && (asked_ns != NONE || !self.playback.is_held());
        while let Some((_, piece)) = self
            .played
            .pieces
            .get(self.next)
            .filter(|(time_ns, _)| u128::from(*time_ns) <= self.at.as_nanos())
        {
            self.next += 1;
            put(inbox, piece, self.session.session_id, &mut self.last);
        }
        if is_moving || now - self.beat >= BEAT {
            self.beat = now;
            (inbox.pulse.moved, inbox.pulse.looked) = (Some(now), Some(now));
            inbox.pulse.has_board = true;
        }
        PASS
    }
}

/// Plays a message as of the run `session_id`; ticks update the state.
fn put(inbox: &mut Inbox, piece: &Piece, session_id: u64, last: &mut Option<TickRecord>) {
    let run = &mut inbox.run;
    match piece {
        Piece::Tick(tick) => {
            let mut record = **tick;
            record.session_id = session_id;
            if let Some(state) = &mut run.state {
                carry(&record, state);
            }
            inbox.put_record(record);
            *last = Some(record);
        }
        Piece::Event(event) => inbox.put_event(Event { session_id, ..**event }),
        Piece::Second(record) => {
            let record = SecondRecord { session_id, ..**record };
            run.second_state = Some(carry_second(&record, run.second_state.as_ref()));
            inbox.put_second_record(record);
        }
        Piece::State(found) => {
            let mut found = **found;
            if let Some(record) = last {
                carry(record, &mut found);
            }
            run.state = Some(found);
        }
        Piece::Scene(scene) => run.scene = Some(Arc::new(scene.of_session(session_id))),
        Piece::Plan(plan) => run.plan = Some(PlanInForce { session_id, ..**plan }),
        Piece::Parameters(parameters) => {
            run.parameters = Some(ParametersInForce {
                session_id,
                ..**parameters
            });
        }
        Piece::Snapshot(snapshot) => {
            let mut snapshot = (**snapshot).clone();
            snapshot.header.session_id = session_id;
            run.snapshot = Some(Arc::new(snapshot));
        }
    }
}

/// Copies the fields of a tick to the state.
fn carry(record: &TickRecord, state: &mut HapticState) {
    (state.tick, state.time_ns) = (record.tick, record.due_ns + record.wake_latency_ns);
    (state.phase, state.fault, state.flags) = (record.phase, record.fault, record.flags);
    (state.tip_in_scene_m, state.force_on_hand_n) = (record.tip_in_scene_m, record.force_on_hand_n);
    (state.depth_m, state.speed_m_per_s) = (record.depth_m, record.speed_m_per_s);
    (state.force_terms_n, state.tissue_tick) = (record.force_terms_n, record.tissue_tick);
    state.tip_deflection_m = record.tip_deflection_m;
}

/// Copies the fields of a tick of the second device to its state; the rest stays unchanged, or zero.
fn carry_second(record: &SecondRecord, before: Option<&SecondState>) -> SecondState {
    let mut state = before.copied().unwrap_or(bytemuck::Zeroable::zeroed());
    (state.tick, state.time_ns) = (record.tick, record.due_ns + record.wake_latency_ns);
    (state.tip_in_scene_m, state.world_from_tool) = (record.tip_in_scene_m, record.world_from_tool);
    (state.force_on_hand_n, state.torque_on_hand_nm) = (record.force_on_hand_n, record.torque_on_hand_nm);
    let force_n = record.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt();
    state.peak_force_n = state.peak_force_n.max(force_n);
    state.missed_deadlines += u64::from(record.missed);
    (state.fault, state.flags, state.buttons) = (record.fault, record.flags, record.buttons);
    state.tissue_tick = record.tissue_tick;
    state
}
