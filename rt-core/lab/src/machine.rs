//! The kernel's facts about this PC, read below a root path so that tests can present another machine.

mod threads;

pub use threads::{Process, StatOfThread};

use flate2::read::GzDecoder;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};

/// A machine as seen through `/proc`, `/sys`, `/dev` and `/boot`.
#[derive(Clone, Debug)]
pub struct Machine {
    root: PathBuf,
}

/// Preemption model: the delay before a woken real-time thread runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preemption {
    RealTime,
    Full,
    Lazy,
    Voluntary,
    None,
    Unknown,
}

impl Preemption {
    fn from_word(word: &str) -> Option<Self> {
        Some(match word {
            "full" => Self::Full,
            "lazy" => Self::Lazy,
            "voluntary" => Self::Voluntary,
            "none" => Self::None,
            _ => return None,
        })
    }

    /// True if a thread inside the kernel yields to a real-time thread at once.
    pub fn gives_way(self) -> bool {
        matches!(self, Self::RealTime | Self::Full | Self::Lazy)
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::RealTime => "PREEMPT_RT",
            Self::Full => "full (PREEMPT)",
            Self::Lazy => "lazy (PREEMPT_LAZY)",
            Self::Voluntary => "voluntary (PREEMPT_VOLUNTARY)",
            Self::None => "none (PREEMPT_NONE)",
            Self::Unknown => "not reported by the kernel",
        }
    }
}

/// The kernel's share for real-time threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Throttle {
    Off,
    /// Share of each second, or of another period.
    Share(f64),
}

/// Fraction of a core kept free for the loop itself and for everything else of real-time priority.
const SHARE_KEPT_FREE: f64 = 0.15;

/// Returns the longest spin that leaves the core below the kernel's share for real-time threads.
pub fn longest_spin_ns(period_ns: u64, throttle: Option<Throttle>) -> u64 {
    let share = match throttle {
        Some(Throttle::Share(share)) => share,
        Some(Throttle::Off) | None => 0.95,
    };
    ((share - SHARE_KEPT_FREE).max(0.0) * period_ns as f64).round() as u64
}

impl Machine {
    /// Returns the machine that this program runs on.
    pub fn this() -> Self {
        Self::at("/")
    }

    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// True if it is this machine rather than one made of files.
    pub fn is_this(&self) -> bool {
        self.root == Path::new("/")
    }

    /// Joins `path`, without its leading slash, to the root.
    pub fn path(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    /// Returns the contents, trimmed; `None` if the file is missing or unreadable.
    pub fn text(&self, path: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.path(path)).ok()?;
        Some(text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned())
    }

    /// Returns the names in a folder, sorted; empty if it is missing.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Returns `value` of the word `key=value` on the kernel's command line.
    pub fn boot_option(&self, key: &str) -> Option<String> {
        let line = self.text("proc/cmdline")?;
        let value = line.split_whitespace().filter_map(|word| word.split_once('='));
        value.filter(|(k, _)| *k == key).map(|(_, v)| v.to_owned()).next_back()
    }

    /// Returns the value of `CONFIG_<key>` with which the kernel was built.
    pub fn build_option(&self, key: &str) -> Option<String> {
        let config = self.build_config()?;
        let start = format!("CONFIG_{key}=");
        config.lines().find_map(|l| l.strip_prefix(&start)).map(str::to_owned)
    }

    fn build_config(&self) -> Option<String> {
        let release = self.text("proc/sys/kernel/osrelease").unwrap_or_default();
        if let Some(config) = self.text(&format!("boot/config-{release}")) {
            return Some(config);
        }
        let mut config = String::new();
        let packed = std::fs::File::open(self.path("proc/config.gz")).ok()?;
        GzDecoder::new(packed).read_to_string(&mut config).ok()?;
        Some(config)
    }

    pub fn preemption(&self) -> Preemption {
        let version = self.text("proc/version").unwrap_or_default();
        if self.text("sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT") {
            return Preemption::RealTime;
        }
        // "none voluntary (full) lazy": the one in brackets is in force.
        let running = self.text("sys/kernel/debug/sched/preempt").and_then(|text| {
            let word = text.split_once('(')?.1.split_once(')')?.0;
            Preemption::from_word(word)
        });
        let asked = || Preemption::from_word(&self.boot_option("preempt")?);
        let built = || {
            let is = |key: &str| self.build_option(key).as_deref() == Some("y");
            [
                ("PREEMPT_LAZY", Preemption::Lazy),
                ("PREEMPT_VOLUNTARY", Preemption::Voluntary),
                ("PREEMPT_NONE", Preemption::None),
                ("PREEMPT", Preemption::Full),
            ]
            .into_iter()
            .find(|(key, _)| is(key))
            .map(|(_, model)| model)
        };
        let named = || {
            let full = version.split_whitespace().any(|w| w == "PREEMPT");
            full.then_some(Preemption::Full)
        };
        running
            .or_else(asked)
            .or_else(built)
            .or_else(named)
            .unwrap_or(Preemption::Unknown)
    }

