//! The folders of a class: one for each trainee, with one for each procedure and its `score.json`.

use super::Attempt;
use serde_json::Value;
use std::path::{Path, PathBuf};
use stylet_files::bytes::file_name;
use stylet_host::moments::{MomentKind, STOPPED};

/// Largest size of a score.
const MOST_BYTES: u64 = 16 << 20;

/// Error of folders that cannot be read, or are empty.
#[derive(Debug, thiserror::Error)]
pub enum ClassError {
    /// A folder that cannot be listed.
    #[error("{}: {why}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Message of the system.
        why: std::io::Error,
    },
    /// No debrief in any of them.
    #[error("no debrief: a class folder has NAME/DATE/score.json, as 'host-ui --class DIR --name NAME' writes them{0}")]
    Empty(String),
}

/// Result of reading class folders.
#[derive(Debug, Default)]
pub struct Class {
    /// Attempts by trainee, then in the order of the sessions.
    pub attempts: Vec<Attempt>,
    /// Files that were left out, with reasons.
    pub left_out: Vec<String>,
}

impl Class {
    /// Reads class folders. Leaves out a file that is not a debrief, with a note.
    pub fn read(folders: &[PathBuf]) -> Result<Self, ClassError> {
        let mut class = Self::default();
        for folder in folders {
            for trainee in folders_in(folder)? {
                for session in folders_in(&trainee)? {
                    class.take(&trainee, &session);
                }
            }
        }
        if class.attempts.is_empty() {
            let left_out = class.left_out.iter().map(|why| format!("\n{why}"));
            return Err(ClassError::Empty(left_out.collect()));
        }
        let key = |a: &Attempt| (a.trainee.clone(), a.session.clone());
        class.attempts.sort_by_key(key);
        Ok(class)
    }

    fn take(&mut self, trainee: &Path, session: &Path) {
        let file = session.join("score.json");
        if !file.exists() {
            return;
        }
        let read = stylet_base::input::read(&file, MOST_BYTES).map_err(|why| why.to_string());
        let value = read.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|why| why.to_string()));
        let attempt = value.and_then(|value| attempt(&value).ok_or_else(|| "no debrief of Stylet".to_owned()));
        match attempt {
            Ok(attempt) => {
                self.attempts.push(Attempt {
                    trainee: file_name(trainee),
                    session: file_name(session),
                    ..attempt
                });
            }
            Err(why) => self.left_out.push(format!("{}: {why}", file.display())),
        }
    }

    /// Returns the names of the trainees with their attempts, in the order of the sessions.
    pub fn trainees(&self) -> Vec<(&str, &[Attempt])> {
        let each = self.attempts.chunk_by(|a, b| a.trainee == b.trainee);
        each.map(|own| (own[0].trainee.as_str(), own)).collect()
    }
}

fn folders_in(folder: &Path) -> Result<Vec<PathBuf>, ClassError> {
    let failed = |why| ClassError::Folder {
        folder: folder.to_owned(),
        why,
    };
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let mut all: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    all.sort();
    Ok(all)
}

/// Reads the output of `score::to_json`; older versions have no moments.
fn attempt(score: &Value) -> Option<Attempt> {
    let number = |value: &Value| value.as_f64().filter(|v| v.is_finite());
    let delivered = &score["delivered"];
    let target = delivered["target"]["name"].as_str()?;
    let structures = delivered["structures"].as_array()?;
    let metrics = &structures.iter().find(|s| s["name"].as_str() == Some(target))?["metrics"];
    let prescription_gy = number(&score["prescription_gy"]).filter(|gy| *gy > 0.0)?;
    let motion = &score["motion"];
    let moments = score["moments"].as_array().map_or(&[][..], Vec::as_slice);
    let count = |kind: MomentKind, is: fn(&str) -> bool| {
        let of_kind = moments.iter().filter(|m| m["kind"].as_str() == Some(kind.name()));
        of_kind.filter(|m| is(m["text"].as_str().unwrap_or(""))).count() as u64
    };
    Some(Attempt {
        title: score["title"].as_str().unwrap_or_default().to_owned(),
        mean_error_mm: number(&score["mean_error_mm"])?,
        worst_error_mm: number(&score["worst_error_mm"])?,
        seeds: [score["seeds_planned"].as_u64()?, score["seeds_lost"].as_u64()?],
        d90_percent: number(&metrics["D90"]).map(|gy| 100.0 * gy / prescription_gy),
        v100_percent: number(&metrics["V100"]),
        duration_s: number(&motion["duration_s"])?,
        peak_force_n: number(&motion["peak_force_n"])?,
        stops: count(MomentKind::Mark, |text| text == STOPPED),
        faults: count(MomentKind::Fault, |_| true),
        exercises: count(MomentKind::Exercise, |text| text != "all exercises ended"),
        ..Attempt::default()
    })
}
