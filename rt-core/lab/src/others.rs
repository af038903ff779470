//! What else ran: load, pressure, and the threads of other programs that took processor time, without a trace.

use crate::machine::{Machine, StatOfThread};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::rt::arm::{self, Ask};
use stylet_runtime::rt::clock;

/// Share of one core from which a thread, or all together, count as something that ran.
const NOTABLE: f64 = 0.02;
/// Most threads that are listed.
const LISTED: usize = 12;
/// Interval of looks at real-time threads, and of searches for new ones: a search reads all of `/proc`.
const LOOK: Duration = Duration::from_millis(100);
const LOOKS_TO_A_SEARCH: u32 = 20;
/// Wait of the loop for its core in one look, from which new ones are searched for sooner.
const LONG_WAIT_NS: u64 = 1_000_000;
const FEWEST_LOOKS: u32 = 5;
/// Most intervals in which a rival ran.
const KEPT: usize = 4096;
/// Programs of Stylet that serve an instance.
const PROGRAMS: [&str; 3] = ["rt-core", "stylet-bridge", "host-ui"];

/// State of the PC at one time.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Moment {
    pub when: String,
    /// Runnable threads, mean of a minute.
    pub load: Option<f64>,
    /// Share of the last ten seconds in which some thread waited, percent, by what it waited for.
    pub waited_percent: BTreeMap<String, f64>,
}

/// A thread of another program that took processor time, or may preempt the loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherThread {
    pub name: String,
    pub id: u32,
    /// Core on which it was seen last.
    pub core: usize,
    /// Real-time priority; `None` for a normal thread.
    pub priority: Option<u32>,
    /// Processor time as a share of one core.
    pub share: f64,
}

/// Everything but the measurement.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Others {
    pub moments: Vec<Moment>,
    /// Processor time of all other programs together, in cores.
    pub cores_taken: f64,
    /// The threads that took most, and those of real-time priority that ran.
    pub threads: Vec<OtherThread>,
    /// Other programs of Stylet.
    pub instances: Vec<String>,
    #[serde(skip)]
    rivals: Vec<Rival>,
    /// The last state of each thread, also of those that end during the run.
    #[serde(skip)]
    seen: BTreeMap<u32, StatOfThread>,
}

/// What a thread that preempts the loop ran between two looks, ns.
#[derive(Clone, Debug)]
struct Rival {
    begin_ns: u64,
    end_ns: u64,
    who: String,
    ran_ns: u64,
    /// Wait of the loop for its core in the same time; `None` if the kernel does not count it.
    loop_waited_ns: Option<u64>,
}

impl Others {
    /// Returns what ran beside the measurement in words.
    pub fn words(&self) -> String {
        if self.cores_taken < NOTABLE && self.instances.is_empty() {
            return format!("no other program took {:.0} % of a core", 100.0 * NOTABLE);
        }
        let busy = self.threads.iter().filter(|t| t.share >= NOTABLE).take(4);
        let busy: Vec<String> = busy
            .map(|t| format!("{} ({}) {:.0} %", t.name, t.id, 100.0 * t.share))
            .collect();
        let mut said = vec![format!("other programs took {:.2} cores", self.cores_taken)];
        said.extend(busy);
        said.extend(self.instances.iter().map(|i| format!("another Stylet: {i}")));
        said.join(", ")
    }

    /// Returns the thread of the loop's priority or a higher one that ran while a tick was late, for long enough to be
    /// its cause, if the loop waited for its core as long.
    pub fn rival(&self, from_ns: u64, to_ns: u64) -> Option<String> {
        let overlap = self.rivals.iter().filter(|r| r.begin_ns < to_ns && r.end_ns > from_ns);
        let rival = overlap.max_by_key(|r| r.ran_ns)?;
        let lasted_ns = rival.ran_ns.min(rival.loop_waited_ns.unwrap_or(u64::MAX));
        (2 * lasted_ns >= to_ns - from_ns).then(|| {
            let [ran, around] = [rival.ran_ns, rival.end_ns - rival.begin_ns].map(|ns| ns as f64 / 1e6);
            format!(
                "{} ran {ran:.1} ms on this core, of the {around:.0} ms around",
                rival.who
            )
        })
    }
}

