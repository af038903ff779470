//! The chain of checkpoints: a line for each one that was written, with the digest of its file, and the digest of all
//! lines up to it. An edited, missing, repeated or reordered checkpoint is named.

use crate::disk::{self, DiskError};
use crate::provenance::sha256;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Name of its file.
pub const CHAIN: &str = "campaign.chain";

/// Links in the order in which they were written; of a file, the last one counts.
#[derive(Debug, Default)]
pub struct Chain {
    folder: PathBuf,
    /// Digest of all lines so far.
    pub head: String,
    links: Vec<(String, String)>,
    /// Lines that do not follow from those before.
    broken: Vec<usize>,
}

impl Chain {
    /// Reads the chain of a folder; one without it has none.
    pub fn read(folder: &Path) -> Result<Self, DiskError> {
        let path = folder.join(CHAIN);
        let mut chain = Self {
            folder: folder.to_owned(),
            ..Self::default()
        };
        if path.symlink_metadata().is_err() {
            return Ok(chain);
        }
        let text = disk::read_text(&path)?;
        // A line without an end was cut off as the PC went down.
        for (number, line) in (1..).zip(text.split_inclusive('\n').filter_map(|l| l.strip_suffix('\n'))) {
            let mut words = line.splitn(3, ' ');
            let [file, sha256, said] = std::array::from_fn(|_| words.next().unwrap_or_default().to_owned());
            chain.add(file, sha256);
            if chain.head != said {
                chain.broken.push(number);
                chain.head = said;
            }
        }
        Ok(chain)
    }

    fn add(&mut self, file: String, digest: String) {
        self.head = sha256(format!("{}\n{file} {digest}", self.head).as_bytes());
        self.links.push((file, digest));
    }

    /// Appends a checkpoint, before its file is replaced.
    pub fn append(&mut self, file: &str, digest: String) -> Result<(), DiskError> {
        self.add(file.to_owned(), digest);
        let (file, digest) = &self.links[self.links.len() - 1];
        let path = self.folder.join(CHAIN);
        let open = File::options().create(true).append(true).open(&path);
        let mut end = open.map_err(DiskError::read(&path))?;
        writeln!(end, "{file} {digest} {}", self.head).map_err(DiskError::read(&path))
    }

    /// Links files again whose last checkpoint was announced, and not written before the session was killed; removes a
    /// line that was cut off.
    pub fn settle(&mut self) -> Result<(), DiskError> {
        let path = self.folder.join(CHAIN);
        let whole = std::fs::read(&path).unwrap_or_default();
        let end = whole.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
        if end < whole.len() {
            stylet_write::write_whole(&path, &whole[..end])?;
        }
        for (file, [before, last]) in self.last_two() {
            let is = disk::read(&self.folder.join(&file)).ok().map(|bytes| sha256(&bytes));
            if is == before
                && is != last
                && let Some(is) = is
            {
                self.append(&file, is)?;
            }
        }
        Ok(())
    }

    /// Returns the last digest of each file, and the one before.
    fn last_two(&self) -> BTreeMap<String, [Option<String>; 2]> {
        let mut all: BTreeMap<String, [Option<String>; 2]> = BTreeMap::new();
        for (file, digest) in &self.links {
            let of = all.entry(file.clone()).or_default();
            *of = [of[1].take(), Some(digest.clone())];
        }
        all
    }

    /// Returns every problem with the chain and the checkpoints `files` in its folder.
    pub fn problems(&self, files: &[String]) -> Vec<String> {
        let broken = |line: &usize| {
            format!("{CHAIN}, line {line}: does not follow from the lines before: one was edited, removed or moved")
        };
        let mut found: Vec<String> = self.broken.iter().map(broken).collect();
        let known = self.last_two();
        for (file, [_, digest]) in &known {
            match disk::read(&self.folder.join(file)) {
                Err(_) => found.push(format!("{file}: missing, or not readable")),
                Ok(bytes) if Some(sha256(&bytes)) != *digest => found.push(format!(
                    "{file}: edited: its SHA-256 is not that of its last checkpoint in {CHAIN}"
                )),
                Ok(_) => {}
            }
        }
        let added = files.iter().filter(|file| !known.contains_key(*file));
        found.extend(added.map(|file| format!("{file}: not in {CHAIN}: repeated, renamed or added")));
        found
    }
}
