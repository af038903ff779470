//! The host's only access to shared memory: receives and validates what the core publishes, and sends requests.

mod here;
mod inbox;
mod intake;
mod motion;
mod outgoing;
mod player;
// A web page has no shared memory.
#[cfg(not(target_family = "wasm"))]
mod ports;
mod received;
#[cfg(not(target_family = "wasm"))]
mod receiver;
#[cfg(not(target_family = "wasm"))]
mod renewals;
#[cfg(not(target_family = "wasm"))]
mod second;
mod thread;
mod upload;
mod worker;

use inbox::{Inbox, Pulse, RECORDS_KEPT, Run};
use motion::Motions;
use outgoing::Outgoing;
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Display;
use std::sync::Arc;
use stylet_shm_schema::*;
use thread::Receiver;
use web_time::{Duration, Instant};

pub use here::LocalCore;
pub use intake::Published;
pub use player::{Piece, Playback, Played, RecordingError, ShowError, TimeMark, played, played_of};
pub use received::{Answer, LinkError, LinkStatus, SceneModel, Snapshot};
pub use upload::MAX_UPLOAD_CELLS;

/// Begins the command in the reason of [`LinkStatus::Absent`], which a program that can start a core leaves out.
pub const START_IT: &str = "Start it in another terminal";

/// Longest pause of the heartbeat.
const SILENT_AFTER: Duration = Duration::from_millis(100);
/// Longest pause without the board, when the only heartbeat is the announcement once a second.
const SILENT_AFTER_WITHOUT_BOARD: Duration = Duration::from_millis(1500);
const ABSENT_AFTER: Duration = Duration::from_secs(2);
/// Lifetime of the class list; a relay sends it five times a second.
const CLASS_STAYS: Duration = Duration::from_secs(2);
/// Shortest interval at which a window converts pictures of the tissue: converting costs more than receiving.
const SNAPSHOTS_EVERY: Duration = Duration::from_millis(12);
const ANSWERS_KEPT: usize = 256;
const REHEARSALS_KEPT: usize = 8;
/// Number of a command that needs no answer.
const UNANSWERED: u64 = 0;

/// One host's connection to the core of one instance.
///
/// A separate thread receives, however slow the host is; data that the host does not take in time is dropped, oldest
/// first, and shows as gaps in the numbers of ticks and events.
pub struct Link {
    receiver: Receiver,
    /// Present for a recording that replaces a core.
    playback: Option<Playback>,
    is_here: bool,
    instance: Instance,
    host_id: u64,
    next_command_id: u64,
    pulse: Pulse,
    run: Run,
    answers: BTreeMap<u64, Answer>,
    rehearsals: BTreeMap<u64, Box<Rehearsal>>,
    records: VecDeque<TickRecord>,
    second_records: VecDeque<SecondRecord>,
    invalid_dropped: u64,
    motions: Motions,
}

/// Returns a random id: two hosts must not take each other's answers.
fn random_host_id() -> u64 {
    use std::hash::{BuildHasher, Hasher};
    let mut hasher = std::collections::hash_map::RandomState::new().build_hasher();
    // A page has no number.
    let process = if cfg!(target_family = "wasm") {
        0
    } else {
        std::process::id()
    };
    hasher.write_u32(process);
    hasher.finish()
}

impl Link {
    /// Never fails and never blocks: a thread connects, and reconnects as needed.
    pub fn new(instance: Instance) -> Self {
        Self::with_snapshots_every(instance, SNAPSHOTS_EVERY)
    }

    /// Connects to a core in this process, which `make` makes where it runs: on a thread, or in a page in each
    /// [`Link::poll`].
    pub fn here<C: LocalCore, E: Display>(
        instance: Instance,
        make: impl FnOnce() -> Result<C, E> + Send + 'static,
    ) -> Self {
        let host_id = random_host_id();
        Self {
            is_here: true,
            ..Self::of(instance, host_id, Receiver::here(host_id, make), None)
        }
    }

    /// Returns whether the core is in this process, stepped without loops whose timing could be measured.
    pub fn is_here(&self) -> bool {
        self.is_here
    }

    /// Plays a recording as if from a core; every request is refused.
    pub fn playing(instance: Instance, played: Arc<Played>) -> Self {
        let playback = Playback::of(&played);
        let receiver = Receiver::play(played, playback.clone());
        Self::of(instance, random_host_id(), receiver, Some(playback))
    }

    /// Returns the recording that replaces a core.
    pub fn playback(&self) -> Option<&Playback> {
        self.playback.as_ref()
    }