/// The loop that is watched, and the core from which it is.
#[derive(Clone, Copy)]
pub struct Watched {
    pub core: Option<usize>,
    /// A thread with this priority or more rivals the loop.
    pub priority: u32,
    /// Name of its thread.
    pub thread: &'static str,
    pub from_core: Option<usize>,
    /// Its own thread gets a small share of a busy core: the loops may need what a look costs.
    pub low_priority: bool,
}

/// The state of the PC before a measurement.
pub struct Before {
    moment: Moment,
    begin_ns: u64,
    threads: BTreeMap<u32, StatOfThread>,
}

/// Searches all threads; not while the loops run.
pub fn before(machine: &Machine) -> Before {
    Before {
        moment: moment(machine, "before"),
        begin_ns: clock::now_ns(),
        threads: foreign(machine),
    }
}

/// Looks on until `stop`.
pub fn watch(machine: &Machine, watched: Watched, before: Before, stop: &AtomicBool) -> (Before, Others) {
    let _armed = arm::arm(Ask {
        priority: None,
        core: watched.from_core,
    });
    if watched.low_priority {
        arm::lower_priority();
    }
    let mut others = Others {
        moments: vec![before.moment.clone()],
        ..Others::default()
    };
    let rivals_of = |all: &BTreeMap<u32, StatOfThread>| -> Vec<StatOfThread> {
        let rivals = all
            .values()
            .filter(|t| t.priority.is_some_and(|p| p >= watched.priority));
        rivals.filter(|t| Some(t.core) == watched.core).cloned().collect()
    };
    let own = std::process::id();
    let (mut own_thread, mut waited_before) = (None, None);
    let mut rivals = rivals_of(&before.threads);
    let mut ran: BTreeMap<u32, u64> = rivals.iter().map(|t| (t.id, t.ran_ns)).collect();
    let (mut looks, mut since_search, mut last_ns) = (0, 0, before.begin_ns);
    let mut known = before.threads.clone();
    // SYNC: nothing but the flag is carried.
    while !stop.load(Ordering::Acquire) {
        std::thread::sleep(LOOK);
        (looks, since_search) = (looks + 1, since_search + 1);
        own_thread = own_thread.or_else(|| machine.own_thread(watched.thread));
        let waited = own_thread.and_then(|id| machine.waited_ns(own, id));
        let loop_waited_ns = waited.zip(waited_before).map(|(now, before)| now - before);
        waited_before = waited;
        let is_late = since_search >= FEWEST_LOOKS && loop_waited_ns.is_some_and(|ns| ns >= LONG_WAIT_NS);
        let found = (is_late || since_search == LOOKS_TO_A_SEARCH).then(|| foreign(machine));
        if let Some(found) = &found {
            rivals = rivals_of(found);
        }
        let now_ns = clock::now_ns();
        for rival in &rivals {
            let Some(now) = machine.ran_ns(rival.process, rival.id) else {
                continue;
            };
            // One that a search finds for the first time may have run since the search before.
            let at_search = || known.get(&rival.id).map_or(0, |t| t.ran_ns);
            let ran_ns = now.saturating_sub(ran.insert(rival.id, now).unwrap_or_else(at_search));
            if ran_ns > 0 && others.rivals.len() < KEPT {
                let priority = rival.priority.unwrap_or(0);
                others.rivals.push(Rival {
                    begin_ns: last_ns,
                    end_ns: now_ns,
                    who: format!("{} ({}) of real-time priority {priority}", rival.name, rival.id),
                    ran_ns: ran_ns.min(now_ns - last_ns),
                    loop_waited_ns,
                });
            }
        }
        if let Some(found) = found {
            others.seen.extend(found.clone());
            (known, since_search) = (found, 0);
        }
        last_ns = now_ns;
        if looks == FEWEST_LOOKS {
            others.moments.push(moment(machine, "during"));
        }
    }
    (before, others)
}

