//! Wake-ups of every measured core in the layout of `cyclictest --json`, for programs that read its files.

use crate::disk::{self, DiskError};
use crate::machine::Preemption;
use crate::raw::Raw;
use crate::report::Report;
use hdrhistogram::Histogram;
use serde::Serialize;
use std::collections::BTreeMap;

/// Wake-ups of one thread on its core.
pub struct CoreWakes {
    pub thread: &'static str,
    /// `None` for a thread that may run on any core.
    pub core: Option<usize>,
    pub wakes: Histogram<u64>,
}

impl CoreWakes {
    /// Returns the wake-ups in each microsecond that has any. From a millisecond on the histogram's own bins are wider:
    /// 0.1 % of the value.
    pub fn bins(&self) -> BTreeMap<u64, u64> {
        let mut bins = BTreeMap::new();
        for bin in self.wakes.iter_recorded() {
            *bins.entry(bin.value_iterated_to() / 1_000).or_default() += bin.count_at_value();
        }
        bins
    }
}

/// Returns the loops, and the gap watch where it had a core of its own.
pub fn cores(r: &Report, raw: &Raw) -> Vec<CoreWakes> {
    let core_of = |name: &str| {
        let setting = r.settings.iter().find(|s| s.name == format!("{name} thread: core"));
        setting.and_then(|s| s.got.parse().ok())
    };
    let loops = [
        ("haptic", "force loop"),
        ("tissue", "tissue loop"),
        ("second", "loop of the second device"),
    ];
    let mut all: Vec<CoreWakes> = loops
        .into_iter()
        .map(|(name, thread)| CoreWakes {
            thread,
            core: core_of(name),
            wakes: raw.get(&format!("{name}/wake")),
        })
        .collect();
    if all.iter().all(|of| of.core != r.gaps.core) {
        all.push(CoreWakes {
            thread: "gap watch",
            core: r.gaps.core,
            wakes: raw.get("gap_watch/wake"),
        });
    }
    all.retain(|of| !of.wakes.is_empty());
    all
}

/// The file; two of its names end with a colon, as in cyclictest's.
#[derive(Serialize)]
struct File<'a> {
    file_version: u32,
    #[serde(rename = "cmdline:")]
    cmdline: String,
    #[serde(rename = "rt_test_version:")]
    rt_test_version: &'a str,
    start_time: String,
    end_time: String,
    return_code: u8,
    sysinfo: SysInfo<'a>,
    num_threads: usize,
    resolution_in_ns: u32,
    thread: BTreeMap<usize, Thread>,
}

#[derive(Serialize)]
struct SysInfo<'a> {
    sysname: &'a str,
    nodename: &'a str,
    release: &'a str,
    version: &'a str,
    machine: &'a str,
    realtime: u32,
}

#[derive(Serialize)]
struct Thread {
    histogram: BTreeMap<u64, u64>,
    cycles: u64,
    min: u64,
    max: u64,
    avg: f64,
    cpu: i64,
    node: i64,
}

/// Returns the file.
pub fn json(r: &Report, raw: &Raw) -> Result<String, DiskError> {
    let fact = |group: &str, name: &str| {
        let found = r.facts.iter().find(|f| f.group == group && f.name == name);
        found.map_or("", |f| &f.value)
    };
    // Linux version 6.18.44 (builder@host) (compiler) #1 SMP ...
    let kernel = fact("Kernel", "version");
    let word = |at| kernel.split(' ').nth(at).unwrap_or_default();
    let threads = cores(r, raw).into_iter().map(|of| Thread {
        histogram: of.bins(),
        cycles: of.wakes.len(),
        min: of.wakes.min() / 1_000,
        max: of.wakes.max() / 1_000,
        avg: (of.wakes.mean() / 10.0).round() / 100.0,
        cpu: of.core.map_or(-1, |core| core as i64),
        // The program binds no memory to a node.
        node: -1,
    });
    let thread: BTreeMap<usize, Thread> = threads.enumerate().collect();
    // rustc 1.95.0 (...), x86_64-unknown-linux-gnu
    let target = fact("Program", "toolchain").rsplit(' ').next().unwrap_or_default();
    let machine = target.split('-').next().unwrap_or_default();
    let time = |s: u64| {
        let at = jiff::Timestamp::from_second(s as i64).unwrap_or_default();
        at.strftime("%a, %d %b %Y %H:%M:%S +0000").to_string()
    };
    let ran_s = (r.protocol.warm_up_s + r.protocol.measured_s).round() as u64;
    let file = File {
        file_version: 1,
        cmdline: r.command.join(" "),
        rt_test_version: &r.program,
        start_time: time(raw.began_s),
        end_time: time(raw.began_s.saturating_add(ran_s)),
        return_code: r.verdict.overall.exit_code(),
        sysinfo: SysInfo {
            sysname: word(0),
            nodename: fact("PC", "name"),
            release: word(2),
            version: kernel.find('#').map_or("", |at| &kernel[at..]),
            machine,
            realtime: u32::from(fact("Kernel", "preemption") == Preemption::RealTime.name()),
        },
        num_threads: thread.len(),
        resolution_in_ns: 0,
        thread,
    };
    disk::json(&file)
}
