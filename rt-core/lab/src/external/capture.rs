//! A capture of a logic analyser as times of edges, in the CSV of sigrok.

use std::path::Path;

/// One input of the instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub name: String,
    /// Seconds of the instrument's clock at which the input changed, in the order of time.
    pub edges_s: Vec<f64>,
}

/// All inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
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

/// Most channels of a capture.
const MOST_CHANNELS: usize = 64;

pub fn read(path: &Path) -> Result<Capture, CaptureError> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let capture = csv(&text)?;
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
        step_s: 1.0 / rate_hz,
        channels,
    })
}

fn channel(name: &str) -> Channel {
    Channel {
        name: name.to_owned(),
        edges_s: Vec::new(),
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
