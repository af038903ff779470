//! `rtla timerlat hist`: the kernel's own measurement of how late a thread wakes.

use super::{CompareError, ToolError, wait};
use crate::load::Running;
use crate::machine::Machine;
use crate::measure::Setup;
use crate::sample::histogram;
use hdrhistogram::Histogram;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;

/// The program as people start it.
pub const PROGRAM: &str = "rtla";
/// Bins of one microsecond.
const BINS: u64 = 10_000;

/// First line of its help; `None` where it is not installed.
pub fn version() -> Option<String> {
    let output = Command::new(PROGRAM).arg("--version").output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    Some(text.lines().next().unwrap_or("rtla").trim().to_owned())
}

/// Why this kernel cannot do it, where its configuration can be read.
pub fn missing(machine: &Machine) -> Option<&'static str> {
    // A kernel that says nothing of itself may have the tracer.
    machine.build_option("TRACEPOINTS")?;
    let built = machine.build_option("TIMERLAT_TRACER").as_deref() == Some("y");
    (!built).then_some("this kernel has no timerlat tracer (CONFIG_TIMERLAT_TRACER): there is nothing to compare with")
}

/// One turn; wake-ups of its thread.
pub fn turn(setup: &Setup, interrupted: &AtomicBool) -> Result<Histogram<u64>, CompareError> {
    let load = Running::start(setup.load, &setup.options.instance, setup.folder)?;
    let file = setup.folder.join("timerlat.tmp");
    let out = std::fs::File::create(&file).map_err(|why| ToolError::Wait { program: PROGRAM, why })?;
    let mut child = Command::new(PROGRAM)
        .args(arguments(setup))
        .stdout(out)
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|why| ToolError::Start { program: PROGRAM, why })?;
    let ended = wait(PROGRAM, &mut child, interrupted);
    drop(load);
    setup.options.instance.sweep();
    let text = std::fs::read_to_string(&file).unwrap_or_default();
    let _ = std::fs::remove_file(&file);
    ended?;
    Ok(read(&text).ok_or(ToolError::NoHistogram(PROGRAM))?)
}

fn arguments(setup: &Setup) -> Vec<String> {
    let options = setup.options;
    let mut words = vec!["timerlat".to_owned(), "hist".to_owned(), "--no-irq".to_owned()];
    let mut add = |flag: &str, value: String| words.extend([flag.to_owned(), value]);
    add("-p", (options.haptic_period_ns / 1_000).to_string());
    add("-d", format!("{}s", (setup.duration_ns / 1_000_000_000).max(1)));
    add("-b", "1".to_owned());
    add("-E", BINS.to_string());
    if !options.no_rt {
        add("-P", format!("f:{}", options.haptic_priority));
    }
    if let Some(core) = options.haptic_core {
        add("-c", core.to_string());
    }
    words
}

/// Rows of `microseconds count ...` below a head that names the columns; `over` are those past the last bin, `max` the latest.
fn read(text: &str) -> Option<Histogram<u64>> {
    let mut h = histogram();
    let head = text.lines().find(|l| l.trim_start().starts_with("Index"))?;
    let column = head.split_whitespace().position(|c| c.starts_with("Thr"))?;
    let (mut over, mut max_us) = (0, BINS);
    for line in text.lines().skip_while(|l| *l != head).skip(1) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (Some(first), Some(value)) = (words.first(), words.get(column).and_then(|v| v.parse::<u64>().ok())) else {
            continue;
        };
        match *first {
            "over:" => over = value,
            "max:" => max_us = value,
            bin => {
                if let Ok(us) = bin.parse::<u64>() {
                    // The middle of the bin.
                    h.saturating_record_n(us * 1_000 + 500, value);
                }
            }
        }
    }
    h.saturating_record_n(max_us * 1_000, over);
    (!h.is_empty()).then_some(h)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histogram_of_timerlat_is_read_with_what_lies_past_its_end() {
        let text = "# RTLA timerlat histogram\n# Time unit is microseconds (us)\n# Duration:   0 00:00:10\nIndex   IRQ-001   Thr-001\n\
                    0         900         0\n4          99       600\n12          1       399\nover:       0         1\ncount:   1000      1000\n\
                    min:        0         4\navg:        0         6\nmax:       12     15000\n";
        let h = read(text).expect("a histogram");
        assert_eq!(h.len(), 1_000);
        assert_eq!(h.value_at_quantile(0.5), h.highest_equivalent(4_500));
        assert_eq!(h.max(), h.highest_equivalent(15_000_000));
        assert!(read("no histogram").is_none());
    }
}