    /// Limits the rate at which pictures of the tissue are taken, unless it is zero; everything else is taken as it
    /// arrives.
    pub fn with_snapshots_every(instance: Instance, every: Duration) -> Self {
        let host_id = random_host_id();
        let receiver = Receiver::start(instance.clone(), host_id, every);
        Self::of(instance, host_id, receiver, None)
    }

    fn of(instance: Instance, host_id: u64, receiver: Receiver, playback: Option<Playback>) -> Self {
        Self {
            receiver,
            playback,
            is_here: false,
            instance,
            host_id,
            next_command_id: 1,
            pulse: Pulse::default(),
            run: Run::default(),
            answers: BTreeMap::new(),
            rehearsals: BTreeMap::new(),
            records: VecDeque::new(),
            second_records: VecDeque::new(),
            invalid_dropped: 0,
            motions: Motions::default(),
        }
    }

    /// Takes everything received since the last call. Never waits. Call it each frame: the motions of this host stop
    /// when it stops polling.
    pub fn poll(&mut self) {
        let inbox = self.receiver.take();
        self.take(inbox);
        if let Some(valid_s) = self.motions.polled(Instant::now()) {
            self.promise(valid_s);
        }
    }

    /// Returns the longest pause between recent calls of [`Link::poll`].
    pub fn longest_pause(&self) -> Duration {
        self.motions.longest_pause()
    }

    fn promise(&self, valid_s: f64) {
        let until = Instant::now() + Duration::from_secs_f64(valid_s);
        let _sent = self.receiver.send(Outgoing::Promise(until));
    }

    /// Instance of this link.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Time at which the heartbeat of the core last moved; `None` if it never did.
    pub fn heard(&self) -> Option<Instant> {
        self.pulse.moved
    }

    /// Status of the core.
    pub fn status(&self) -> LinkStatus {
        let Some(moved) = self.pulse.moved else {
            return LinkStatus::Absent { why: self.why_absent() };
        };
        let looked = self.pulse.looked.unwrap_or(moved);
        let since = looked.saturating_duration_since(moved);
        let patience = if self.pulse.has_board {
            SILENT_AFTER
        } else {
            SILENT_AFTER_WITHOUT_BOARD
        };
        if since > ABSENT_AFTER {
            LinkStatus::Absent { why: self.why_absent() }
        } else if since > patience {
            LinkStatus::Silent { since }
        } else {
            LinkStatus::Live
        }
    }

    fn why_absent(&self) -> String {
        if let Some(trouble) = &self.pulse.trouble {
            return trouble.clone();
        }
        let name = self.instance.name();
        let flag = if self.instance == Instance::default() {
            String::new()
        } else {
            format!(" --instance {name}")
        };
        let what = if self.run.session.is_some() {
            "rt-core has stopped"
        } else {
            "no rt-core is running"
        };
        format!("{what} (instance \"{name}\"). {START_IT}: rt-core{flag}")
    }

    /// Present run of the core.
    pub fn session(&self) -> Option<&Session> {
        self.run.session.as_ref()
    }

    /// Last valid state.
    pub fn state(&self) -> Option<&HapticState> {
        self.run.state.as_ref()
    }

    /// Last valid state of the second device; `None` in a run without one.
    pub fn second_state(&self) -> Option<&SecondState> {
        self.run.second_state.as_ref()
    }

    /// Returns every record of the second device since the last call.
    pub fn take_second_records(&mut self) -> Vec<SecondRecord> {
        std::mem::take(&mut self.second_records).into()
    }

    /// The running scene.
    pub fn scene(&self) -> Option<&Arc<SceneModel>> {
        self.run.scene.as_ref()
    }

    /// Last snapshot of the running scene.
    pub fn snapshot(&self) -> Option<&Snapshot> {
        let scene = self.run.scene.as_ref()?;
        let snapshot = self.run.snapshot.as_deref();
        snapshot.filter(|s| s.header.scene_id() == scene.header.id())
    }

    /// The parameters in force.
    pub fn parameters(&self) -> Option<&ParametersInForce> {
        self.run.parameters.as_ref()
    }

    /// The plan in force.
    pub fn plan(&self) -> Option<&PlanInForce> {
        self.run.plan.as_ref()
    }

    /// Connection to a core on another machine.
    pub fn relayed(&self) -> Option<&Relayed> {
        self.run.relayed.as_ref()
    }