/// Searches all threads once more, and lists what ran; not while the loops run.
pub fn after(machine: &Machine, (before, mut others): (Before, Others)) -> Others {
    let passed_ns = (clock::now_ns() - before.begin_ns).max(1);
    others.moments.push(moment(machine, "after"));
    let after = foreign(machine);
    let mut seen = std::mem::take(&mut others.seen);
    seen.extend(after.clone());
    let ran_before = |id| before.threads.get(id).map_or(0, |b| b.ran_ns);
    let mut threads: Vec<OtherThread> = seen
        .values()
        .map(|t| OtherThread {
            share: t.ran_ns.saturating_sub(ran_before(&t.id)) as f64 / passed_ns as f64,
            name: t.name.clone(),
            id: t.id,
            core: t.core,
            priority: t.priority,
        })
        .collect();
    others.cores_taken = threads.iter().map(|t| t.share).sum();
    threads.retain(|t| t.share >= NOTABLE || (t.priority.is_some() && t.share > 0.0));
    threads.sort_by(|a, b| b.share.total_cmp(&a.share));
    threads.truncate(LISTED);
    others.threads = threads;
    let names = after
        .values()
        .filter(|t| t.id == t.process && PROGRAMS.contains(&t.name.as_str()));
    others.instances = names.map(|t| format!("{} ({})", t.name, t.id)).collect();
    others
}

fn moment(machine: &Machine, when: &str) -> Moment {
    let load = machine
        .text("proc/loadavg")
        .and_then(|t| t.split(' ').next()?.parse().ok());
    let waited = |what: &str| {
        let text = machine.text(&format!("proc/pressure/{what}"))?;
        let share = text.split_whitespace().find_map(|word| word.strip_prefix("avg10="))?;
        Some((what.to_owned(), share.parse().ok()?))
    };
    Moment {
        when: when.to_owned(),
        load,
        waited_percent: ["cpu", "io", "memory"].into_iter().filter_map(waited).collect(),
    }
}

/// Returns the threads that do not belong to this process or to what it started.
fn foreign(machine: &Machine) -> BTreeMap<u32, StatOfThread> {
    let all = machine.threads();
    let parents: BTreeMap<u32, u32> = all.iter().map(|t| (t.process, t.parent)).collect();
    let own = std::process::id();
    let is_ours = |mut process: u32| {
        // A process and its ancestors; no tree is deeper than this.
        for _ in 0..64 {
            if process == own {
                return true;
            }
            let Some(&parent) = parents.get(&process) else { break };
            process = parent;
        }
        false
    };
    all.into_iter()
        .filter(|t| !is_ours(t.process))
        .map(|t| (t.id, t))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ran(begin_ns: u64, end_ns: u64, ran_ns: u64, loop_waited_ns: Option<u64>) -> Rival {
        Rival {
            begin_ns,
            end_ns,
            who: format!("busy {ran_ns}"),
            ran_ns,
            loop_waited_ns,
        }
    }

    #[test]
    fn a_rival_is_named_only_if_it_ran_and_the_loop_waited_long_enough() {
        let others = Others {
            rivals: vec![
                ran(0, 100, 40, None),
                ran(100, 200, 90, Some(60)),
                ran(400, 500, 90, Some(10)),
            ],
            ..Others::default()
        };
        assert!(others.rival(50, 130).is_some_and(|who| who.starts_with("busy 90")));
        assert_eq!(others.rival(0, 99), None, "40 of 99");
        assert_eq!(others.rival(300, 310), None);
        assert_eq!(others.rival(420, 450), None, "the loop waited for 10 of 30");
    }

    #[test]
    fn no_other_program_is_said_only_where_none_ran() {
        let mut others = Others::default();
        assert_eq!(others.words(), "no other program took 2 % of a core");
        others.threads.push(OtherThread {
            name: "yes".to_owned(),
            id: 7,
            core: 1,
            priority: None,
            share: 0.99,
        });
        others.cores_taken = 1.0;
        assert_eq!(others.words(), "other programs took 1.00 cores, yes (7) 99 %");
    }

    #[test]
    fn a_busy_program_is_found_and_this_one_is_not() {
        let mut busy = std::process::Command::new("sh")
            .args(["-c", "while :; do :; done"])
            .spawn()
            .expect("sh");
        std::thread::sleep(Duration::from_millis(300));
        let all = Machine::this().threads();
        let seen = all.iter().find(|t| t.id == busy.id()).expect("listed").clone();
        let ours = foreign(&Machine::this());
        busy.kill().expect("ours");
        busy.wait().expect("ours");
        assert!(
            seen.ran_ns > 10_000_000 && seen.name == "sh" && seen.priority.is_none(),
            "{seen:?}"
        );
        // It is a child of this process, as a load is.
        assert!(!ours.contains_key(&busy.id()) && ours.contains_key(&1));
    }
}
