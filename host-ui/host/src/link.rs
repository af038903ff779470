//! The only place of the host that uses shared memory: receives what the core publishes, checked, and sends requests.

mod ports;
mod receive;

use ports::{Board, Ports, UploadPort};
use receive::Latest;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_anatomy::Role;
use stylet_files::{LabelVolume, Tissue};
use stylet_shm_schema::service::{Instance, MAX_HOSTS};
use stylet_shm_schema::*;

/// The heartbeat may rest this long.
const SILENT_AFTER: Duration = Duration::from_millis(100);
/// Without the board, the only heartbeat is the announcement once a second.
const SILENT_AFTER_WITHOUT_BOARD: Duration = Duration::from_millis(1500);
const ABSENT_AFTER: Duration = Duration::from_secs(2);
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// A new core may have swept the folder of the ports that this host holds.
const RECONNECT_EVERY: Duration = Duration::from_secs(4);
const CONNECT_EVERY: Duration = Duration::from_secs(1);
const OPEN_BOARD_EVERY: Duration = Duration::from_millis(20);
const EVENTS_KEPT: usize = 256;
const ANSWERS_KEPT: usize = 256;
const REHEARSALS_KEPT: usize = 8;
const RECORDS_KEPT: usize = 300_000;
/// Largest volume that the core accepts, in cells.
pub const MAX_UPLOAD_CELLS: usize = 64 << 20;

/// Whether the core runs.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkStatus {
    /// No core has announced itself, or it has been silent for long; `why` says what to do.
    Absent {
        /// What to do.
        why: String,
    },
    /// The heartbeat moves.
    Live,
    /// The heartbeat has not moved.
    Silent {
        /// For how long.
        since: Duration,
    },
}

/// The rest surface of the scene that runs.
#[derive(Clone, Debug)]
pub struct SceneModel {
    /// Counts, boxes, structures.
    pub header: SceneHeader,
    /// Vertices at rest, m.
    pub rest_m: Vec<[f32; 3]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// One for each cell of `header.labels`: 0 outside, else one more than the place among the header's structures.
    pub labels: Vec<u8>,
}

impl SceneModel {
    /// From what the core sends; nothing where it does not hold together.
    pub fn of_words(header: &SceneHeader, words: &[u32]) -> Option<Self> {
        check::scene(header, words).ok()?;
        let (positions, rest) = words.split_at(3 * header.vertex_count as usize);
        let (indices, cells) = rest.split_at(3 * header.triangle_count as usize);
        let mut labels: Vec<u8> = cells.iter().flat_map(|word| word.to_le_bytes()).collect();
        labels.truncate(header.labels.node_count().unwrap_or(0));
        let place = |w: &[u32]| [0, 1, 2].map(|a| f32::from_bits(w[a]));
        Some(Self {
            header: *header,
            rest_m: positions.chunks_exact(3).map(place).collect(),
            triangles: indices.chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect(),
            labels,
        })
    }
}

/// The deformed body of one tissue tick.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Tick, needle, seeds.
    pub header: SnapshotHeader,
    /// Vertices of the surface, m.
    pub positions_m: Vec<[f32; 3]>,
    /// Displacement from rest at each node of the scene's grid.
    pub displacements_m: Vec<[f32; 3]>,
}

/// What the core said to a command or an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Whether it was carried out.
    pub accepted: bool,
    /// For people.
    pub text: String,
    /// For programs; empty when accepted.
    pub reasons: Vec<Reason>,
    /// First tick of the force loop that ran with the change.
    pub effective_tick: u64,
}

impl From<Refusal> for Answer {
    fn from(refusal: Refusal) -> Self {
        Self {
            accepted: false,
            text: refusal.text,
            reasons: refusal.reasons,
            effective_tick: 0,
        }
    }
}

impl Answer {
    /// Whether it was refused for this reason.
    pub fn is_refused_for(&self, code: RefusalCode) -> bool {
        self.reasons.iter().any(|reason| reason.code() == Some(code))
    }
}

