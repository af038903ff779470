//! The needle changes hands on the windows' requests through their ports, and every window shows its holder.

use crate::fixture::{Keys, Named, Running, core, join, until};
use crate::host::{Host, go, node, still_moving_m};
use std::time::Duration;
use stylet_ports::{self as service, Node, Publisher, Subscriber};
use stylet_relay::keys::{Role, Validity};
use stylet_shm_schema::{Class, LeaseOrder, LeaseRequest};

/// A host with a window's ports for the class and the lease.
struct Window {
    host: Host,
    class: Subscriber<Class>,
    orders: Publisher<LeaseOrder>,
    newest: Option<Class>,
    _node: Node,
}

impl Window {
    fn new(named: &Named) -> Self {
        let node = node(named);
        Self {
            host: Host::new(named),
            class: service::class::subscriber(&node).expect("a port"),
            orders: service::lease::publisher(&node).expect("a port"),
            newest: None,
            _node: node,
        }
    }

    fn ask(&self, request: &LeaseRequest) {
        self.orders.send(request.encode()).expect("sent");
    }

    fn is_shown(&mut self, what: impl Fn(&Class) -> bool) -> bool {
        until(Duration::from_secs(5), || {
            while let Some(class) = self.class.receive() {
                self.newest = Some(class);
            }
            self.newest.as_ref().is_some_and(&what)
        })
    }

    fn shows_operator(&mut self, name: &str) -> bool {
        self.is_shown(|class| class.operator.read() == name)
    }

    fn moves(&mut self, depth_m: f64) -> Result<(), String> {
        let scene = self.host.scene.expect("seen");
        self.host.ask(&go(&scene, depth_m, 0.005))
    }
}

/// A core, the window next to it, and two remote operators.
struct Room {
    local: Window,
    otto: Window,
    paula: Window,
    served: Running,
    _joined: [Running; 2],
    _keys: Keys,
    _core: Running,
    _named: [Named; 3],
}

impl Room {
    fn begin() -> Self {
        let named = [Named::new(), Named::new(), Named::new()];
        let core = core(&named[0], &[]);
        let keys = Keys::new();
        let served = keys.serve(&named[0]);
        let joined = [("otto", &named[1]), ("paula", &named[2])]
            .map(|(name, far)| join(&keys.invite(name, Role::Operator, Validity::days(1)), far));
        let mut room = Self {
            local: Window::new(&named[0]),
            otto: Window::new(&named[1]),
            paula: Window::new(&named[2]),
            served,
            _joined: joined,
            _keys: keys,
            _core: core,
            _named: named,
        };
        for window in room.windows() {
            assert!(window.host.sees_the_core(Duration::from_secs(10)));
            assert!(window.is_shown(|class| class.members().len() == 2), "both are listed");
        }
        room
    }

    fn windows(&mut self) -> [&mut Window; 3] {
        [&mut self.local, &mut self.otto, &mut self.paula]
    }

    /// True if all windows show this operator.
    fn all_show_operator(&mut self, name: &str) -> bool {
        self.windows().into_iter().all(|window| window.shows_operator(name))
    }
}

#[test]
fn a_window_requests_the_needle_and_its_holder_hands_it_over() {
    let mut room = Room::begin();
    assert!(room.local.is_shown(|class| class.is_beside_core == 1));
    assert!(room.otto.is_shown(|class| class.is_beside_core == 0));
    room.otto.moves(0.0).expect("nobody operates");
    assert!(room.all_show_operator("otto"), "{}", room.served.log());
    assert!(still_moving_m(&mut room.local.host) > 1e-4, "the hand is on its way");

    room.paula.ask(&LeaseRequest::Take);
    let asked = |window: &mut Window| window.is_shown(|class| class.asked.read() == "paula");
    assert!(room.windows().into_iter().all(asked), "{}", room.served.log());
    assert!(room.paula.moves(0.0).is_err_and(|why| why.contains("otto")));
    // A member without it cannot hand it over.
    room.paula.ask(&LeaseRequest::Give("paula".to_owned()));
    let refused = "paula (operator, seat 2): the needle: only who operates hands over";
    assert!(
        room.served.says(refused, Duration::from_secs(3)),
        "{}",
        room.served.log()
    );

    room.otto.ask(&LeaseRequest::Give("paula".to_owned()));
    assert!(room.all_show_operator("paula"), "{}", room.served.log());
    assert!(room.paula.is_shown(|class| class.asked.read().is_empty()));
    let rests = until(Duration::from_secs(3), || still_moving_m(&mut room.local.host) < 1e-6);
    assert!(rests, "the hand goes on for who has handed it over");
    room.paula.moves(0.01).expect("handed over");
    assert!(room.otto.moves(0.0).is_err_and(|why| why.contains("paula")));

    room.paula.ask(&LeaseRequest::Release);
    assert!(room.all_show_operator(""), "{}", room.served.log());
    room.otto.ask(&LeaseRequest::Take);
    assert!(room.all_show_operator("otto"), "{}", room.served.log());
}

#[test]
fn the_window_next_to_the_core_takes_and_gives_the_needle() {
    let mut room = Room::begin();
    room.otto.moves(0.0).expect("nobody operates");
    room.local.ask(&LeaseRequest::Take);
    let local = |window: &mut Window| window.is_shown(|class| class.local_operates == 1);
    assert!(room.windows().into_iter().all(local), "{}", room.served.log());
    let rests = until(Duration::from_secs(3), || still_moving_m(&mut room.local.host) < 1e-6);
    assert!(rests, "the hand goes on for who has it no longer");
    assert!(room.otto.moves(0.01).is_err_and(|why| why.contains("beside the core")));
    room.local.ask(&LeaseRequest::Give("paula".to_owned()));
    assert!(room.all_show_operator("paula"), "{}", room.served.log());
    room.paula.moves(0.01).expect("given");
}
