//! A process that stands still, is killed or is cut off in an insertion: the core beside it loses nothing, and the far side is whole again.

use crate::fixture::{Host, Keys, Named, Running, core, go, join, lease, until};
use crate::proxy::Proxy;
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity};

/// Of each fault; `STYLET_RELAY_FAULTS` makes it more.
fn times() -> usize {
    std::env::var("STYLET_RELAY_FAULTS")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(3)
}

/// What is faulty.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Who {
    Server,
    Observer,
    Operator,
}

/// How.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Stopped,
    Killed,
    Cut,
}

/// Everything of an insertion with an operator and an observer on the net.
struct Class {
    local: Host,
    operator: Host,
    observer: Host,
    joined: [Option<Running>; 2],
    invitations: [std::path::PathBuf; 2],
    cables: [Proxy; 2],
    served: Running,
    _keys: Keys,
    _core: Running,
    far: [Named; 2],
    _near: Named,
    forward: bool,
}

impl Class {
    fn begin() -> Self {
        let (near, far) = (Named::new(), [Named::new(), Named::new()]);
        let core = core(&near, &[]);
        let keys = Keys::new();
        let cables = [Proxy::to(keys.port), Proxy::to(keys.port)];
        let invitations = [
            keys.invite("otto", Role::Operator, Validity::days(1)),
            keys.invite("olga", Role::Observer, Validity::days(1)),
        ];
        let served = keys.serve(&near);
        let joined = [0, 1].map(|i| Some(through(&invitations[i], &far[i], &cables[i])));
        let mut class = Self {
            local: Host::new(&near),
            operator: Host::new(&far[0]),
            observer: Host::new(&far[1]),
            joined,
            invitations,
            cables,
            served,
            _keys: keys,
            _core: core,
            far,
            _near: near,
            forward: true,
        };
        for host in [&mut class.local, &mut class.operator, &mut class.observer] {
            assert!(host.sees_the_core(Duration::from_secs(20)));
        }
        class
    }

    /// The needle goes in and out again between 20 and 50 mm after the start of its way.
    fn insert(&mut self) -> Result<(), String> {
        let scene = self.local.scene.expect("seen");
        self.forward = !self.forward;
        let depth_m = if self.forward { 0.02 } else { 0.05 };
        let mut asked = Err(String::new());
        until(Duration::from_secs(10), || {
            asked = self.operator.ask(&go(&scene, depth_m, 0.01));
            asked.is_ok()
        });
        asked
    }

    fn server(&self) -> i32 {
        let keeper = self.served.child.id();
        let children = std::fs::read_to_string(format!("/proc/{keeper}/task/{keeper}/children")).unwrap_or_default();
        children
            .split_whitespace()
            .next()
            .and_then(|pid| pid.parse().ok())
            .unwrap_or(0)
    }

    /// Does it, for half a second where it ends by itself; returns when it has ended.
    fn strike(&mut self, who: Who, fault: Fault) -> Instant {
        let half_a_second = || std::thread::sleep(Duration::from_millis(500));
        let i = usize::from(who == Who::Observer);
        match (who, fault) {
            (Who::Server, Fault::Cut) => {
                self.cables.iter().for_each(|cable| cable.cut(true));
                half_a_second();
                self.cables.iter().for_each(|cable| cable.cut(false));
            }
            (_, Fault::Cut) => {
                self.cables[i].cut(true);
                half_a_second();
                self.cables[i].cut(false);
            }
            (Who::Server, _) => {
                let pid = self.server();
                assert!(pid > 0, "{}", self.served.log());
                let signal = if fault == Fault::Killed {
                    libc::SIGKILL
                } else {
                    libc::SIGSTOP
                };
                // SAFETY: signals to a child of our child; one that was killed is started again by its parent.
                unsafe { libc::kill(pid, signal) };
                half_a_second();
                if fault == Fault::Stopped {
                    // SAFETY: as above.
                    unsafe { libc::kill(pid, libc::SIGCONT) };
                }
            }
            (_, Fault::Stopped) => {
                let joined = self.joined[i].as_ref().expect("runs");
                joined.signal(libc::SIGSTOP);
                half_a_second();
                joined.signal(libc::SIGCONT);
            }
            (_, Fault::Killed) => {
                let mut joined = self.joined[i].take().expect("runs");
                joined.signal(libc::SIGKILL);
                let _ = joined.child.wait();
                half_a_second();
                self.joined[i] = Some(through(&self.invitations[i], &self.far[i], &self.cables[i]));
            }
        }
        Instant::now()
    }
}

fn through(invitation: &std::path::Path, named: &Named, cable: &Proxy) -> Running {
    let mut changed = crate::fixture::invitation(invitation);
    changed.server = format!("127.0.0.1:{}", cable.port);
    let path = invitation.with_extension(format!("through-{}", cable.port));
    stylet_relay::keys::write_invitation(&path, &changed).expect("written");
    join(&path, named)
}

#[test]
fn faults_in_an_insertion_cost_the_core_no_record_and_the_far_side_comes_back() {
    let mut class = Class::begin();
    let mut back_ms: Vec<(Who, Fault, f64)> = Vec::new();
    let mut unstopped = 0;
    for round in 0..times() {
        for who in [Who::Observer, Who::Operator, Who::Server] {
            for fault in [Fault::Stopped, Fault::Killed, Fault::Cut] {
                let inserted = class.insert();
                assert_eq!(inserted, Ok(()), "{round} {who:?} {fault:?}: {}", class.served.log());
                let stops = class.served.log().matches("the hand is stopped").count();
                let ended = class.strike(who, fault);
                // Whoever operates is cut off from the hand by all but what befalls the observer.
                if who != Who::Observer && class.served.log().matches("the hand is stopped").count() == stops {
                    unstopped += 1;
                }
                class.local.poll();
                let host = if who == Who::Observer {
                    &mut class.observer
                } else {
                    &mut class.operator
                };
                host.poll();
                host.taken.clear();
                let back = until(Duration::from_secs(20), || {
                    host.poll();
                    !host.taken.is_empty()
                });
                assert!(back, "{round} {who:?} {fault:?}: {}", class.served.log());
                back_ms.push((who, fault, ended.elapsed().as_secs_f64() * 1e3));
                std::thread::sleep(Duration::from_millis(300));
            }
        }
    }
    class.local.poll();
    let ticks: Vec<u64> = class.local.taken.iter().map(|record| record.tick).collect();
    let missing = ticks.windows(2).filter(|pair| pair[1] != pair[0] + 1).count();
    for who in [Who::Observer, Who::Operator, Who::Server] {
        for fault in [Fault::Stopped, Fault::Killed, Fault::Cut] {
            let mut times: Vec<f64> = back_ms
                .iter()
                .filter(|b| (b.0, b.1) == (who, fault))
                .map(|b| b.2)
                .collect();
            times.sort_by(f64::total_cmp);
            let longest = times.last().copied().unwrap_or(0.0);
            println!(
                "{who:?} {fault:?}: {} times, back after {:.0} ms, at most {longest:.0} ms",
                times.len(),
                times[times.len() / 2]
            );
        }
    }
    println!("{} records beside the core, {missing} gaps", ticks.len());
    println!("{}", lease(&class.far[1], &["status"]));
    assert!(ticks.len() > 1000);
    assert_eq!(missing, 0, "the core's own records have gaps");
    assert_eq!(
        unstopped,
        0,
        "the hand went on without its operator: {}",
        class.served.log()
    );
}