/// Why something could not be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct LinkError(pub String);

/// One host's connection to the core of one instance.
pub struct Link {
    // Dropped in this order: handles before the ports, and those before their node.
    board: Option<Board>,
    upload_port: Option<UploadPort>,
    ports: Option<Ports>,
    instance: Instance,
    trouble: Option<String>,
    host_id: u64,
    next_command_id: u64,
    connect_tried: Option<Instant>,
    board_tried: Option<Instant>,
    cleaned: Instant,
    beat: Option<(u64, u64)>,
    beat_moved: Option<Instant>,
    latest: Latest,
    state: Option<HapticState>,
    answers: BTreeMap<u64, Answer>,
    rehearsals: BTreeMap<u64, Box<Rehearsal>>,
    records: Vec<TickRecord>,
    invalid_dropped: u64,
}

/// Two hosts must not take each other's answers.
fn random_host_id() -> u64 {
    use std::hash::{BuildHasher, Hasher};
    let mut hasher = std::collections::hash_map::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    hasher.finish()
}

impl Link {
    /// Never fails and never blocks: [`Link::poll`] connects.
    pub fn new(instance: Instance) -> Self {
        Self {
            board: None,
            upload_port: None,
            ports: None,
            instance,
            trouble: None,
            host_id: random_host_id(),
            next_command_id: 1,
            connect_tried: None,
            board_tried: None,
            cleaned: Instant::now(),
            beat: None,
            beat_moved: None,
            latest: Latest::default(),
            state: None,
            answers: BTreeMap::new(),
            rehearsals: BTreeMap::new(),
            records: Vec::new(),
            invalid_dropped: 0,
        }
    }

    /// Takes everything that is new. Call it each frame.
    pub fn poll(&mut self) {
        self.connect();
        if self.ports.is_none() {
            return;
        }
        self.receive();
        self.read_board();
        self.feel_pulse();
        self.tidy();
    }

