//! File names in the folder of a study.

use crate::TableError;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Ending of the tables.
pub const FILE_ENDING: &str = "parquet";

/// Part K of N of a study, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1 to `of`.
    pub number: u32,
    /// Number of parts.
    pub of: u32,
}

/// Text that is not a shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is no shard: give K/N with K from 1 to N, as 3/8")]
pub struct NoShard(String);

impl FromStr for Shard {
    type Err = NoShard;

    fn from_str(text: &str) -> Result<Self, NoShard> {
        let parts = text.split_once('/');
        let numbers = parts.and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        numbers
            .map(|(number, of)| Self { number, of })
            .filter(|shard| (1..=shard.of).contains(&shard.number))
            .ok_or_else(|| NoShard(text.to_owned()))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl Shard {
    /// The whole study as one part.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Returns the part's share of `count` items: consecutive numbers; shares differ by at most one.
    pub fn range(self, count: usize) -> std::ops::Range<usize> {
        let end = |k: u32| (count as u128 * u128::from(k) / u128::from(self.of)) as usize;
        end(self.number - 1)..end(self.number)
    }

    /// Name of the shard, of its file, and of its folder while it runs.
    pub fn name(self) -> String {
        format!("shard-{:05}-of-{:05}", self.number, self.of)
    }

    /// Path in the folder of the study.
    pub fn file(self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.{FILE_ENDING}", self.name()))
    }

    /// Returns the shard of a file or folder of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        let stem = name.split_once('.').map_or(name, |(stem, _)| stem);
        let (number, of) = stem.strip_prefix("shard-")?.split_once("-of-")?;
        format!("{}/{}", number.parse::<u32>().ok()?, of.parse::<u32>().ok()?)
            .parse()
            .ok()
    }
}

/// Label volume with the structures of a scene, in which dose is scored.
pub fn structures_file(folder: &Path, scene: &str) -> PathBuf {
    folder.join(format!("{scene}.seg.nrrd"))
}

/// Returns the finished shards in a folder, in order.
///
/// # Errors
/// If the folder cannot be read.
pub fn shard_files(folder: &Path) -> Result<Vec<(Shard, PathBuf)>, TableError> {
    let open = |source| TableError::Open {
        path: folder.to_owned(),
        source,
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(open)? {
        let path = entry.map_err(open)?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if let Some(shard) = Shard::of_name(name).filter(|_| path.extension().is_some_and(|e| e == FILE_ENDING)) {
            found.push((shard, path));
        }
    }
    found.sort_by_key(|(shard, _)| (shard.of, shard.number));
    Ok(found)
}
