//! Reads the ticks of a recording.

use crate::channels::Kind;
use crate::error::{FileProblem, RecordingError};
use crate::gaps::Gaps;
use crate::stream;
use std::path::Path;
use stylet_shm_schema::{SecondRecord, TickRecord};

/// The ticks of a recording, in the order in which they arrived.
pub struct Recording {
    /// The ticks, without repetitions.
    pub ticks: Vec<TickRecord>,
    /// Ticks of the second device.
    pub second: Vec<SecondRecord>,
    /// Missing ticks.
    pub gaps: Gaps,
    /// Why reading ended before the end of the file, if it did: a truncated recording is still usable.
    pub cut_off: Option<String>,
}

/// Reads the ticks; refuses a file that holds none.
pub fn read(path: &Path) -> Result<Recording, RecordingError> {
    let bytes = std::fs::read(path).map_err(|e| RecordingError::new(path, FileProblem::Io(e)))?;
    let mut recording = Recording {
        ticks: Vec::new(),
        second: Vec::new(),
        gaps: Gaps::default(),
        cut_off: None,
    };
    let cut_off = stream::each(&bytes, |topic, _, data| {
        match Kind::of(topic) {
            Some(Kind::Tick) => {
                let tick: TickRecord = serde_json::from_slice(data).map_err(|e| format!("invalid tick: {e}"))?;
                if recording.gaps.record(tick.session_id, tick.tick) {
                    recording.ticks.push(tick);
                }
            }
            Some(Kind::Second) => recording
                .second
                .extend(serde_json::from_slice::<SecondRecord>(data).ok()),
            _ => {}
        }
        Ok(())
    });
    recording.cut_off = cut_off.map_err(|why| RecordingError::new(path, why))?;
    if recording.ticks.is_empty() {
        return Err(RecordingError::new(path, FileProblem::NoTick));
    }
    Ok(recording)
}
