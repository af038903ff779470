//! All finished shards of a study as one table.

use crate::error::PopulationError;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use stylet_insertions::{Table, digest, read, shard_files};

/// Every insertion of a folder.
pub struct Population {
    /// Rows in the order of the study.
    pub table: Table,
    /// Number of finished shards, and total number.
    pub shards: [u32; 2],
    /// SHA-256 of the rows.
    pub digest: String,
    /// Files that were read.
    pub files: Vec<PathBuf>,
}

/// Reads the finished shards of a folder.
///
/// # Errors
///
/// If there is none, one is damaged, or two do not belong together.
pub fn load(folder: &Path) -> Result<Population, PopulationError> {
    let found = shard_files(folder)?;
    let Some((first_shard, first)) = found.first().cloned() else {
        return Err(PopulationError::Empty(folder.to_owned()));
    };
    if let Some((other, _)) = found.iter().find(|(shard, _)| shard.of != first_shard.of) {
        return Err(PopulationError::OtherDivision {
            folder: folder.to_owned(),
            first: first_shard,
            other: *other,
        });
    }
    let mut table = Table::default();
    for (n, (_, path)) in found.iter().enumerate() {
        let shard = read(path)?;
        if n == 0 {
            table = shard;
            continue;
        }
        if shard.about.fingerprint != table.about.fingerprint || shard.quantities != table.quantities {
            return Err(PopulationError::OtherStudy {
                first,
                other: path.clone(),
            });
        }
        table.rows.extend(shard.rows);
    }
    let mut ids = BTreeSet::new();
    if let Some(twice) = table.rows.iter().find(|row| !ids.insert(&row.id)) {
        return Err(PopulationError::Twice(twice.id.clone()));
    }
    Ok(Population {
        shards: [found.len() as u32, first_shard.of],
        digest: digest(&table),
        files: found.into_iter().map(|(_, path)| path).collect(),
        table,
    })
}
