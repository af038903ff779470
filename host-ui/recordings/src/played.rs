//! Reads a recording for a window: the core's messages, each with its time.

use crate::channels::Kind;
use crate::error::{RecordingError, ShowError};
use crate::messages;
use crate::stream;
use crate::{Piece, Played, Snapshot};
use std::path::Path;
use std::sync::Arc;
use stylet_base::interrupt::Interrupt;
use stylet_shm_schema::{SecondRecord, Session, SnapshotHeader, TickRecord, check};

/// Longest recording shown in full.
const MOST_BYTES: usize = 1 << 30;

/// Reads a recording of `host-ui record` for a window; refuses one without a scene.
pub fn played(path: &Path, interrupt: &Interrupt) -> Result<Played, RecordingError> {
    let bytes = stylet_base::input::read(path, MOST_BYTES as u64).map_err(|why| RecordingError::new(path, why))?;
    played_of(&bytes, interrupt).map_err(|why| RecordingError::new(path, why))
}

/// As [`played`], for the bytes of a file; the text of an error follows the name of the file.
pub fn played_of(bytes: &[u8], interrupt: &Interrupt) -> Result<Played, ShowError> {
    let mut reader = Reader::default();
    let cut_off = stream::each(bytes, |topic, time_ns, data| match interrupt.asked() {
        true => Err("reading was cancelled".to_owned()),
        false => reader.take(topic, time_ns, data),
    })?;
    reader.end(cut_off)
}

#[derive(Default)]
struct Reader {
    session: Option<Session>,
    pieces: Vec<(u64, Piece)>,
    header: Option<SnapshotHeader>,
    surface_m: Vec<[f32; 3]>,
    has_scene: bool,
    bytes: usize,
}

impl Reader {
    /// Takes a message, skipping unknown ones; the error says why reading ends.
    fn take(&mut self, topic: &str, time_ns: u64, data: &[u8]) -> Result<(), String> {
        self.bytes += data.len();
        if self.bytes > MOST_BYTES {
            return Err("it is too long to be shown whole".to_owned());
        }
        let damaged = || format!("a message of {topic} is damaged");
        let session_id = self.session.map_or(0, |session| session.session_id);
        let piece = match Kind::of(topic) {
            Some(Kind::Session) => {
                if self.session.is_none() {
                    self.session = Some(messages::session_of(data).ok_or_else(damaged)?);
                }
                return Ok(());
            }
            Some(Kind::Tick) => {
                let record: TickRecord = serde_json::from_slice(data).map_err(|_| damaged())?;
                if record.session_id != session_id {
                    return Err("another run of rt-core begins".to_owned());
                }
                check::record(&record).map_err(|_| damaged())?;
                Piece::Tick(Box::new(record))
            }
            Some(Kind::Event) => match messages::event_of(data).filter(|e| e.session_id == session_id) {
                Some(event) => Piece::Event(Box::new(event)),
                // Another version may have more kinds.
                None => return Ok(()),
            },
            Some(Kind::Second) => {
                let record: Option<SecondRecord> = serde_json::from_slice(data).ok();
                let record = record.filter(|r| r.session_id == session_id && check::second_record(r).is_ok());
                Piece::Second(Box::new(record.ok_or_else(damaged)?))
            }
            Some(Kind::State) => {
                let state = serde_json::from_slice(data)
                    .ok()
                    .filter(|state| check::state(state).is_ok());
                Piece::State(Box::new(state.ok_or_else(damaged)?))
            }
            Some(Kind::Scene) => {
                self.has_scene = true;
                Piece::Scene(Arc::new(messages::scene_of(data, session_id).ok_or_else(damaged)?))
            }
            Some(Kind::Plan) => {
                let plan = messages::plan_of(data, session_id).filter(|plan| check::plan(plan).is_ok());
                Piece::Plan(Box::new(plan.ok_or_else(damaged)?))
            }
            Some(Kind::Parameters) => {
                let found = messages::parameters_of(data, session_id).filter(|p| check::parameters(p).is_ok());
                Piece::Parameters(Box::new(found.ok_or_else(damaged)?))
            }
            Some(Kind::Tissue) => {
                self.header = Some(messages::tissue_of(data).ok_or_else(damaged)?);
                return Ok(());
            }
            Some(Kind::Gland) => {
                self.surface_m = messages::gland_of(data).ok_or_else(damaged)?;
                return Ok(());
            }
            Some(Kind::Field) => {
                let (scene_generation, displacements_m) = messages::field_of(data).ok_or_else(damaged)?;
                let header = self.header.take().ok_or_else(damaged)?;
                let header = SnapshotHeader {
                    scene_generation,
                    ..header
                };
                let surface_m = std::mem::take(&mut self.surface_m);
                let snapshot = Snapshot::of_parts(header, surface_m, displacements_m);
                Piece::Snapshot(Box::new(snapshot.ok_or_else(damaged)?))
            }
            None => return Ok(()),
        };
        self.pieces.push((time_ns, piece));
        Ok(())
    }

    fn end(mut self, cut_off: Option<String>) -> Result<Played, ShowError> {
        let Some(session) = self.session.filter(|_| self.has_scene) else {
            return Err(cut_off.map_or(ShowError::NoScene, ShowError::Damaged));
        };
        // The receiving thread takes states and snapshots slightly later than ticks.
        self.pieces.sort_by_key(|(time_ns, _)| *time_ns);
        let first_ns = self.pieces.iter().find(|(_, piece)| matches!(piece, Piece::Tick(_)));
        let first_ns = first_ns.map_or(0, |(time_ns, _)| *time_ns);
        for (time_ns, _) in &mut self.pieces {
            *time_ns = time_ns.saturating_sub(first_ns);
        }
        Ok(Played {
            session,
            pieces: self.pieces,
            cut_off,
        })
    }
}
