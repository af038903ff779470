//! Raw data of a measurement, from which every figure of its report is computed again: histograms by name, and wake-ups
//! of the force loop in the order of time.

use crate::compare::Comparison;
use crate::measure::Measured;
use crate::noise;
use crate::paired::{BOTH, LOOP_ALONE, WITNESS};
use crate::sample::{PARTS, histogram};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, IntervalLogWriterBuilder, LogEntry, Tag};
use hdrhistogram::serialization::{Deserializer, V2DeflateSerializer};
use std::fmt::Debug;
use std::time::{Duration, SystemTime};

/// Most histograms of a report; a forged file may hold any number.
const MOST: usize = 1_000;
/// Most wake-ups of a series.
const LONGEST_SERIES: usize = 1 << 20;
const WAKES_HEAD: &str = "wake-ups in ns, one every so many ticks,";

/// Raw data that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RawError {
    #[error("the histograms cannot be written: {0}")]
    Write(String),
    #[error("line {line}: {why}")]
    Log { line: usize, why: String },
    #[error("not a series of wake-ups, as a measurement writes it")]
    Wakes,
}

/// All histograms with their names, such as `haptic/wake` and `haptic/wake/part_1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Raw {
    /// When the measurement began, whole seconds since 1970.
    pub began_s: u64,
    histograms: Vec<(String, Histogram<u64>)>,
    /// Wake-ups of the force loop in ns, `stride` ticks apart.
    pub series: Vec<u64>,
    pub stride: u64,
}

impl Raw {
    /// Returns these histograms alone.
    pub fn with(histograms: Vec<(String, Histogram<u64>)>) -> Self {
        Self {
            began_s: 0,
            histograms,
            series: Vec::new(),
            stride: 1,
        }
    }

    /// Gathers the data of a measurement.
    pub fn of(measured: &Measured, comparison: Option<&Comparison>) -> Self {
        let mut all: Vec<(String, Histogram<u64>)> = Vec::new();
        let second = measured.second.as_ref().map(|timing| ("second", timing));
        let loops = [("haptic", &measured.haptic), ("tissue", &measured.tissue)];
        for (name, timing) in loops.into_iter().chain(second) {
            for (what, batched) in timing.all() {
                let name = format!("{name}/{}", what.replace(' ', "_"));
                all.push((name.clone(), batched.whole.clone()));
                let parts = (1..).zip(&batched.parts);
                all.extend(parts.map(|(i, part)| (format!("{name}/part_{i}"), part.clone())));
            }
        }
        let host = &measured.host;
        for (name, batched) in [
            ("tip_to_host", &host.tip_to_host),
            ("tissue_to_host", &host.tissue_to_host),
        ] {
            all.push((format!("host/{name}"), batched.whole.clone()));
            let parts = (1..).zip(&batched.parts);
            all.extend(parts.map(|(i, part)| (format!("host/{name}/part_{i}"), part.clone())));
        }
        if let Some(paired) = &measured.paired {
            let [loop_alone, both] = paired.sort(&measured.haptic.late_wakes);
            let named = [(WITNESS, paired.wake.clone()), (LOOP_ALONE, loop_alone), (BOTH, both)];
            all.extend(named.map(|(name, h)| (name.to_owned(), h)));
        }
        all.push(("gap_watch/gaps".to_owned(), measured.gaps.gaps.clone()));
        all.push(("gap_watch/wake".to_owned(), measured.gaps.wake.clone()));
        if let Some(noise) = &measured.noise {
            all.push((noise::GAPS.to_owned(), noise.seen.gaps.clone()));
            all.push((noise::SWITCHED.to_owned(), noise.seen.switched.clone()));
        }
        if let Some(comparison) = comparison {
            all.push(("comparison/ours".to_owned(), comparison.ours.clone()));
            all.push(("comparison/other".to_owned(), comparison.others.clone()));
        }
        let sample = &measured.haptic.sample;
        Self {
            began_s: measured.began_s,
            histograms: all,
            series: sample.series.clone(),
            stride: sample.stride,
        }
    }

    /// Returns a histogram; without one of that name, an empty one.
    pub fn get(&self, name: &str) -> Histogram<u64> {
        let found = self.histograms.iter().find(|(n, _)| n == name);
        found.map_or_else(histogram, |(_, h)| h.clone())
    }