    pub fn online_cores(&self) -> BTreeSet<usize> {
        cores(&self.text("sys/devices/system/cpu/online").unwrap_or_default())
    }

    pub fn isolated_cores(&self) -> BTreeSet<usize> {
        cores(&self.text("sys/devices/system/cpu/isolated").unwrap_or_default())
    }

    pub fn tickless_cores(&self) -> BTreeSet<usize> {
        let list = self.text("sys/devices/system/cpu/nohz_full").unwrap_or_default();
        cores(&list)
    }

    /// Returns the other threads of the same physical core.
    pub fn siblings(&self, core: usize) -> BTreeSet<usize> {
        let path = format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list");
        let mut all = cores(&self.text(&path).unwrap_or_default());
        all.remove(&core);
        all
    }

    pub fn governor(&self, core: usize) -> Option<String> {
        self.text(&format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor"))
    }

    /// Reads the frequency from cpufreq, else from `/proc/cpuinfo`, which does not change on many machines.
    pub fn frequency_mhz(&self, core: usize) -> Option<f64> {
        let scaling = self.text(&format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_cur_freq"));
        if let Some(khz) = scaling.and_then(|t| t.parse::<f64>().ok()) {
            return Some(khz / 1e3);
        }
        self.cpuinfo(core, "cpu MHz")?.parse().ok()
    }

    /// Returns a line of one core in `/proc/cpuinfo`.
    pub fn cpuinfo(&self, core: usize, key: &str) -> Option<String> {
        let text = self.text("proc/cpuinfo")?;
        let block = text.split("\n\n").nth(core)?;
        let lines = block.lines().filter_map(|line| line.split_once(':'));
        lines
            .into_iter()
            .find(|(k, _)| k.trim() == key)
            .map(|(_, v)| v.trim().to_owned())
    }

    /// Returns the name and exit latency in microseconds of each enabled sleep state.
    pub fn idle_states(&self, core: usize) -> Vec<(String, u64)> {
        let folder = format!("sys/devices/system/cpu/cpu{core}/cpuidle");
        let state = |name: &String| {
            let read = |what: &str| self.text(&format!("{folder}/{name}/{what}"));
            let disabled = read("disable").as_deref() == Some("1");
            (!disabled).then(|| Some((read("name")?, read("latency")?.parse().ok()?)))?
        };
        self.names(&folder).iter().filter_map(state).collect()
    }

    /// Returns the interrupts that `core` may serve: number and user.
    pub fn interrupts_allowed_on(&self, core: usize) -> Vec<(u32, String)> {
        let table = self.text("proc/interrupts").unwrap_or_default();
        let user = |number: u32| {
            let start = format!("{number}:");
            let line = table.lines().find_map(|l| l.trim_start().strip_prefix(&start));
            line.and_then(|l| l.split_whitespace().last()).unwrap_or("?").to_owned()
        };
        let mut found: Vec<(u32, String)> = Vec::new();
        for number in self.names("proc/irq").iter().filter_map(|n| n.parse::<u32>().ok()) {
            let folder = format!("proc/irq/{number}");
            let allowed = self
                .text(&format!("{folder}/effective_affinity_list"))
                .filter(|t| !t.is_empty())
                .or_else(|| self.text(&format!("{folder}/smp_affinity_list")));
            if allowed.is_some_and(|list| cores(&list).contains(&core)) {
                found.push((number, user(number)));
            }
        }
        found.sort_unstable();
        found
    }

    /// Returns the interrupts that `core` served since the start, by number and name.
    pub fn interrupts_served(&self, core: usize) -> BTreeMap<String, u64> {
        interrupts(&self.text("proc/interrupts").unwrap_or_default(), core)
    }

    /// Returns the steal time of `core` as the kernel reports it, in seconds: time in which the hypervisor ran
    /// something else.
    pub fn steal_s(&self, core: usize) -> Option<f64> {
        let text = self.text("proc/stat")?;
        let start = format!("cpu{core} ");
        let line = text.lines().find_map(|l| l.strip_prefix(&start))?;
        // SAFETY: sysconf has no preconditions.
        let per_s = unsafe { libc::sysconf(libc::_SC_CLK_TCK) } as f64;
        Some(line.split_whitespace().nth(7)?.parse::<f64>().ok()? / per_s)
    }

    /// Returns the time of `core` since the start as the kernel counts it, busy and in all, in its own unit.
    pub fn busy_of_all(&self, core: usize) -> Option<(u64, u64)> {
        let text = self.text("proc/stat")?;
        let start = format!("cpu{core} ");
        let line = text.lines().find_map(|l| l.strip_prefix(&start))?;
        // User, nice, system, idle, waiting, interrupts, softirqs, stolen; guests are part of user and nice.
        let all: Vec<u64> = line.split_whitespace().take(8).map_while(|n| n.parse().ok()).collect();
        let sum: u64 = all.iter().sum();
        Some((sum - all.get(3)? - all.get(4)?, sum))
    }

    pub fn throttle(&self) -> Option<Throttle> {
        let runtime: f64 = self.text("proc/sys/kernel/sched_rt_runtime_us")?.parse().ok()?;
        let period: f64 = self.text("proc/sys/kernel/sched_rt_period_us")?.parse().ok()?;
        Some(if runtime < 0.0 {
            Throttle::Off
        } else {
            Throttle::Share(runtime / period)
        })
    }

    /// Returns the hypervisor by name, as far as it can be identified; `None` on bare metal.
    pub fn hypervisor(&self) -> Option<String> {
        if let Some(kind) = self.text("sys/hypervisor/type").filter(|t| !t.is_empty()) {
            return Some(kind);
        }
        let dmi = |what: &str| self.text(&format!("sys/class/dmi/id/{what}")).unwrap_or_default();
        let (vendor, product) = (dmi("sys_vendor"), dmi("product_name"));
        let known = [
            "QEMU",
            "VMware",
            "innotek",
            "Xen",
            "Amazon EC2",
            "Google",
            "Parallels",
            "OpenStack",
        ];
        let virtual_pc = vendor.contains("Microsoft") && product.contains("Virtual");
        let by_vendor = known.iter().any(|k| vendor.contains(k)) && !product.contains(".metal");
        let flagged = self
            .cpuinfo(0, "flags")
            .is_some_and(|flags| flags.split_whitespace().any(|f| f == "hypervisor"));
        if !flagged && !virtual_pc && !by_vendor {
            return None;
        }
        let clocks = self.text("sys/devices/system/clocksource/clocksource0/available_clocksource");
        Some(match clocks {
            _ if virtual_pc || by_vendor => format!("{vendor} {product}").trim().to_owned(),
            Some(clocks) if clocks.contains("kvm-clock") => "KVM".to_owned(),
            Some(clocks) if clocks.contains("hyperv") => "Hyper-V".to_owned(),
            _ => "of unknown make".to_owned(),
        })
    }

    pub fn clock_source(&self) -> Option<String> {
        self.text("sys/devices/system/clocksource/clocksource0/current_clocksource")
    }

    /// Returns the soft limit of this process from `/proc/self/limits`, the largest number for unlimited.
    pub fn limit(&self, name: &str) -> Option<u64> {
        let text = self.text("proc/self/limits")?;
        let line = text.lines().find_map(|l| l.strip_prefix(name))?;
        match line.split_whitespace().next()? {
            "unlimited" => Some(u64::MAX),
            number => number.parse().ok(),
        }
    }

    /// Returns whether this process has the capability with number `bit`.
    pub fn capable(&self, bit: u32) -> bool {
        let status = self.text("proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|l| l.strip_prefix("CapEff:"));
        let mask = mask.and_then(|m| u64::from_str_radix(m.trim(), 16).ok()).unwrap_or(0);
        mask >> bit & 1 == 1
    }
}

/// Returns the column of `core` in `/proc/interrupts`, by number and name.
pub fn interrupts(table: &str, core: usize) -> BTreeMap<String, u64> {
    let mut lines = table.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split_whitespace().collect();
    let Some(column) = head.iter().position(|c| *c == format!("CPU{core}")) else {
        return BTreeMap::new();
    };
    let row = |line: &str| {
        let (number, rest) = line.trim_start().split_once(':')?;
        let count = rest.split_whitespace().nth(column)?.parse().ok()?;
        let name: Vec<&str> = rest.split_whitespace().skip(head.len()).collect();
        let name = match number.parse::<u32>() {
            Ok(n) => format!("IRQ {n} ({})", name.last()?),
            Err(_) => name.join(" ").to_lowercase(),
        };
        Some((name, count))
    };
    lines.filter_map(row).collect()
}

/// Reads a list of cores as the kernel prints it: `0-2,5`.
pub fn cores(list: &str) -> BTreeSet<usize> {
    let mut all = BTreeSet::new();
    for part in list.trim().split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        if let (Ok(first), Ok(last)) = (first.trim().parse::<usize>(), last.trim().parse::<usize>()) {
            all.extend(first..=last.min(first + 4096));
        }
    }
    all
}

/// Prints a set of cores as the kernel does: `0-2,5`.
pub fn core_list(cores: &BTreeSet<usize>) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &core in cores {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == core => *last = core,
            _ => ranges.push((core, core)),
        }
    }
    let range = |(a, b): &(usize, usize)| if a == b { a.to_string() } else { format!("{a}-{b}") };
    match ranges.is_empty() {
        true => "none".to_owned(),
        false => ranges.iter().map(range).collect::<Vec<String>>().join(","),
    }
}
