//! A capture of an instrument as times of edges: logic analysers as CSV or VCD of sigrok, sound cards as WAV.

use std::path::Path;

/// One input of the instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub name: String,
    /// Seconds of the instrument's clock at which the input changed, in the order of time.
    pub edges_s: Vec<f64>,
    /// Rise time of an edge, from a tenth to nine tenths; 0 for a logic input.
    pub rise_s: f64,
}

/// All inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    pub kind: &'static str,
    /// Time between two samples.
    pub step_s: f64,
    pub channels: Vec<Channel>,
}

/// Reason why a capture cannot be used; for people.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct CaptureError(String);

impl From<String> for CaptureError {
    fn from(why: String) -> Self {
        Self(why)
    }
}

impl From<&str> for CaptureError {
    fn from(why: &str) -> Self {
        Self(why.to_owned())
    }
}

/// Hysteresis around half of the range at which a sound card's samples count as edges, relative to the range.
const HYSTERESIS: f64 = 0.15;
/// Most channels of a capture.
const MOST_CHANNELS: usize = 64;

/// Reads a capture in the format that its first bytes indicate.
pub fn read(path: &Path) -> Result<Capture, CaptureError> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let capture = if bytes.starts_with(b"RIFF") {
        wav(&bytes)
    } else {
        let text = String::from_utf8(bytes).map_err(|_| "neither WAV nor text".to_owned())?;
        if text.contains("$timescale") {
            vcd(&text)
        } else {
            csv(&text)
        }
    }?;
    if capture.channels.iter().all(|c| c.edges_s.is_empty()) {
        return Err("no input ever changes".into());
    }
    Ok(capture)
}

/// Returns the rows of 0 and 1 at the rate of the comment `; Samplerate: 1 MHz`.
pub fn csv(text: &str) -> Result<Capture, CaptureError> {
    let comments = text.lines().filter_map(|l| l.strip_prefix([';', '#']));
    let rate_hz = comments
        .filter_map(|c| c.trim().split_once("amplerate:"))
        .find_map(|(_, rate)| frequency(rate.trim()))
        .ok_or("no line `; Samplerate: 1 MHz`: sigrok-cli writes it into its CSV")?;
    let mut channels: Vec<Channel> = Vec::new();
    let mut levels: Vec<bool> = Vec::new();
    let mut row = 0_u64;
    for line in text
        .lines()
        .filter(|l| !l.starts_with([';', '#']) && !l.trim().is_empty())
    {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let Some(now) = cells.iter().map(|c| level(c)).collect::<Option<Vec<bool>>>() else {
            // The head names the channels.
            if row > 0 || !channels.is_empty() {
                return Err(format!("{line:?} is no row of 0 and 1").into());
            }
            channels = cells.iter().take(MOST_CHANNELS).map(|name| channel(name)).collect();
            continue;
        };
        if channels.is_empty() {
            channels = (0..now.len().min(MOST_CHANNELS))
                .map(|i| channel(&format!("D{i}")))
                .collect();
        }
        if now.len() != channels.len() {
            return Err(format!("row {} has {} values, expected {}", row + 1, now.len(), channels.len()).into());
        }
        for (i, channel) in channels.iter_mut().enumerate() {
            if levels.get(i).is_some_and(|before| *before != now[i]) {
                channel.edges_s.push(row as f64 / rate_hz);
            }
        }
        levels = now;
        row += 1;
    }
    Ok(Capture {
        kind: "sigrok CSV",
        step_s: 1.0 / rate_hz,
        channels,
    })
}

fn channel(name: &str) -> Channel {
    Channel {
        name: name.to_owned(),
        edges_s: Vec::new(),
        rise_s: 0.0,
    }
}

fn level(cell: &str) -> Option<bool> {
    match cell {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    }
}

/// Reads `1 MHz`, `24MHz`, `500 kHz`, in hertz.
fn frequency(text: &str) -> Option<f64> {
    let end = text
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(text.len());
    let value: f64 = text[..end].parse().ok()?;
    let factor = match text[end..].trim() {
        "Hz" | "" => 1.0,
        "kHz" => 1e3,
        "MHz" => 1e6,
        "GHz" => 1e9,
        _ => return None,
    };
    (value > 0.0).then_some(value * factor)
}

