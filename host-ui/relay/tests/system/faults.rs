//! A process that hangs, is killed or is cut off during an insertion: the core loses nothing, and the far side recovers
//! completely.

use crate::fixture::{Keys, Named, Running, core, join, lease, until};
use crate::host::{Host, go};
use crate::proxy::Proxy;
use crate::watch::quantile;
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity};

/// Repetitions of each fault; `STYLET_RELAY_FAULTS` sets more.
fn times() -> usize {
    std::env::var("STYLET_RELAY_FAULTS")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(3)
}

/// Affected process.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Who {
    Server,
    Observer,
    Operator,
}

/// Kind of fault.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Stopped,
    Killed,
    Cut,
}

/// An insertion with an operator and an observer on the network.
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

    /// Moves the needle in and out again between 20 and 50 mm from the start of its path.
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

    /// Injects the fault, for half a second if it ends by itself; returns when it has ended.
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

/// One fault and its effect.
struct Struck {
    who: Who,
    fault: Fault,
    /// Time from its end until records arrive again.
    back_ms: f64,
    /// Records that the members report as lost for good, in total.
    lost: u64,
}

/// Records that a member has lost for good since its start; `None` while it does not answer.
fn lost(far: &Named) -> Option<u64> {
    let words = lease(far, &["status"]);
    let number = words.split(" records lost").next()?.rsplit(' ').next()?;
    number.parse().ok()
}

impl Class {
    fn lost(&self) -> [u64; 2] {
        [0, 1].map(|i| lost(&self.far[i]).unwrap_or(0))
    }

    fn suffer(&mut self, who: Who, fault: Fault) -> Struck {
        let mut before = self.lost();
        let ended = self.strike(who, fault);
        if who != Who::Server && fault == Fault::Killed {
            before[usize::from(who == Who::Observer)] = 0;
        }
        self.local.poll();
        let host = match who {
            Who::Observer => &mut self.observer,
            _ => &mut self.operator,
        };
        host.poll();
        host.taken.clear();
        let back = until(Duration::from_secs(20), || {
            host.poll();
            !host.taken.is_empty()
        });
        let far = self.joined.iter().flatten().map(Running::log).collect::<String>();
        assert!(back, "{who:?} {fault:?}: {}\nmembers: {far}", self.served.log());
        let back_ms = ended.elapsed().as_secs_f64() * 1e3;
        // Requested records arrive meanwhile, or are counted.
        std::thread::sleep(Duration::from_millis(500));
        let after = self.lost();
        Struck {
            who,
            fault,
            back_ms,
            lost: (0..2).map(|i| after[i].saturating_sub(before[i])).sum(),
        }
    }
}

/// All kinds, or those named by `STYLET_RELAY_FAULTS_OF`, as "Server Killed".
fn kinds() -> Vec<(Who, Fault)> {
    let asked = std::env::var("STYLET_RELAY_FAULTS_OF").unwrap_or_default();
    let all = [Who::Observer, Who::Operator, Who::Server]
        .into_iter()
        .flat_map(|who| [Fault::Stopped, Fault::Killed, Fault::Cut].map(|fault| (who, fault)));
    all.filter(|(who, fault)| format!("{who:?} {fault:?}").contains(&asked))
        .collect()
}

#[test]
fn insertion_faults_lose_no_core_record_and_the_far_side_recovers() {
    let mut class = Class::begin();
    let (mut struck, mut unstopped) = (Vec::new(), 0);
    for round in 0..times() {
        for (who, fault) in kinds() {
            let inserted = class.insert();
            assert_eq!(inserted, Ok(()), "{round} {who:?} {fault:?}: {}", class.served.log());
            let stops = class.served.log().matches("the hand is stopped").count();
            struck.push(class.suffer(who, fault));
            // Every fault but the observer's cuts the operator off from the hand.
            if who != Who::Observer && class.served.log().matches("the hand is stopped").count() == stops {
                unstopped += 1;
            }
        }
    }
    class.local.poll();
    let ticks: Vec<u64> = class.local.taken.iter().map(|record| record.tick).collect();
    let missing = ticks.windows(2).filter(|pair| pair[1] != pair[0] + 1).count();
    for (who, fault) in kinds() {
        let of_kind = || struck.iter().filter(|s| (s.who, s.fault) == (who, fault));
        let mut times: Vec<f64> = of_kind().map(|s| s.back_ms).collect();
        let [median, longest] = [0.5, 1.0].map(|share| quantile(&mut times, share));
        println!(
            "{who:?} {fault:?}: {} times, back after {median:.0} ms, at most {longest:.0} ms; {} records lost by the members, {} at most",
            times.len(),
            of_kind().map(|s| s.lost).sum::<u64>(),
            of_kind().map(|s| s.lost).max().unwrap_or(0),
        );
    }
    println!("{} records beside the core, {missing} gaps", ticks.len());
    println!("{}", lease(&class.far[1], &["status"]));
    assert!(ticks.len() > 1000);
    assert_eq!(missing, 0, "the core's own records have gaps");
    // Each kill of a server cost a member the records of about 0.9 s, until the next one listened.
    let lost: u64 = struck.iter().map(|s| s.lost).sum();
    assert_eq!(lost, 0, "records that the members lost for good");
    assert_eq!(
        unstopped,
        0,
        "the hand went on without its operator: {}",
        class.served.log()
    );
}
