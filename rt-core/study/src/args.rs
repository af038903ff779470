//! `rt-core study`: its options, and what it prints.

use crate::definition::Study;
use crate::error::StudyError;
use crate::progress::Progress;
use crate::run::{Ended, Order, run};
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use stylet_insertions::{Shard, Table, digest};
use stylet_text::printable;

/// Time between two lines of progress.
const EVERY: Duration = Duration::from_secs(5);

const HELP: &str = concat!(
    "Each insertion begins with tissue at rest and runs through the two ticks of the live simulator, in its own time. Its random\n\
numbers follow from its id (STUDY/SCENE/PLAN/IMPLANT/NEEDLE) and the seed of the study: shards, jobs and interruptions change no bit.\n\n\
A shard writes OUT/shard-KKKKK-of-NNNNN.parquet when it is complete, one row an insertion with its seeds as a list, and beside it\n\
SCENE.seg.nrrd, the structures that dose is scored in. Until then every implant has a file of its own in a folder of that name: a\n\
shard that is started again continues with what is missing. `host-ui study OUT` makes the page.\n\n\
A study file, with all its keys:\n\n",
    include_str!("../../../docs/study/paper.toml"),
    "\nExamples:\n  rt-core study paper.toml --out out/paper\n  rt-core study paper.toml --shard 3/8 --out out/paper\n  \
     parallel rt-core study paper.toml --shard {}/8 --jobs 1 --out out/paper ::: $(seq 8)"
);

/// Options of `rt-core study`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct StudyArgs {
    /// The study (TOML); see --help
    file: PathBuf,
    /// Only the K-th of N parts; parts may run at the same time, on any machine that sees the folder
    #[arg(long, value_name = "K/N", default_value_t = Shard::WHOLE)]
    shard: Shard,
    /// Folder of the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threads [default: as many as this process may use cores]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
}

impl StudyArgs {
    /// Runs the shard, and returns the exit code: 0 where it is finished, 130 where `stop` ended it before.
    ///
    /// # Errors
    /// What is wrong with the study, the folder or a body.
    pub fn run(&self, stop: &AtomicBool) -> Result<u8, StudyError> {
        let study = Study::read(&self.file)?;
        let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let order = Order {
            shard: self.shard,
            folder: self.out.clone(),
            jobs: self.jobs.unwrap_or(cores),
        };
        let ended = run(&study, &order, stop, &Progress::new(EVERY))?;
        let file = order.shard.file(&order.folder);
        match ended {
            Ended::Before(table) => println!("finished before: {}\n{}", file.display(), printable(&summary(&table))),
            Ended::Now { table, kept } => {
                if kept > 0 {
                    println!("{kept} insertions were kept from an earlier run");
                }
                println!("{}\nwritten: {}", printable(&summary(&table)), file.display());
            }
            Ended::Stopped { implants, of } => {
                eprintln!(
                    "stopped: {implants} of {of} implants are done and kept; the same command continues with the others"
                );
                return Ok(130);
            }
        }
        Ok(0)
    }
}

fn summary(table: &Table) -> String {
    let failed = table.rows.iter().filter(|row| row.outcome.is_err()).count();
    format!(
        "{} insertions, {failed} of them failed\nSHA-256 of the rows: {}",
        table.rows.len(),
        digest(table)
    )
}
