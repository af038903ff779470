//! Listed members receive the core's data, at each change of the list, without any effect on other seats.

use crate::fixture::{Keys, Named, Running, core, join, until};
use crate::host::{Host, go, still_moving_m};
use std::time::Duration;
use stylet_relay::keys::{Member, Role, Validity, now_s};
use stylet_shm_schema::Request;

/// An operator with a slowly moving hand, and an observer.
struct Class {
    otto: Host,
    olga: Host,
    local: Host,
    joined: [Running; 2],
    served: Running,
    keys: Keys,
    _core: Running,
    _named: [Named; 3],
}

impl Class {
    fn begin() -> Self {
        let named = [Named::new(), Named::new(), Named::new()];
        let core = core(&named[0], &[]);
        let keys = Keys::new();
        let served = keys.serve(&named[0]);
        let joined = [
            join(&keys.invite("otto", Role::Operator, Validity::days(1)), &named[1]),
            join(&keys.invite("olga", Role::Observer, Validity::days(1)), &named[2]),
        ];
        let mut class = Self {
            local: Host::new(&named[0]),
            otto: Host::new(&named[1]),
            olga: Host::new(&named[2]),
            joined,
            served,
            keys,
            _core: core,
            _named: named,
        };
        for host in [&mut class.local, &mut class.otto, &mut class.olga] {
            assert!(host.sees_the_core(Duration::from_secs(20)), "{}", class.served.log());
        }
        class
    }

    /// Moves at 2 mm/s, which outlasts the test.
    fn move_the_hand(&mut self) {
        let scene = self.otto.scene.expect("seen");
        self.otto.ask(&go(&scene, 0.04, 0.002)).expect("an operator");
        assert!(
            until(Duration::from_secs(5), || still_moving_m(&mut self.local) > 5e-5),
            "no motion"
        );
    }

    fn moves(&mut self) -> bool {
        still_moving_m(&mut self.local) > 5e-5
    }

    /// Changes the list as another program would.
    fn change(&self, change: impl FnOnce(&mut Vec<Member>)) {
        let mut members = self.keys.lab.members().expect("a list");
        change(&mut members.members);
        let text = serde_json::to_string(&members).expect("words");
        let (path, beside) = (self.keys.folder.join("members.json"), self.keys.folder.join("beside"));
        std::fs::write(&beside, text).expect("written");
        std::fs::rename(&beside, &path).expect("renamed");
    }

    fn olga_hears(&mut self, within: Duration) -> bool {
        self.olga.poll();
        self.olga.taken.clear();
        until(within, || {
            self.olga.poll();
            self.olga.taken.len() > 20
        })
    }
}

fn of(name: &str) -> impl FnMut(&&mut Member) -> bool {
    move |member| member.name == name
}

#[test]
fn a_closed_seat_hears_nothing_until_it_is_put_back() {
    type Change = fn(&mut Vec<Member>);
    let changes: [(&str, Change); 3] = [
        ("nobody has this seat in the list of the lab", |all| {
            all.retain(|m| m.name != "olga")
        }),
        ("the certificate is revoked", |all| {
            all.iter_mut().filter(of("olga")).for_each(|m| m.revoked = true);
        }),
        ("the certificate has expired", |all| {
            all.iter_mut().filter(of("olga")).for_each(|m| m.until_s = now_s() - 1);
        }),
    ];
    let mut class = Class::begin();
    class.move_the_hand();
    let before = class.keys.lab.members().expect("a list");
    for (why, change) in changes {
        assert!(class.olga_hears(Duration::from_secs(5)), "{}", class.served.log());
        let words = format!("the server refuses this member: {why}");
        let told = class.joined[1].log().matches(&words).count();
        class.change(change);
        std::thread::sleep(Duration::from_millis(1500));
        assert!(
            !class.olga_hears(Duration::from_secs(2)),
            "{why}: {}",
            class.served.log()
        );
        assert!(
            class.joined[1].log().matches(&words).count() > told,
            "{}",
            class.joined[1].log()
        );
        let refused = class.olga.ask(&Request::StopHand).expect_err("out");
        assert!(refused.contains(why), "{refused}");
        assert!(
            class.moves(),
            "{why}: the operator's hand stands still: {}",
            class.served.log()
        );
        class.change(|all| all.clone_from(&before.members));
        assert!(
            class.olga_hears(Duration::from_secs(5)),
            "in the list again: {}",
            class.served.log()
        );
    }
    let log = class.served.log();
    println!("{log}\n{}", class.joined[1].log());
    assert_eq!(log.matches("serving instance").count(), 1, "{log}");
    assert!(!log.contains("the hand is stopped"), "{log}");
}

#[test]
fn a_changed_expiry_stops_nothing_and_a_removed_operator_stops_the_hand() {
    let mut class = Class::begin();
    class.move_the_hand();
    let until_s = |until_s: i64| move |all: &mut Vec<Member>| all.iter_mut().for_each(|m| m.until_s = until_s);
    for days in [2, 1] {
        class.change(until_s(now_s() + days * 86_400));
        std::thread::sleep(Duration::from_millis(1200));
        assert!(class.moves(), "{}", class.served.log());
    }
    assert!(
        !class.served.log().contains("the hand is stopped"),
        "{}",
        class.served.log()
    );
    let before = class.keys.lab.members().expect("a list");
    type Change = fn(&mut Vec<Member>);
    let changes: [Change; 2] = [
        |all| all.retain(|m| m.name != "otto"),
        |all| {
            all.iter_mut()
                .filter(of("otto"))
                .for_each(|m| m.role = Role::Instructor)
        },
    ];
    for change in changes {
        let stops = class
            .served
            .log()
            .matches("the hand is stopped: whoever operated")
            .count();
        class.change(change);
        assert!(
            until(Duration::from_secs(3), || !class.moves()),
            "{}",
            class.served.log()
        );
        assert_eq!(
            class
                .served
                .log()
                .matches("the hand is stopped: whoever operated")
                .count(),
            stops + 1
        );
        class.change(|all| all.clone_from(&before.members));
        let scene = class.otto.scene.expect("seen");
        let again = until(Duration::from_secs(10), || {
            class.otto.ask(&go(&scene, 0.0, 0.002)).is_ok()
        });
        assert!(again && class.moves(), "{}", class.served.log());
    }
}

/// A missing list left the one before in force for ever.
#[test]
fn an_unreadable_list_admits_nobody_after_2_s() {
    let mut class = Class::begin();
    let path = class.keys.folder.join("members.json");
    let list = std::fs::read(&path).expect("a list");
    std::fs::write(&path, &list[..list.len() / 2]).expect("written");
    std::thread::sleep(Duration::from_millis(700));
    assert!(class.olga_hears(Duration::from_secs(1)), "an editor may be at work");
    std::thread::sleep(Duration::from_millis(2500));
    assert!(!class.olga_hears(Duration::from_secs(2)), "{}", class.served.log());
    assert!(
        class.served.log().contains("nobody is admitted"),
        "{}",
        class.served.log()
    );
    std::fs::write(&path, &list).expect("written");
    assert!(class.olga_hears(Duration::from_secs(5)), "{}", class.served.log());
}