/// Reads a value change dump: `#time` and `0!` or `1!` for each wire.
pub fn vcd(text: &str) -> Result<Capture, CaptureError> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let place = words.iter().position(|w| *w == "$timescale").ok_or("no $timescale")?;
    let scale: String = words[place + 1..]
        .iter()
        .take_while(|w| **w != "$end")
        .copied()
        .collect();
    let unit_s = seconds(&scale).ok_or_else(|| format!("$timescale {scale:?} is no time"))?;
    let mut ids: Vec<String> = Vec::new();
    let mut capture = Capture {
        kind: "VCD",
        step_s: unit_s,
        channels: Vec::new(),
    };
    let mut levels: Vec<Option<bool>> = Vec::new();
    let (mut time, mut i) = (0_u64, 0);
    while i < words.len() {
        let word = words[i];
        if word == "$var" {
            // $var wire 1 ! D0 $end
            let (Some(id), Some(name)) = (words.get(i + 3), words.get(i + 4)) else {
                return Err("$var without its name".into());
            };
            if ids.len() < MOST_CHANNELS {
                ids.push((*id).to_owned());
                capture.channels.push(channel(name));
                levels.push(None);
            }
            i += 4;
        } else if let Some(at) = word.strip_prefix('#') {
            time = at.parse().map_err(|_| format!("{word:?} is no time"))?;
        } else if let Some((value, id)) = word.split_at_checked(1)
            && let Some(now) = level(value)
            && let Some(k) = ids.iter().position(|known| known == id)
        {
            if levels[k].is_some_and(|before| before != now) {
                capture.channels[k].edges_s.push(time as f64 * unit_s);
            }
            levels[k] = Some(now);
        }
        i += 1;
    }
    Ok(capture)
}

/// Reads `1us`, `10ns`, in seconds.
fn seconds(text: &str) -> Option<f64> {
    let end = text.find(|c: char| !c.is_ascii_digit())?;
    let value: f64 = text[..end].parse().ok()?;
    let unit = match &text[end..] {
        "s" => 1.0,
        "ms" => 1e-3,
        "us" => 1e-6,
        "ns" => 1e-9,
        "ps" => 1e-12,
        _ => return None,
    };
    (value > 0.0).then_some(value * unit)
}

/// Reads samples of 16 bits; an edge is where they cross the middle of their range, linearly interpolated.
pub fn wav(bytes: &[u8]) -> Result<Capture, CaptureError> {
    let number = |at: usize, length: usize| -> Option<u32> {
        let field = bytes.get(at..at + length)?;
        Some(field.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)))
    };
    let (mut at, mut format, mut data) = (12, None, None);
    while let (Some(name), Some(length)) = (bytes.get(at..at + 4), number(at + 4, 4)) {
        let begin = at + 8;
        match name {
            b"fmt " => {
                format = Some((
                    number(begin, 2),
                    number(begin + 2, 2),
                    number(begin + 4, 4),
                    number(begin + 14, 2),
                ))
            }
            // A recorder that was stopped leaves a length past the end.
            b"data" => data = Some(&bytes[begin..(begin + length as usize).min(bytes.len())]),
            _ => {}
        }
        at = begin
            .saturating_add(length as usize)
            .saturating_add(length as usize % 2);
    }
    let Some((Some(1 | 0xfffe), Some(channels), Some(rate), Some(16))) = format else {
        return Err("expected WAV of 16 bits without compression".into());
    };
    let (Some(data), true) = (data, channels > 0 && channels as usize <= MOST_CHANNELS && rate > 0) else {
        return Err("a WAV without samples".into());
    };
    let channels = channels as usize;
    let sample = |pair: &[u8]| f64::from(i16::from_le_bytes([pair[0], pair[1]]));
    let of_channel = |c: usize| -> Vec<f64> {
        data.chunks_exact(2 * channels)
            .map(|f| sample(&f[2 * c..2 * c + 2]))
            .collect()
    };
    let step_s = 1.0 / f64::from(rate);
    Ok(Capture {
        kind: "WAV",
        step_s,
        channels: (0..channels).map(|c| crossings(&of_channel(c), step_s, c)).collect(),
    })
}

fn crossings(samples: &[f64], step_s: f64, number: usize) -> Channel {
    let mut channel = channel(&format!("channel {}", number + 1));
    let low = samples.iter().copied().fold(f64::MAX, f64::min);
    let range = samples.iter().copied().fold(f64::MIN, f64::max) - low;
    // A few steps of the converter are noise.
    if range <= 64.0 {
        return channel;
    }
    let middle = low + range / 2.0;
    let mut level: Option<bool> = None;
    let mut crossed_s = None;
    let mut rises = Vec::new();
    let mut left = 0;
    for i in 1..samples.len() {
        let (a, b) = (samples[i - 1], samples[i]);
        if (a < middle) != (b < middle) {
            crossed_s = Some((i as f64 - 1.0 + (middle - a) / (b - a)) * step_s);
        }
        let now = match b {
            b if b > middle + HYSTERESIS * range => true,
            b if b < middle - HYSTERESIS * range => false,
            _ => continue,
        };
        if level.is_some_and(|before| before != now)
            && let Some(at_s) = crossed_s
        {
            channel.edges_s.push(at_s);
            // From a tenth to nine tenths, at the slope between these two samples.
            let part = (b - samples[left]).abs() / range;
            rises.push((i - left) as f64 * step_s * 0.8 / part);
        }
        (level, left) = (Some(now), i);
    }
    channel.rise_s = rises.iter().sum::<f64>() / rises.len().max(1) as f64;
    channel
}
