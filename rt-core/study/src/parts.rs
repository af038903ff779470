//! Finished parts of a shard: a file for each implant while it is under way, one file when all are done.

use crate::definition::Study;
use crate::error::StudyError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_insertions::{About, FILE_ENDING, Insertion, Shard, Table, read, write};

/// The shard's place in the folder of the study.
pub struct Parts {
    folder: PathBuf,
    whole: PathBuf,
    about: About,
    quantities: Vec<String>,
}

impl Parts {
    /// Checks that nothing in the folder is of another study or divided otherwise; creates what is missing.
    pub fn open(study: &Study, shard: Shard, folder: &Path) -> Result<Self, StudyError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| StudyError::Folder { path, source }
        };
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        for entry in std::fs::read_dir(folder).map_err(failed(folder))? {
            let entry = entry.map_err(failed(folder))?;
            let found = entry.file_name().to_str().and_then(Shard::of_name);
            if let Some(found) = found.filter(|found| found.of != shard.of) {
                return Err(StudyError::OtherDivision {
                    path: entry.path(),
                    found: found.of,
                    asked: shard.of,
                });
            }
        }
        Ok(Self {
            folder: folder.join(shard.name()),
            whole: shard.file(folder),
            about: About {
                study: study.name.clone(),
                fingerprint: study.fingerprint.clone(),
                definition: study.text.clone(),
                made_by: format!("stylet rt-core {}", env!("CARGO_PKG_VERSION")),
            },
            quantities: study.columns(),
        })
    }

    /// Returns the finished shard, if it is.
    pub fn finished(&self) -> Result<Option<Table>, StudyError> {
        if !self.whole.exists() {
            return Ok(None);
        }
        Ok(Some(self.ours(&self.whole)?))
    }

    /// Implants that are done, by their place in the study.
    pub fn done(&self) -> Result<BTreeMap<usize, Vec<Insertion>>, StudyError> {
        let failed = |source| StudyError::Folder {
            path: self.folder.clone(),
            source,
        };
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        let mut done = BTreeMap::new();
        for entry in std::fs::read_dir(&self.folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if let Some(place) = place_of(&path) {
                done.insert(place, self.ours(&path)?.rows);
            }
        }
        Ok(done)
    }

    /// Keeps the insertions of one implant.
    pub fn keep(&self, place: usize, rows: Vec<Insertion>) -> Result<(), StudyError> {
        let path = self.folder.join(format!("implant-{place:07}.{FILE_ENDING}"));
        Ok(write(&path, &self.table(rows))?)
    }

    /// Makes one file of all, in the order of the study, and removes the others.
    pub fn finish(&self) -> Result<Table, StudyError> {
        let table = self.table(self.done()?.into_values().flatten().collect());
        write(&self.whole, &table)?;
        // The shard is complete without this.
        let _ = std::fs::remove_dir_all(&self.folder);
        Ok(table)
    }

    fn table(&self, rows: Vec<Insertion>) -> Table {
        Table {
            about: self.about.clone(),
            quantities: self.quantities.clone(),
            rows,
        }
    }

    fn ours(&self, path: &Path) -> Result<Table, StudyError> {
        let table = read(path)?;
        if table.about.fingerprint != self.about.fingerprint {
            return Err(StudyError::OtherStudy(path.to_owned()));
        }
        Ok(table)
    }
}

fn place_of(path: &Path) -> Option<usize> {
    let ours = path.extension().is_some_and(|ending| ending == FILE_ENDING);
    let stem = path.file_stem().filter(|_| ours)?.to_str()?;
    stem.strip_prefix("implant-")?.parse().ok()
}
