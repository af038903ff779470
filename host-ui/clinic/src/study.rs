//! The command `host-ui study`: a page and tables of a population of insertions.

use super::CommandError;
use super::dose::write;
use clap::Args;
use serde_json::json;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use stylet_base::output::new_folder;
use stylet_base::progress_bar::LongTask;
use stylet_base::write_whole;
use stylet_implant::provenance;
use stylet_population as population;

const HELP: &str = "\
Reads every finished shard of a study (shard-*.parquet). Dose is that of the whole implant: D90 and V100 of the target as planned and
with the seeds at rest, in the structures that the study wrote next to its shards. An implant with a failed needle has no dose; the
page counts them.

Written to --out, a new or empty folder: study.html (self-contained), insertions.csv, implants.csv, distributions.csv;
made.json names the shards with their SHA-256, version and time. Programs that read Parquet query the shards themselves; docs/study.md
has examples for DuckDB and polars.

Example:
  rt-core study paper.toml --out out/paper && host-ui study out/paper --out out/paper-page";

/// Options of `host-ui study`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct StudyArgs {
    /// Folder written by 'rt-core study'
    folder: PathBuf,
    /// Folder for the page and the tables [default: page, in that folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl StudyArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        let out = self.out.unwrap_or_else(|| self.folder.join("page"));
        let read = population::load(&self.folder)?;
        let implants: BTreeSet<_> = read.table.rows.iter().map(|r| (&r.scene, &r.plan, r.implant)).collect();
        let task = LongTask::new(implants.len() as u64, "implants have their dose");
        let scored = population::score(&self.folder, &read.table, || task.advance(1))?;
        drop(task);
        let figures = population::figures(&read.table, &scored);
        let page = population::page(&read, &scored, &figures)?;
        new_folder(&out)?;
        population::write_tables(&out, &read.table, &scored, &figures)?;
        write_whole(&out.join("study.html"), page.as_bytes())?;
        let inputs: Vec<(&str, &Path)> = read.files.iter().map(|file| ("shard", file.as_path())).collect();
        let record = json!({
            "study": read.table.about.study,
            "fingerprint": read.table.about.fingerprint,
            "simulated_by": read.table.about.made_by,
            "rows_sha256": read.digest,
            "insertions": read.table.rows.len(),
            "made": provenance::made(&inputs)?,
        });
        write::json(&out.join("made.json"), &record)?;
        for d in &figures {
            println!(
                "{:32} median {:8.2}, p5 {:8.2}, p95 {:8.2} {}",
                d.name,
                d.percentile(50.0).unwrap_or(f64::NAN),
                d.percentile(5.0).unwrap_or(f64::NAN),
                d.percentile(95.0).unwrap_or(f64::NAN),
                d.unit
            );
        }
        let failed = read.table.rows.iter().filter(|row| row.outcome.is_err()).count();
        println!("{} insertions, {failed} of them failed", read.table.rows.len());
        println!("written: {}", out.join("study.html").display());
        Ok(())
    }
}
