//! A recording read again, as far as an export needs it.

use super::gaps::Gaps;
use super::messages::{TICK, Tick};
use std::path::Path;

/// The ticks of a recording, in the order in which they came.
pub struct Recording {
    pub ticks: Vec<Tick>,
    pub gaps: Gaps,
    /// Why reading ended before the end of the file, if it did: a recording that was cut off is still of use.
    pub cut_off: Option<String>,
}

/// Reads the ticks; refuses a file that holds none.
pub fn read(path: &Path) -> Result<Recording, String> {
    let told = |why: String| format!("{}: {why}", path.display());
    let bytes = std::fs::read(path).map_err(|e| told(e.to_string()))?;
    let options = enumset::EnumSet::only(mcap::read::Options::IgnoreEndMagic);
    let messages =
        mcap::MessageStream::new_with_options(&bytes, options).map_err(|e| told(format!("not an MCAP file ({e})")))?;
    let mut recording = Recording {
        ticks: Vec::new(),
        gaps: Gaps::default(),
        cut_off: None,
    };
    for message in messages {
        let message = match message {
            Ok(message) => message,
            Err(why) => {
                recording.cut_off = Some(why.to_string());
                break;
            }
        };
        if message.channel.topic != TICK.topic {
            continue;
        }
        let tick: Tick =
            serde_json::from_slice(&message.data).map_err(|e| told(format!("a tick that is none: {e}")))?;
        if recording.gaps.record(tick.session_id, tick.tick) {
            recording.ticks.push(tick);
        }
    }
    if recording.ticks.is_empty() {
        return Err(told("holds no tick of Stylet".to_owned()));
    }
    Ok(recording)
}
