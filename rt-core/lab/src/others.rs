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
/// Interval of looks at real-time threads, and of searches for new ones.
const LOOK: Duration = Duration::from_millis(100);
const LOOKS_TO_A_SEARCH: u32 = 5;
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
    /// Begin, end, and what threads that preempt the loop ran in between, ns.
    #[serde(skip)]
    rivals: Vec<(u64, u64, String, u64)>,
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
    /// its cause.
    pub fn rival(&self, from_ns: u64, to_ns: u64) -> Option<String> {
        let overlap = self
            .rivals
            .iter()
            .filter(|(begin, end, ..)| *begin < to_ns && *end > from_ns);
        let (begin_ns, end_ns, who, ran_ns) = overlap.max_by_key(|(.., ran)| *ran)?;
        (2 * ran_ns >= to_ns - from_ns).then(|| {
            let [ran, around] = [*ran_ns, end_ns - begin_ns].map(|ns| ns as f64 / 1e6);
            format!("{who} ran {ran:.1} ms on this core, of the {around:.0} ms around the tick")
        })
    }
}

/// Looks on from `from_core` until `stop`; a thread with `priority` or more rivals the loop on `core`.
pub fn watch(
    machine: &Machine,
    core: Option<usize>,
    priority: u32,
    from_core: Option<usize>,
    stop: &AtomicBool,
) -> Others {
    let _armed = arm::arm(Ask {
        priority: None,
        core: from_core,
    });
    let mut others = Others {
        moments: vec![moment(machine, "before")],
        ..Others::default()
    };
    let begin_ns = clock::now_ns();
    let before = foreign(machine);
    let rivals_of = |all: &BTreeMap<u32, StatOfThread>| -> Vec<StatOfThread> {
        let rivals = all.values().filter(|t| t.priority.is_some_and(|p| p >= priority));
        rivals.filter(|t| Some(t.core) == core).cloned().collect()
    };
    let mut rivals = rivals_of(&before);
    // The last state of each thread, also of those that end during the run.
    let mut seen: BTreeMap<u32, StatOfThread> = BTreeMap::new();
    let mut ran: BTreeMap<u32, u64> = rivals.iter().map(|t| (t.id, t.ran_ns)).collect();
    let (mut looks, mut last_ns) = (0, begin_ns);
    // A thread that a search finds for the first time may have run since the search before.
    let (mut known, mut searched_ns) = (before.clone(), begin_ns);
    // SYNC: nothing but the flag is carried.
    while !stop.load(Ordering::Acquire) {
        std::thread::sleep(LOOK);
        looks += 1;
        let is_search = looks % LOOKS_TO_A_SEARCH == 0;
        let found = is_search.then(|| foreign(machine));
        if let Some(found) = &found {
            rivals = rivals_of(found);
        }
        let now_ns = clock::now_ns();
        for rival in &rivals {
            let Some(now) = machine.ran_ns(rival.process, rival.id) else {
                continue;
            };
            let earlier = ran.insert(rival.id, now);
            let begin_ns = if earlier.is_some() { last_ns } else { searched_ns };
            let at_search = || known.get(&rival.id).map_or(0, |t| t.ran_ns);
            let since = now.saturating_sub(earlier.unwrap_or_else(at_search));
            if since > 0 && others.rivals.len() < KEPT {
                let priority = rival.priority.unwrap_or(0);
                let who = format!("{} ({}) of real-time priority {priority}", rival.name, rival.id);
                others.rivals.push((begin_ns, now_ns, who, since));
            }
        }
        if let Some(found) = found {
            seen.extend(found.clone());
            (known, searched_ns) = (found, now_ns);
        }
        last_ns = now_ns;
        if looks == LOOKS_TO_A_SEARCH {
            others.moments.push(moment(machine, "during"));
        }
    }
    let passed_ns = (clock::now_ns() - begin_ns).max(1);
    others.moments.push(moment(machine, "after"));
    let after = foreign(machine);
    seen.extend(after.clone());
    let mut threads: Vec<OtherThread> = seen
        .values()
        .map(|t| OtherThread {
            share: (t.ran_ns - before.get(&t.id).map_or(0, |b| b.ran_ns).min(t.ran_ns)) as f64 / passed_ns as f64,
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

    fn ran(begin_ns: u64, end_ns: u64, ran_ns: u64) -> (u64, u64, String, u64) {
        (begin_ns, end_ns, format!("busy {ran_ns}"), ran_ns)
    }

    #[test]
    fn a_rival_is_named_only_if_it_ran_for_half_the_delay() {
        let others = Others {
            rivals: vec![ran(0, 100, 40), ran(100, 200, 90)],
            ..Others::default()
        };
        assert!(others.rival(50, 130).is_some_and(|who| who.starts_with("busy 90")));
        assert_eq!(others.rival(0, 99), None, "40 of 99");
        assert_eq!(others.rival(300, 310), None);
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
