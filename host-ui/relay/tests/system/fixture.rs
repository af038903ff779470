//! A core, a lab, and the two sides of the relay, each ended when it is dropped.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use stylet_relay::keys::{Invitation, Lab, Role, Validity, write_invitation};
use stylet_relay::ports::Near;
use stylet_ports::{self as service, Node, SliceSubscriber, StateReader};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{HapticState, PlanInForce, Reply, ReplyStatus, Request, SceneHeader, Session, TickRecord};
pub use stylet_test_kit::{program, until};

/// A number that no other test of this process has.
fn fresh() -> u32 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// A name that no other test uses; its files go when it is dropped, so it is declared before what uses it.
pub struct Named(pub Instance);

impl Named {
    pub fn new() -> Self {
        Self(Instance::new(&format!("r{}-{}", std::process::id(), fresh())).expect("letters, digits and a hyphen"))
    }
}

impl Drop for Named {
    fn drop(&mut self) {
        until(Duration::from_secs(2), || {
            self.0.sweep();
            !self.0.folder().exists()
        });
    }
}

/// A folder for one test's files, emptied first.
pub fn scratch(name: &str) -> PathBuf {
    stylet_test_kit::scratch(&format!("relay-{name}-{}", fresh()))
}

/// A process of ours, with what it prints in a file.
pub struct Running {
    pub child: Child,
    log: PathBuf,
}

impl Running {
    pub fn start(command: &mut Command, log: PathBuf) -> Self {
        let out = File::create(&log).expect("the log can be written");
        let err = out.try_clone().expect("a second handle");
        // SAFETY: between fork and exec it only makes a system call.
        unsafe { command.pre_exec(end_with_the_test) };
        let child = command
            .stdin(Stdio::null())
            .stdout(out)
            .stderr(err)
            .spawn()
            .expect("the program starts");
        Self { child, log }
    }

