//! One hand holds the needle: first the one next to the core, then a remote one while it is heard; it can be handed
//! over.

use crate::fixture::{Keys, Named, Running, core, join, lease, until};
use crate::host::{Host, go, still_moving_m};
use std::time::Duration;
use stylet_relay::keys::{Role, Validity};
use stylet_shm_schema::Request;

/// A remote operator with a slowly moving hand, and the processes that carry it.
struct Way {
    local: Host,
    host: Host,
    joined: Running,
    served: Running,
    keys: Keys,
    _core: Running,
    far: Named,
    near: Named,
}

impl Way {
    fn begin() -> Self {
        let (near, far) = (Named::new(), Named::new());
        let core = core(&near, &[]);
        let keys = Keys::new();
        let served = keys.serve(&near);
        let joined = join(&keys.invite("otto", Role::Operator, Validity::days(1)), &far);
        let (mut host, mut local) = (Host::new(&far), Host::new(&near));
        assert!(
            host.sees_the_core(Duration::from_secs(10)),
            "{}{}",
            served.log(),
            joined.log()
        );
        assert!(local.sees_the_core(Duration::from_secs(10)));
        let scene = host.scene.expect("seen");
        host.ask(&go(&scene, 0.0, 0.005)).expect("an operator");
        assert!(
            until(Duration::from_secs(5), || still_moving_m(&mut local) > 1e-4),
            "the hand is on its way"
        );
        Self {
            local,
            host,
            joined,
            served,
            keys,
            _core: core,
            far,
            near,
        }
    }

    fn stops(&mut self) -> bool {
        until(Duration::from_secs(3), || still_moving_m(&mut self.local) < 1e-6)
    }
}

#[test]
fn the_hand_stops_where_its_operator_stands_still_or_is_killed() {
    for signal in [libc::SIGSTOP, libc::SIGKILL] {
        let mut way = Way::begin();
        way.joined.signal(signal);
        assert!(way.stops(), "{}", way.served.log());
        assert!(
            way.served
                .says("otto (operator, seat 1) operated and is silent", Duration::from_secs(1))
        );
        assert!(lease(&way.near, &["status"]).contains("operates: nobody"));
        if signal == libc::SIGSTOP {
            // Requests that the operator sent before it was suspended are not carried out when it resumes.
            let scene = way.host.scene.expect("seen");
            way.host.send(&go(&scene, 0.02, 0.005));
            std::thread::sleep(Duration::from_millis(700));
            way.joined.signal(libc::SIGCONT);
            std::thread::sleep(Duration::from_secs(1));
            assert!(
                way.stops(),
                "a request of before is carried out late: {}",
                way.served.log()
            );
            assert!(
                until(Duration::from_secs(5), || way.host.ask(&go(&scene, 0.0, 0.005)).is_ok()),
                "{}",
                way.served.log()
            );
        }
    }
}

#[test]
fn the_hand_stops_where_the_server_stands_still_or_is_killed() {
    for signal in [libc::SIGSTOP, libc::SIGKILL] {
        let mut way = Way::begin();
        let keeper = way.served.child.id();
        let children = std::fs::read_to_string(format!("/proc/{keeper}/task/{keeper}/children")).expect("a keeper");
        let server: i32 = children.trim().parse().expect("one server");
        // SAFETY: a signal to a child of our child, which cannot have been waited for while it runs.
        unsafe { libc::kill(server, signal) };
        assert!(way.stops(), "{}", way.served.log());
        assert!(
            way.served
                .says("the hand is stopped: the relay", Duration::from_secs(1)),
            "{}",
            way.served.log()
        );
        // SAFETY: as above; a process that was killed is not there, or is ours to wait for.
        unsafe { libc::kill(server, libc::SIGCONT) };
        let scene = way.host.scene.expect("seen");
        let again = until(Duration::from_secs(10), || {
            way.host.ask(&go(&scene, 0.0, 0.005)).is_ok()
        });
        assert!(again, "{}{}", way.served.log(), way.joined.log());
    }
}

#[test]
fn a_hand_beside_the_core_goes_first_and_hands_over() {
    let mut way = Way::begin();
    let scene = way.local.scene.expect("seen");
    way.local.ask(&go(&scene, 0.005, 0.005)).expect("beside the core");
    let refused = way.host.ask(&go(&scene, 0.0, 0.005)).expect_err("the other operates");
    assert!(refused.contains("a window beside the core operates"), "{refused}");
    assert!(way.served.says(
        "a window beside the core operates now, and otto",
        Duration::from_secs(1)
    ));
    // Everyone may remove motion.
    way.host.ask(&Request::StopHand).expect("allowed");
    assert!(lease(&way.near, &["give", "otto"]).contains("otto operates now"));
    way.host.ask(&go(&scene, 0.0, 0.005)).expect("handed over");
}

#[test]
fn the_hand_rests_while_an_operator_hands_the_needle_over() {
    let mut way = Way::begin();
    let other = Named::new();
    let _joined = join(&way.keys.invite("paula", Role::Operator, Validity::days(1)), &other);
    let mut paula = Host::new(&other);
    assert!(paula.sees_the_core(Duration::from_secs(10)));
    let scene = way.host.scene.expect("seen");
    let refused = until(Duration::from_secs(3), || {
        paula
            .ask(&go(&scene, 0.0, 0.005))
            .is_err_and(|why| why.contains("otto"))
    });
    assert!(refused, "{}", way.served.log());
    assert!(lease(&way.near, &["status"]).contains("asks to operate: paula"));
    lease(&way.far, &["give", "paula"]);
    assert!(way.stops(), "{}", way.served.log());
    assert!(
        lease(&way.near, &["status"]).contains("operates: paula"),
        "{}",
        way.served.log()
    );
    paula.ask(&go(&scene, 0.0, 0.005)).expect("handed over");
    assert!(way.host.ask(&go(&scene, 0.0, 0.005)).is_err());
    drop(paula);
}
