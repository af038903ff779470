//! A test host: it sees and requests the same as a window, and renews its motions.

use crate::fixture::{Named, fresh, until};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_ports::{self as service, Node, SliceSubscriber, StateReader};
use stylet_relay::ports::Near;
use stylet_shm_schema::{
    Command, HapticState, Instance, PlanInForce, Reply, ReplyStatus, Request, SceneHeader, Session, TickRecord,
};

/// Returns a node of an instance, once a core or a relay has made it.
pub fn node(named: &Named) -> Node {
    let mut node = Node::join(&named.0);
    until(Duration::from_secs(20), || {
        if node.is_err() {
            node = Node::join(&named.0);
        }
        node.is_ok()
    });
    node.expect("a core or a relay")
}

/// The ports of a host in one epoch of its instance.
struct Ports {
    board: Option<StateReader>,
    near: Near,
    records: SliceSubscriber<TickRecord, u64>,
}

impl Ports {
    fn new(node: Node) -> Option<Self> {
        Some(Self {
            board: None,
            records: service::records::subscriber(&node).ok()?,
            near: Near::new(node).ok()?,
        })
    }
}

/// A minimal host: it sends requests and receives the core's data.
pub struct Host {
    instance: Instance,
    ports: Option<Ports>,
    pub session: Option<Session>,
    pub scene: Option<SceneHeader>,
    pub plan: Option<PlanInForce>,
    pub taken: Vec<TickRecord>,
    replies: Vec<Reply>,
    id: u64,
    next: u64,
    /// Lives as long as the host, whose motions it renews.
    promises: Option<Promises>,
}

impl Host {
    /// Joins an instance whose core or relay may still be starting.
    pub fn new(named: &Named) -> Self {
        Self {
            instance: named.0.clone(),
            ports: None,
            session: None,
            scene: None,
            plan: None,
            taken: Vec::new(),
            replies: Vec::new(),
            id: 1000 + u64::from(fresh()),
            next: 1,
            promises: None,
        }
    }

    /// Drops the ports of a past epoch, and makes those of the present one.
    fn connect(&mut self) {
        if self.ports.as_ref().is_some_and(|ports| !ports.near.node.is_current()) {
            self.ports = None;
        }
        if self.ports.is_none() {
            let node = match self.session {
                Some(_) => Node::join_again(&self.instance),
                None => Node::join(&self.instance),
            };
            self.ports = node.ok().and_then(Ports::new);
        }
    }

    pub fn has_ports(&self) -> bool {
        self.ports.is_some()
    }

    pub fn poll(&mut self) {
        self.connect();
        let Some(ports) = &mut self.ports else { return };
        while let Some(session) = ports.near.session.receive() {
            if self.session.is_none_or(|s| s.session_id != session.session_id) {
                ports.board = None;
            }
            self.session = Some(session);
        }
        while let Some(sample) = ports.records.receive() {
            self.taken.extend_from_slice(sample.values());
        }
        while let Some(sample) = ports.near.scene.receive() {
            self.scene = Some(*sample.header());
        }
        while let Some(sample) = ports.near.plan.receive() {
            self.plan = Some(sample);
        }
        while let Some(sample) = ports.near.replies.receive() {
            self.replies.push(sample);
        }
        if let (None, Some(session)) = (&ports.board, &self.session) {
            ports.board = StateReader::open(&ports.near.node, session.session_id).ok();
        }
    }

    pub fn state(&mut self) -> Option<HapticState> {
        self.poll();
        let board = self.ports.as_ref().and_then(|ports| ports.board.as_ref());
        board.map(StateReader::read)
    }

    /// Waits until the core is visible with its scene.
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
        if matches!(request, Request::MoveHand(_)) && self.promises.is_none() {
            self.promises = Some(Promises::begin(&self.instance, self.id));
        }
        let mut sent = false;
        until(Duration::from_secs(5), || {
            self.connect();
            sent = self.ports.as_ref().is_some_and(|ports| ports.near.ask(command).is_ok());
            sent
        });
        assert!(sent, "no ports");
        id
    }

    /// Sends a request; returns the text of a refusal.
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

/// A thread that renews the motions of a host, as its window would with each frame.
struct Promises(Arc<AtomicBool>);

impl Promises {
    fn begin(instance: &Instance, host_id: u64) -> Self {
        let end = Arc::new(AtomicBool::new(false));
        let (instance, ends) = (instance.clone(), Arc::clone(&end));
        let promise = Request::KeepMoving { valid_s: 0.2 }.encode(host_id, 0).expect("fits");
        std::thread::spawn(move || promises(&instance, &promise, &ends));
        Self(end)
    }
}

impl Drop for Promises {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn promises(instance: &Instance, promise: &Command, end: &AtomicBool) {
    let mut ports = None;
    while !end.load(Ordering::Relaxed) {
        ports = ports.filter(|(_, node): &(_, Node)| node.is_current());
        if ports.is_none() {
            let made = Node::join(instance).and_then(|node| Ok((service::commands::publisher(&node)?, node)));
            ports = made.ok();
        }
        if let Some((port, _)) = &ports {
            port.connect();
            let _ = port.send(*promise);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns a point on a path along z: the hand starts 20 mm before the tissue of the built-in scene, and the path is 60
/// mm long.
pub fn way(scene: &SceneHeader, depth_m: f64) -> [f64; 3] {
    let middle = |a: usize| 0.5 * (scene.lower_m[a] + scene.upper_m[a]);
    [middle(0), middle(1), scene.lower_m[2] - 0.02 + depth_m]
}

/// Moves the hand to a point on that path.
pub fn go(scene: &SceneHeader, depth_m: f64, speed_m_per_s: f64) -> Request {
    Request::MoveHand(stylet_shm_schema::HandMove {
        tip_m: way(scene, depth_m),
        direction: [0.0, 0.0, 1.0],
        speed_m_per_s,
        acceleration_m_per_s2: 2.0,
    })
}

/// Travel of the hand in 150 ms.
pub fn still_moving_m(host: &mut Host) -> f64 {
    let place = |host: &mut Host| host.state().map_or([0.0; 3], |s| s.tip_in_scene_m);
    let before = place(host);
    std::thread::sleep(Duration::from_millis(150));
    let after = place(host);
    (0..3).map(|a| (after[a] - before[a]).powi(2)).sum::<f64>().sqrt()
}
