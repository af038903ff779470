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

/// Reason why a capture cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// The file does not tell the rate of its rows.
    #[error("no line `; Samplerate: 1 MHz`: sigrok-cli writes it into its CSV")]
    NoRate,
    /// A row that holds other than levels.
    #[error("{0:?} is no row of 0 and 1")]
    NoRow(String),
    /// A row of another length than the first.
    #[error("row {row} has {values} values, expected {inputs}")]
    RowLength {
        /// Number of the row, from 1.
        row: u64,
        /// Its values.
        values: usize,
        /// Inputs of the capture.
        inputs: usize,
    },
    /// No input changes.
    #[error("no input ever changes")]
    NoEdge,
    /// Too short a capture or run.
    #[error("{edges} edges and {toggles} toggles; expected at least {fewest} of each")]
    TooFew {
        /// Edges of the input.
        edges: usize,
        /// Toggles of the loop.
        toggles: usize,
        /// Smallest number of each.
        fewest: usize,
    },
    /// The capture is of another run.
    #[error("not a capture of this run: at best {same} of {of} times between edges agree with those between toggles")]
    OtherRun {
        /// Times that agree.
        same: usize,
        /// Times compared.
        of: usize,
    },
    /// No input is the pin; the reason for each.
    #[error("{}", .0.iter().map(|(name, why)| format!("{name}: {why}")).collect::<Vec<_>>().join("; "))]
    NoPin(Vec<(String, CaptureError)>),
    /// No other input has that name.
    #[error("{name:?} is no input beside the pin; there are {}", .inputs.join(", "))]
    NoInput {
        /// The name.
        name: String,
        /// Names of all inputs.
        inputs: Vec<String>,
    },
    /// An input that does not follow another.
    #[error("{to}: {answers} answers to {edges} edges of {from}; expected one to most of them, and {fewest} at least")]
    NoAnswer {
        /// Name of the input.
        to: String,
        /// Its edges that follow one of the other.
        answers: usize,
        /// Name of the other input.
        from: String,
        /// Edges of the other input.
        edges: usize,
        /// Smallest number of answers.
        fewest: usize,
    },
}

/// Most channels of a capture.
const MOST_CHANNELS: usize = 64;

pub fn read(path: &Path) -> Result<Capture, CaptureError> {
    let text = std::fs::read_to_string(path)?;
    let capture = csv(&text)?;
    if capture.channels.iter().all(|c| c.edges_s.is_empty()) {
        return Err(CaptureError::NoEdge);
    }
    Ok(capture)
}

/// Returns the rows of 0 and 1 at the rate of the comment `; Samplerate: 1 MHz`.
pub fn csv(text: &str) -> Result<Capture, CaptureError> {
    let comments = text.lines().filter_map(|l| l.strip_prefix([';', '#']));
    let rate_hz = comments
        .filter_map(|c| c.trim().split_once("amplerate:"))
        .find_map(|(_, rate)| frequency(rate.trim()))
        .ok_or(CaptureError::NoRate)?;
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
                return Err(CaptureError::NoRow(line.to_owned()));
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
            return Err(CaptureError::RowLength {
                row: row + 1,
                values: now.len(),
                inputs: channels.len(),
            });
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