    /// Members connected through a relay of this machine, while it reports them.
    pub fn class(&self) -> Option<&Class> {
        let (came, class) = self.run.class.as_ref()?;
        (came.elapsed() < CLASS_STAYS).then_some(&**class)
    }

    /// Asks this machine's relay for the needle, or to hand it over. [`Link::class`] shows the result.
    pub fn lease(&mut self, request: &LeaseRequest) -> Result<(), LinkError> {
        let id = self.next_id()?;
        self.ask(id, Outgoing::Lease(request.encode())).map(|_| ())
    }

    /// Returns every record since the last call. Ticks whose record this host missed show as gaps in the numbers.
    pub fn take_records(&mut self) -> Vec<TickRecord> {
        std::mem::take(&mut self.records).into()
    }

    /// Last 256 events of this run of the core.
    pub fn events(&self) -> &VecDeque<Event> {
        &self.run.events
    }

    /// Number of events of this run that happened while this host was connected but did not reach it.
    pub fn events_unseen(&self) -> u64 {
        self.run.events_unseen
    }

    /// Returns the core's answer; once for each command.
    pub fn reply(&mut self, command_id: u64) -> Option<Answer> {
        self.answers.remove(&command_id)
    }

    /// Returns the result of a [`Request::Rehearse`], once its reply says that it was carried out.
    pub fn rehearsal(&mut self, command_id: u64) -> Option<Box<Rehearsal>> {
        self.rehearsals.remove(&command_id)
    }

    /// Number of invalid messages dropped from shared memory.
    pub fn invalid_dropped(&self) -> u64 {
        self.invalid_dropped
    }

    fn take(&mut self, inbox: Inbox) {
        if self.run.id() != inbox.run.id() {
            self.motions.forget();
            self.answers.clear();
            self.rehearsals.clear();
            self.records.clear();
            self.second_records.clear();
        }
        (self.pulse, self.run, self.invalid_dropped) = (inbox.pulse, inbox.run, inbox.invalid_dropped);
        for rehearsal in inbox.rehearsals {
            self.rehearsals.insert(rehearsal.command_id, rehearsal);
            if self.rehearsals.len() > REHEARSALS_KEPT {
                self.rehearsals.pop_first();
            }
        }
        for (command_id, answer) in inbox.answers.into_iter().filter(|(id, _)| *id != UNANSWERED) {
            self.motions.answered(command_id, &answer);
            self.answers.insert(command_id, answer);
            if self.answers.len() > ANSWERS_KEPT {
                self.answers.pop_first();
            }
        }
        self.run.events.iter().for_each(|event| self.motions.take(event));
        let is_moving = |tick: u64, flags: u32| (tick, flags & flags::IN_MOTION != 0);
        self.motions.seen([
            self.run.state.map(|s| is_moving(s.tick, s.flags)),
            self.run.second_state.map(|s| is_moving(s.tick, s.flags)),
        ]);
        join(&mut self.records, inbox.records);
        join(&mut self.second_records, inbox.second_records);
    }

    /// Sends a request and returns its command id; its [`Answer`] comes later.
    pub fn send(&mut self, request: &Request) -> Result<u64, LinkError> {
        let id = self.next_id()?;
        let command = request.encode(self.host_id, id)?;
        let id = self.ask(id, Outgoing::Command(Box::new(command)))?;
        let now = Instant::now();
        if self.motions.sent(request, id, now) {
            let valid_s = self.motions.renew(now);
            self.promise(valid_s);
        }
        Ok(id)
    }

    /// Queues a message; one that cannot be sent later is refused by an [`Answer`].
    fn ask(&self, id: u64, outgoing: Outgoing) -> Result<u64, LinkError> {
        match self.receiver.send(outgoing) {
            true => Ok(id),
            false => Err(LinkError::Busy),
        }
    }

    fn next_id(&mut self) -> Result<u64, LinkError> {
        if self.playback.is_some() {
            return Err(LinkError::Playback);
        }
        // A host that did not poll for seconds must not conclude that the core has stopped.
        self.pulse = self.receiver.pulse();
        if let LinkStatus::Absent { why } = self.status() {
            return Err(LinkError::Absent(why));
        }
        let id = self.next_command_id;
        self.next_command_id += 1;
        Ok(id)
    }
}

#[cfg(test)]
mod tests;

/// Appends records in bounded memory, in case a host never takes them.
fn join<T>(held: &mut VecDeque<T>, new: VecDeque<T>) {
    held.extend(new);
    let beyond = held.len().saturating_sub(RECORDS_KEPT);
    held.drain(..beyond);
}