    pub fn signal(&self, signal: i32) {
        // SAFETY: a signal to a child that was not waited for yet.
        unsafe { libc::kill(self.child.id() as libc::pid_t, signal) };
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    pub fn says(&self, words: &str, limit: Duration) -> bool {
        until(limit, || self.log().contains(words))
    }
}

/// A test that is killed cannot end what it started.
fn end_with_the_test() -> std::io::Result<()> {
    // SAFETY: a system call with plain arguments.
    match unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.signal(libc::SIGCONT);
        self.signal(libc::SIGTERM);
        let ended = until(Duration::from_secs(5), || matches!(self.child.try_wait(), Ok(Some(_))));
        if !ended {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The core of an instance.
pub fn core(named: &Named, options: &[&str]) -> Running {
    let folder = scratch("core");
    let mut command = Command::new(program("rt-core"));
    command
        .args([
            "--instance",
            named.0.name(),
            "--exit-with-parent",
            "--rt-if-allowed",
            "--flight-dir",
        ])
        .arg(folder.join("flights"))
        .args(options);
    Running::start(&mut command, folder.join("log"))
}

/// A lab's keys, and a port of this machine that is free.
pub struct Keys {
    pub folder: PathBuf,
    pub lab: Lab,
    pub port: u16,
}

impl Keys {
    pub fn new() -> Self {
        Self::reached_at(&["127.0.0.1".to_owned()])
    }

    /// Of a machine with these addresses.
    pub fn reached_at(hosts: &[String]) -> Self {
        let folder = scratch("lab");
        let lab = Lab::new(&folder);
        lab.make(hosts).expect("keys");
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let port = socket.local_addr().expect("bound").port();
        Self { folder, lab, port }
    }

    pub fn invite(&self, name: &str, role: Role, validity: Validity) -> PathBuf {
        self.invite_to(name, role, validity, "127.0.0.1")
    }

    pub fn invite_to(&self, name: &str, role: Role, validity: Validity, host: &str) -> PathBuf {
        let server = format!("{host}:{}", self.port);
        let invitation = self.lab.invite(name, role, &server, validity).expect("invited");
        let path = self.folder.join(format!("{name}.invitation"));
        write_invitation(&path, &invitation).expect("written");
        path
    }

    pub fn serve(&self, named: &Named) -> Running {
        self.serve_on(named, "127.0.0.1")
    }

    pub fn serve_on(&self, named: &Named, host: &str) -> Running {
        let mut command = Command::new(env!("CARGO_BIN_EXE_relay"));
        command
            .args([
                "serve",
                "--instance",
                named.0.name(),
                "--listen",
                &format!("{host}:{}", self.port),
                "--keys",
            ])
            .arg(&self.folder);
        let served = Running::start(&mut command, scratch("serve").join("log"));
        assert!(
            served.says("serving instance", Duration::from_secs(10)),
            "{}",
            served.log()
        );
        served
    }
}

pub fn join(invitation: &Path, named: &Named) -> Running {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relay"));
    command
        .args(["join", "--instance", named.0.name(), "--invitation"])
        .arg(invitation);
    Running::start(&mut command, scratch("join").join("log"))
}

/// What `relay lease` prints.
pub fn lease(named: &Named, words: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_relay"))
        .arg("lease")
        .args(words)
        .args(["--instance", named.0.name()])
        .output()
        .expect("the relay runs");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Reads an invitation again.
pub fn invitation(path: &Path) -> Invitation {
    Invitation::read(path).expect("an invitation")
}

/// A host of the smallest kind: it asks, and takes what the core says.
pub struct Host {
    board: Option<StateReader>,
    near: Near,
    records: SliceSubscriber<TickRecord, u64>,
    _node: Node,
    pub session: Option<Session>,
    pub scene: Option<SceneHeader>,
    pub plan: Option<PlanInForce>,
    pub taken: Vec<TickRecord>,
    replies: Vec<Reply>,
    id: u64,
    next: u64,
}

impl Host {
    pub fn new(named: &Named) -> Self {
        let node = Node::join(&named.0).expect("shared memory");
        let records = service::records::subscriber(&node).expect("a port");
        // While another program makes a service it cannot be opened; on a busy machine that takes longer than an attempt does.
        let mut near = Node::join(&named.0).and_then(Near::new);
        until(Duration::from_secs(5), || {
            if near.is_err() {
                near = Node::join(&named.0).and_then(Near::new);
            }
            near.is_ok()
        });
        Self {
            board: None,
            near: near.expect("ports"),
            records,
            _node: node,
            session: None,
            scene: None,
            plan: None,
            taken: Vec::new(),
            replies: Vec::new(),
            id: 1000 + u64::from(fresh()),
            next: 1,
        }
    }

    pub fn poll(&mut self) {
        while let Some(sample) = self.near.session.receive() {
            let session = sample;
            if self.session.is_none_or(|s| s.session_id != session.session_id) {
                self.board = None;
            }
            self.session = Some(session);
        }
        while let Some(sample) = self.records.receive() {
            self.taken.extend_from_slice(sample.values());
        }
        while let Some(sample) = self.near.scene.receive() {
            self.scene = Some(*sample.header());
        }
        while let Some(sample) = self.near.plan.receive() {
            self.plan = Some(sample);
        }
        while let Some(sample) = self.near.replies.receive() {
            self.replies.push(sample);
        }
        if let (None, Some(session)) = (&self.board, &self.session) {
            self.board = StateReader::open(&self.near.node, session.session_id).ok();
        }
    }

    pub fn state(&mut self) -> Option<HapticState> {
        self.poll();
        self.board.as_ref().map(StateReader::read)
    }

    /// Waits until the core is seen with its scene.
    pub fn sees_the_core(&mut self, limit: Duration) -> bool {
        until(limit, || self.sees_it_now())
    }

    pub fn sees_it_now(&mut self) -> bool {
        self.state().is_some_and(|s| s.tick > 0) && self.scene.is_some()
    }

    pub fn send(&mut self, request: &Request) -> u64 {
        let id = self.next;
        self.next += 1;
        let command = request.encode(self.id, id).expect("fits");
        self.near.ask(command).expect("sent");
        id
    }

    /// The words of the refusal where it was refused.
    pub fn ask(&mut self, request: &Request) -> Result<(), String> {
        let id = self.send(request);
        let mut answer = None;
        until(Duration::from_secs(5), || {
            self.poll();
            answer = self
                .replies
                .iter()
                .find(|r| (r.host_id, r.command_id) == (self.id, id))
                .copied();
            answer.is_some()
        });
        let answer = answer.ok_or("no answer")?;
        match answer.status == ReplyStatus::Accepted as u32 {
            true => Ok(()),
            false => Err(answer.text.read()),
        }
    }
}

/// Where the hand rests before an insertion into the built-in scene, 20 mm before the tissue, and 60 mm on along z.
pub fn way(scene: &SceneHeader, depth_m: f64) -> [f64; 3] {
    let middle = |a: usize| 0.5 * (scene.lower_m[a] + scene.upper_m[a]);
    [middle(0), middle(1), scene.lower_m[2] - 0.02 + depth_m]
}

/// The hand to a place on that way.
pub fn go(scene: &SceneHeader, depth_m: f64, speed_m_per_s: f64) -> Request {
    Request::MoveHand(stylet_shm_schema::HandMove {
        tip_m: way(scene, depth_m),
        direction: [0.0, 0.0, 1.0],
        speed_m_per_s,
        acceleration_m_per_s2: 2.0,
    })
}

/// How far the hand still goes: its way in 150 ms.
pub fn still_moving_m(host: &mut Host) -> f64 {
    let place = |host: &mut Host| host.state().map_or([0.0; 3], |s| s.tip_in_scene_m);
    let before = place(host);
    std::thread::sleep(Duration::from_millis(150));
    let after = place(host);
    (0..3).map(|a| (after[a] - before[a]).powi(2)).sum::<f64>().sqrt()
}