    /// The instance that this link is for.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Whether the core runs.
    pub fn status(&self) -> LinkStatus {
        let Some(moved) = self.beat_moved else {
            return LinkStatus::Absent { why: self.why_absent() };
        };
        let since = moved.elapsed();
        let patience = if self.board.is_some() {
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
        if let Some(trouble) = &self.trouble {
            return trouble.clone();
        }
        let name = self.instance.name();
        let flag = if self.instance == Instance::default() {
            String::new()
        } else {
            format!(" --instance {name}")
        };
        let what = if self.latest.session.is_some() {
            "rt-core has stopped"
        } else {
            "no rt-core is running"
        };
        format!("{what} (instance \"{name}\"). Start it in another terminal: rt-core{flag}")
    }

    /// The present run of the core.
    pub fn session(&self) -> Option<&Session> {
        self.latest.session.as_ref()
    }

    /// The last valid one.
    pub fn state(&self) -> Option<&HapticState> {
        self.state.as_ref()
    }

    /// The scene that runs.
    pub fn scene(&self) -> Option<&Arc<SceneModel>> {
        self.latest.scene.get()
    }

    /// The last one that belongs to the scene.
    pub fn snapshot(&self) -> Option<&Snapshot> {
        let scene = self.latest.scene.get()?;
        self.latest
            .snapshot
            .get()
            .filter(|s| s.header.scene_id() == scene.header.id())
    }

    /// The parameters in force.
    pub fn parameters(&self) -> Option<&ParametersInForce> {
        self.latest.parameters.get()
    }

    /// The plan in force.
    pub fn plan(&self) -> Option<&PlanInForce> {
        self.latest.plan.get()
    }

    /// Every record since the last call.
    pub fn take_records(&mut self) -> Vec<TickRecord> {
        std::mem::take(&mut self.records)
    }

    /// The last 256 of this run of the core.
    pub fn events(&self) -> &VecDeque<Event> {
        &self.latest.events
    }

    /// What the core said; once for each command.
    pub fn reply(&mut self, command_id: u64) -> Option<Answer> {
        self.answers.remove(&command_id)
    }

    /// What a [`Request::Rehearse`] came to, once its reply says that it was carried out.
    pub fn rehearsal(&mut self, command_id: u64) -> Option<Box<Rehearsal>> {
        self.rehearsals.remove(&command_id)
    }

    /// Invalid messages from shared memory that were dropped.
    pub fn invalid_dropped(&self) -> u64 {
        self.invalid_dropped
    }

    /// The id of the command; its [`Answer`] comes later.
    pub fn send(&mut self, request: &Request) -> Result<u64, LinkError> {
        let id = self.next_id()?;
        let command = request.encode(self.host_id, id);
        let command = command.map_err(|errors| LinkError(errors.to_string()))?;
        let Some(ports) = &self.ports else {
            return Err(LinkError(self.why_absent()));
        };
        match ports.commands.send_copy(command) {
            Ok(0) => Err(LinkError(
                "the core did not accept the command: its queue is full or it has just ended".to_owned(),
            )),
            Ok(_) => Ok(id),
            Err(e) => Err(LinkError(format!("the command could not be sent: {e:?}"))),
        }
    }

    /// A segmented volume for the core to run instead of the present scene.
    pub fn upload(&mut self, volume: &LabelVolume) -> Result<u64, LinkError> {
        let expected: usize = volume.dims.iter().product();
        if volume.cells.len() != expected || !(1..=MAX_UPLOAD_CELLS).contains(&expected) {
            return Err(LinkError(format!(
                "the volume has {} cells; it must have {expected} for its size, and 1 to {MAX_UPLOAD_CELLS} can be sent",
                volume.cells.len()
            )));
        }
        let id = self.next_id()?;
        let mut header = UploadHeader {
            host_id: self.host_id,
            command_id: id,
            dims: volume.dims.map(|d| d as u32),
            spacing_m: volume.spacing_m,
            patient_from_scene: volume.patient.to_wire(),
            name: Text::new(&volume.name),
            structure_count: volume.structures.len().min(MAX_STRUCTURES) as u32,
            ..UploadHeader::default()
        };
        for (sent, tissue) in header.structures.iter_mut().zip(&volume.structures) {
            *sent = upload_structure(tissue);
        }
        self.upload_port = None;
        let Some(ports) = &self.ports else {
            return Err(LinkError(self.why_absent()));
        };
        let port = ports.upload_port(expected).map_err(|e| LinkError(e.0))?;
        let mut sample = port
            .loan_slice_uninit(expected)
            .map_err(|e| LinkError(format!("no room in shared memory for {expected} cells: {e:?}")))?;
        *sample.user_header_mut() = header;
        let taken = sample.write_from_slice(&volume.cells).send();
        // The core still has to map the port's memory.
        self.upload_port = Some(port);
        match taken {
            Ok(0) => Err(LinkError(format!(
                "the core did not accept the volume; at most {MAX_HOSTS} hosts can be connected"
            ))),
            Ok(_) => Ok(id),
            Err(e) => Err(LinkError(format!("the volume could not be sent: {e:?}"))),
        }
    }

    fn next_id(&mut self) -> Result<u64, LinkError> {
        if let LinkStatus::Absent { why } = self.status() {
            return Err(LinkError(why));
        }
        let id = self.next_command_id;
        self.next_command_id += 1;
        Ok(id)
    }

    fn connect(&mut self) {
        let now = Instant::now();
        let long_ago = |then: Option<Instant>, every| then.is_none_or(|t: Instant| now - t >= every);
        let deaf = self.beat_moved.is_none_or(|t| now - t > ABSENT_AFTER);
        if self.ports.is_some() && deaf && long_ago(self.connect_tried, RECONNECT_EVERY) {
            (self.board, self.upload_port, self.ports) = (None, None, None);
        }
        if self.ports.is_some() || !long_ago(self.connect_tried, CONNECT_EVERY) {
            return;
        }
        self.connect_tried = Some(now);
        match Ports::new(&self.instance) {
            Ok(ports) => (self.ports, self.trouble) = (Some(ports), None),
            Err(e) => self.trouble = Some(e.0),
        }
    }

    fn read_board(&mut self) {
        let (Some(ports), Some(session)) = (&self.ports, &self.latest.session) else {
            return;
        };
        if self.board.is_none() && self.board_tried.is_none_or(|t| t.elapsed() >= OPEN_BOARD_EVERY) {
            self.board_tried = Some(Instant::now());
            self.board = Board::open(&ports.node, session.session_id).ok();
        }
        let Some(board) = &self.board else { return };
        let state = board.read();
        match check::state(&state) {
            Ok(()) => self.state = Some(state),
            Err(_) => self.invalid_dropped += 1,
        }
    }

    fn feel_pulse(&mut self) {
        let Some(session) = &self.latest.session else { return };
        let beat = (session.time_ns, self.state.map_or(0, |s| s.tick));
        if self.beat != Some(beat) {
            self.beat = Some(beat);
            self.beat_moved = Some(Instant::now());
        }
    }

    /// Removes what a dead core left: nobody else does it in the background.
    fn tidy(&mut self) {
        let silent = match self.status() {
            LinkStatus::Live => return,
            LinkStatus::Silent { since } => since,
            LinkStatus::Absent { .. } => {
                self.board = None;
                self.upload_port = None;
                ABSENT_AFTER
            }
        };
        if silent > Duration::from_millis(300) && self.cleaned.elapsed() >= CLEAN_EVERY {
            self.cleaned = Instant::now();
            if let Some(ports) = &self.ports {
                let _removed = ports.node.try_cleanup_dead_nodes();
            }
        }
    }

    /// Everything of an earlier run goes before anything of the new one is opened.
    fn begin_session(&mut self, session: Session) {
        self.board = None;
        self.board_tried = None;
        self.state = None;
        self.answers.clear();
        self.rehearsals.clear();
        self.records.clear();
        self.latest.begin(session);
    }

    fn take_rehearsal(&mut self, rehearsal: Rehearsal) {
        let current = self.session().is_some_and(|s| s.session_id == rehearsal.session_id);
        if rehearsal.host_id != self.host_id || !current {
            return;
        }
        self.rehearsals.insert(rehearsal.command_id, Box::new(rehearsal));
        if self.rehearsals.len() > REHEARSALS_KEPT {
            self.rehearsals.pop_first();
        }
    }

    fn take_reply(&mut self, reply: &Reply) {
        let current = self.session().is_some_and(|s| s.session_id == reply.session_id);
        if reply.host_id != self.host_id || !current {
            return;
        }
        let Some(status) = ReplyStatus::from_number(reply.status) else {
            self.invalid_dropped += 1;
            return;
        };
        let answer = Answer {
            accepted: status == ReplyStatus::Accepted,
            text: reply.text.read(),
            reasons: reply.reasons().to_vec(),
            effective_tick: reply.effective_tick,
        };
        self.answers.insert(reply.command_id, answer);
        if self.answers.len() > ANSWERS_KEPT {
            self.answers.pop_first();
        }
    }
}

#[cfg(test)]
mod tests;

fn upload_structure(tissue: &Tissue) -> UploadStructure {
    let role = match tissue.role {
        Role::Target => role::TARGET,
        Role::Spare => role::SPARE,
        Role::Tissue => 0,
    };
    UploadStructure {
        label: u32::from(tissue.label),
        role: role | if tissue.material.fixed { role::FIXED } else { 0 },
        own_limits: u32::from(tissue.material.limits.is_some()),
        surroundings: tissue.material.surroundings.to_wire(),
        young_pa: tissue.material.young_pa,
        poisson: tissue.material.poisson,
        limits: tissue.material.limits.unwrap_or_default(),
        name: Text::new(&tissue.name),
    }
}
