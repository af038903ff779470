//! One shard of a study, on several threads.

use crate::definition::Study;
use crate::draw::{Drawn, Implant};
use crate::error::StudyError;
use crate::insert::{self, Body};
use crate::parts::Parts;
use crate::progress::Progress;
use crate::quantity::Id;
use crate::structures;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use stylet_insertions::{Insertion, Shard, Table, structures_file};
use stylet_sim::scene::Scene;

/// Order for a run.
#[derive(Clone, Debug)]
pub struct Order {
    /// Part of the study.
    pub shard: Shard,
    /// Folder of the results.
    pub folder: PathBuf,
    /// Threads.
    pub jobs: NonZeroUsize,
}

/// Ending of a run.
#[derive(Debug)]
pub enum Ended {
    /// The shard was finished before; nothing was run.
    Before(Table),
    /// The shard is finished.
    Now {
        /// All of it.
        table: Table,
        /// Insertions of these that an earlier run had finished.
        kept: usize,
    },
    /// `stop` was set.
    Stopped {
        /// Implants that are done.
        implants: usize,
        /// Implants of the shard.
        of: usize,
    },
}

/// Runs what is missing of a shard.
///
/// # Errors
/// A folder with other results, a body that cannot be built, a disk that takes no file.
pub fn run(study: &Study, order: &Order, stop: &AtomicBool, progress: &Progress) -> Result<Ended, StudyError> {
    let parts = Parts::open(study, order.shard, &order.folder)?;
    write_structures(study, order)?;
    if let Some(table) = parts.finished()? {
        return Ok(Ended::Before(table));
    }
    let done = parts.done()?;
    let range = order.shard.range(study.implant_count());
    let of = range.len();
    // Those that share a body follow each other: building one takes longer than a needle.
    let mut queue: Vec<(u64, usize, Implant)> = Vec::new();
    for place in range.filter(|place| !done.contains_key(place)) {
        let implant = Implant::at(study, place);
        let stiffness = Drawn::of(study, implant, 0).get(Id::Stiffness);
        queue.push((stiffness.to_bits(), place, implant));
    }
    queue.sort_by_key(|&(stiffness, place, implant)| (implant.gland, stiffness, place));
    let kept: usize = done.values().map(Vec::len).sum();
    let needles = queue
        .iter()
        .map(|(_, _, implant)| implant.gland(study).plan.needles.len());
    progress.begin(kept, kept + needles.sum::<usize>());
    Shared {
        study,
        queue: &queue,
        next: AtomicUsize::new(0),
        failure: Mutex::new(None),
        stop,
        parts: &parts,
        progress,
    }
    .run_on(order.jobs)?;
    // SYNC: set by a signal handler; nothing but the flag is carried.
    if stop.load(Ordering::Relaxed) {
        let implants = parts.done()?.len();
        if implants < of {
            return Ok(Ended::Stopped { implants, of });
        }
    }
    let table = parts.finish()?;
    Ok(Ended::Now { table, kept })
}

fn write_structures(study: &Study, order: &Order) -> Result<(), StudyError> {
    for gland in &study.glands {
        let path = structures_file(&order.folder, &gland.scene);
        if !path.exists() {
            structures::write(&path, &Scene::builtin(&gland.scene)?)?;
        }
    }
    Ok(())
}

/// State that all threads of a shard share.
struct Shared<'a> {
    study: &'a Study,
    /// Stiffness in bits, place in the study, implant.
    queue: &'a [(u64, usize, Implant)],
    next: AtomicUsize,
    failure: Mutex<Option<StudyError>>,
    stop: &'a AtomicBool,
    parts: &'a Parts,
    progress: &'a Progress,
}

impl Shared<'_> {
    fn run_on(self, jobs: NonZeroUsize) -> Result<(), StudyError> {
        std::thread::scope(|scope| {
            for number in 0..jobs.get() {
                let builder = std::thread::Builder::new().name(format!("insertions {number}"));
                if let Err(why) = builder.spawn_scoped(scope, || self.take_all()) {
                    self.fail(StudyError::Thread(why));
                }
            }
        });
        let failure = self
            .failure
            .into_inner()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        failure.map_or(Ok(()), Err)
    }

    fn take_all(&self) {
        let mut body = Body::default();
        // SYNC: a count alone; what it counts was there before the threads.
        while let Some(&(_, place, implant)) = self.queue.get(self.next.fetch_add(1, Ordering::Relaxed)) {
            let report = |row: &Insertion| self.progress.advance(row.outcome.as_ref().err());
            let kept = insert::implant(&mut body, self.study, implant, self.stop, report)
                .and_then(|rows| rows.map(|rows| self.parts.keep(place, rows)).transpose());
            match kept {
                Ok(Some(())) => {}
                Ok(None) => return,
                Err(why) => return self.fail(why),
            }
        }
    }

    /// Reports the first failure; the other threads take no more implants.
    fn fail(&self, why: StudyError) {
        // SYNC: as in `take_all`.
        self.next.store(self.queue.len(), Ordering::Relaxed);
        let mut failure = self.failure.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        failure.get_or_insert(why);
    }
}