    /// Returns the histograms of the parts of the run.
    pub fn parts(&self, name: &str) -> Vec<Histogram<u64>> {
        (1..=PARTS).map(|i| self.get(&format!("{name}/part_{i}"))).collect()
    }

    /// Returns the names of one loop's histograms without `NAME/`, in the order of the report.
    pub fn of_loop<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        let below = self
            .histograms
            .iter()
            .filter_map(move |(n, _)| n.strip_prefix(name)?.strip_prefix('/'));
        below.filter(|n| !n.contains('/'))
    }

    /// Returns the histograms in HdrHistogram's interval log format, nanoseconds, one line each.
    pub fn log(&self, measured_s: f64) -> Result<Vec<u8>, RawError> {
        let failed = |e: &dyn Debug| RawError::Write(format!("{e:?}"));
        let mut bytes = Vec::new();
        let mut serializer = V2DeflateSerializer::new();
        let mut log = IntervalLogWriterBuilder::new()
            .add_comment("nanoseconds")
            .with_start_time(SystemTime::UNIX_EPOCH + Duration::from_secs(self.began_s))
            .with_max_value_divisor(1e3)
            .begin_log_with(&mut bytes, &mut serializer)
            .map_err(|e| failed(&e))?;
        let length = Duration::from_secs_f64(measured_s);
        for (name, h) in &self.histograms {
            let tag = Tag::new(name).ok_or_else(|| failed(name))?;
            log.write_histogram(h, Duration::ZERO, length, Some(tag))
                .map_err(|e| failed(&e))?;
        }
        Ok(bytes)
    }

    /// Returns the series of wake-ups as text: a line that says how far apart they are, then one line each.
    pub fn wakes(&self) -> String {
        let lines = self.series.iter().map(|ns| format!("{ns}\n"));
        format!("{WAKES_HEAD}{}\n", self.stride) + &lines.collect::<String>()
    }

    /// Reads what [`Raw::log`] and [`Raw::wakes`] wrote.
    pub fn read(log: &[u8], wakes: &[u8]) -> Result<Self, RawError> {
        let (stride, series) = read_wakes(wakes).ok_or(RawError::Wakes)?;
        let mut raw = Self {
            began_s: 0,
            histograms: Vec::new(),
            series,
            stride,
        };
        let mut deserializer = Deserializer::new();
        for (line, entry) in (1..).zip(IntervalLogIterator::new(log)) {
            let wrong = |why: String| RawError::Log { line, why };
            match entry.map_err(|e| wrong(format!("{e:?}")))? {
                LogEntry::StartTime(since_1970) => raw.began_s = since_1970.as_secs(),
                LogEntry::BaseTime(_) => {}
                LogEntry::Interval(interval) => {
                    let bytes = BASE64_STANDARD.decode(interval.encoded_histogram());
                    let bytes = bytes.map_err(|e| wrong(e.to_string()))?;
                    let h: Histogram<u64> = deserializer
                        .deserialize(&mut bytes.as_slice())
                        .map_err(|e| wrong(format!("{e:?}")))?;
                    let bounds = |h: &Histogram<u64>| (h.low(), h.high(), h.sigfig());
                    if bounds(&h) != bounds(&histogram()) || raw.histograms.len() == MOST {
                        return Err(wrong("not a histogram of a measurement".to_owned()));
                    }
                    let name = interval.tag().map_or("", |tag| tag.as_str()).to_owned();
                    if raw.histograms.iter().any(|(n, _)| *n == name) {
                        return Err(wrong(format!("a second histogram called {name:?}")));
                    }
                    raw.histograms.push((name, h));
                }
            }
        }
        Ok(raw)
    }
}

fn read_wakes(bytes: &[u8]) -> Option<(u64, Vec<u64>)> {
    let mut lines = std::str::from_utf8(bytes).ok()?.lines();
    let stride = lines
        .next()?
        .strip_prefix(WAKES_HEAD)?
        .parse()
        .ok()
        .filter(|s| *s > 0)?;
    let series: Vec<u64> = lines
        .take(LONGEST_SERIES)
        .map(|l| l.parse().ok())
        .collect::<Option<_>>()?;
    Some((stride, series))
}
