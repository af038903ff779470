//! `rt-core fleet`: one page over the latency reports of many PCs: passing PCs, changes in each, and what changed with
//! them.

mod change;
mod entry;
mod page;
mod table;

use crate::disk::{self, DiskError};
use crate::plots::DrawError;
use crate::saved::{NotCounted, Saved};
use crate::verdict::{self, Outcome};
use clap::Args;
use entry::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stylet_text::printable_line;
use stylet_write::write_whole;

const PAGE: &str = "fleet.html";
const TABLE: &str = "fleet.csv";
/// The reports in a folder have this name.
const REPORT: &str = crate::report::JSON;

/// Which reports to read.
#[derive(Args, Clone, Debug)]
pub struct FleetArgs {
    /// Folders with reports of `rt-core latency`, at any depth
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// Who may sign: OpenSSH's file of allowed signers. A report with another key is not counted, and one without a
    /// signature leaves its PC open
    #[arg(long, value_name = "FILE")]
    pub allowed_signers: Option<PathBuf>,
    /// Folder for fleet.html and fleet.csv
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// The page cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A folder cannot be read, or the page or the table not written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Folder without a report.
    #[error(
        "no latency report found: expected report.json in a folder below the named ones, as `rt-core latency --out DIR` writes it{0}"
    )]
    None(String),
    /// The picture of a trend.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// The reports of one PC, oldest first.
struct Pc {
    name: String,
    entries: Vec<Entry>,
}

impl Pc {
    fn latest(&self) -> &Entry {
        self.entries.last().expect("a PC is known by its reports")
    }
}

/// Reads all reports and writes page and table.
///
/// Returns 0 when the latest report of every PC passes, 1 when one fails, 2 when one is open, or could not be
/// read or verified.
///
/// # Errors
/// A folder cannot be read, no report is found, or the files cannot be written.
pub fn run(args: &FleetArgs) -> Result<u8, FleetError> {
    let mut files = Vec::new();
    for folder in &args.folders {
        find(folder, &mut files)?;
    }
    files.sort();
    // One folder may lie in another.
    files.dedup();
    let (entries, unread) = read_all(&files, args.allowed_signers.as_deref());
    if entries.is_empty() {
        let why: String = unread.iter().map(|u| format!("\n{u}")).collect();
        return Err(FleetError::None(why));
    }
    let table = table::csv(&entries);
    let pcs = by_pc(entries);
    let page = page::page(&pcs, &unread)?;
    disk::make(&args.out)?;
    let (table_file, page_file) = (args.out.join(TABLE), args.out.join(PAGE));
    write_whole(&table_file, table.as_bytes()).map_err(DiskError::from)?;
    write_whole(&page_file, page.as_bytes()).map_err(DiskError::from)?;
    let words = |pc: &Pc| pc.latest().outcome().words();
    let width = pcs.iter().map(|pc| words(pc).len()).max().unwrap_or(0);
    for pc in &pcs {
        println!(
            "{:<width$} {} ({}, latest of {}; {})",
            words(pc),
            printable_line(&pc.name),
            page::counted(pc.entries.len(), "report", "reports"),
            printable_line(&pc.latest().report.made_at),
            printable_line(&pc.latest().report.notes.join("; "))
        );
    }
    unread
        .iter()
        .for_each(|u| println!("not counted    {}", printable_line(&u.to_string())));
    println!("{}\n{}", page_file.display(), table_file.display());
    Ok(exit_code(&pcs, &unread, args.allowed_signers.is_some()))
}

/// Returns the code for the shell; `signed` says whether reports must be signed.
fn exit_code(pcs: &[Pc], unread: &[NotCounted], signed: bool) -> u8 {
    let doubted = |r: &Saved| r.doubts().next().is_some() || (signed && r.is_unsigned());
    let open = !unread.is_empty() || pcs.iter().any(|pc| doubted(&pc.latest().report));
    match verdict::overall(pcs.iter().map(|pc| pc.latest().outcome())) {
        Outcome::Pass if open => Outcome::NotMeasurable.exit_code(),
        worst => worst.exit_code(),
    }
}

/// Returns every report below `folder`; links to folders are not followed, since they may lead in a circle.
fn find(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), DiskError> {
    let failed = DiskError::read(folder);
    for entry in std::fs::read_dir(folder).map_err(&failed)? {
        let entry = entry.map_err(&failed)?;
        if entry.file_type().map_err(&failed)?.is_dir() {
            find(&entry.path(), files)?;
        } else if entry.file_name() == REPORT {
            files.push(entry.path());
        }
    }
    Ok(())
}

fn read_all(files: &[PathBuf], allowed: Option<&Path>) -> (Vec<Entry>, Vec<NotCounted>) {
    let (mut entries, mut unread): (Vec<Entry>, Vec<NotCounted>) = (Vec::new(), Vec::new());
    let mut digests = BTreeSet::new();
    for (i, file) in files.iter().enumerate() {
        if files.len() >= 100 && i % 100 == 0 {
            eprintln!("rt-core: report {} of {}", i + 1, files.len());
        }
        match entry::read(file, allowed) {
            // A copy of a report is the same measurement.
            Ok(entry) if !digests.insert(entry.report.sha256.clone()) => unread.push(NotCounted {
                path: entry.path,
                why: "a copy of a report that is already counted".to_owned(),
            }),
            Ok(entry) => entries.push(entry),
            Err(why) => unread.push(why),
        }
    }
    entries.sort_by(|a, b| (&a.pc, &a.report.made_at).cmp(&(&b.pc, &b.report.made_at)));
    (entries, unread)
}

fn by_pc(entries: Vec<Entry>) -> Vec<Pc> {
    let mut pcs: BTreeMap<String, Vec<Entry>> = BTreeMap::new();
    for entry in entries {
        pcs.entry(entry.pc.clone()).or_default().push(entry);
    }
    pcs.into_iter().map(|(name, entries)| Pc { name, entries }).collect()
}

#[cfg(test)]
mod tests;
