//! Lines are prepared while the needle is outside: on a thread of normal priority, for where it would go in.
//!
//! A needle that stands still on an axis for [`STEADY`] is taken to go in along it. What a loop has is replaced only when the
//! needle has moved off it, and while it is in no tissue.

use super::line_archive::{Half, LineArchive};
use super::notices::LoopRings;
use crate::lines::{LineBody, NoLine};
use crate::rt::exchange::TissueOrder;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stylet_shm_schema::{TickRecord, flags};
use stylet_sim::line::{Line, LineSource, ReadyLine};
use stylet_sim::scene::{SceneSource, TissueKind};

/// So long the needle keeps its axis before a line is begun.
const STEADY: Duration = Duration::from_millis(60);
/// So far an axis may be off what was asked for, at its entry and in direction, and count as the same.
const SAME_M: f64 = 3e-4;
const SAME_RAD: f64 = 5e-3;
/// A line that both loops were given is in use by then, if the needle is on it.
const IN_USE_AFTER: Duration = Duration::from_secs(1);

/// What the thread returns.
struct Finished {
    scene_generation: u64,
    body: Option<LineBody>,
    line: Result<(ReadyLine, LineSource), NoLine>,
}

struct LineTask {
    axis: Line,
    thread: JoinHandle<Finished>,
    stop: Arc<AtomicBool>,
}

/// The bridge's side of lines.
pub struct LinePreparer {
    source: Arc<SceneSource>,
    /// Body of the scene that runs; `None` until the first line in it, and while one is under way.
    body: Option<(u64, LineBody)>,
    /// Where the needle is, and since when.
    steady: Option<(Line, Instant)>,
    under_way: Option<LineTask>,
    /// The last axis that there is an answer for, and when it came: a line, or that there is none.
    answered: Option<(Line, Instant)>,
    generation: u64,
    is_wanted: bool,
    archive: LineArchive,
}

impl LinePreparer {
    pub fn new(source: Arc<SceneSource>, tissue: TissueKind) -> Self {
        Self {
            source,
            body: None,
            steady: None,
            under_way: None,
            answered: None,
            generation: 0,
            is_wanted: tissue == TissueKind::Fem,
            archive: LineArchive::default(),
        }
    }

    /// What the lines of the run were made from, for flight recordings.
    pub(super) fn archive(&self) -> &LineArchive {
        &self.archive
    }

    /// Another scene runs.
    pub fn change_scene(&mut self, source: Arc<SceneSource>) {
        self.source = source;
        self.body = None;
        self.answered = None;
        self.give_up();
    }

    /// Hands over a line that is ready, and begins one where the needle needs another.
    pub(super) fn pass(&mut self, newest: Option<&TickRecord>, scene_generation: u64, loops: &mut LoopRings) {
        while let Ok(line) = loops.old_hand_lines.pop() {
            self.archive.returned(line.generation, Half::Hand);
        }
        while let Ok(line) = loops.old_body_lines.pop() {
            self.archive.returned(line.generation, Half::Body);
        }
        if !self.is_wanted {
            return;
        }
        self.take(scene_generation, loops);
        let Some(record) = newest else { return };
        if record.flags & flags::IN_CONTACT != 0 {
            self.steady = None;
            return;
        }
        let Some(axis) = axis(record) else { return };
        let now = Instant::now();
        match &self.steady {
            Some((since, _)) if same(since, &axis) => {}
            _ => self.steady = Some((axis, now)),
        }
        let is_steady = self.steady.as_ref().is_some_and(|(_, since)| now - *since >= STEADY);
        let is_answered = self.answered.as_ref().is_some_and(|(answered, since)| {
            let is_in_use = record.flags & flags::LINE_READY != 0;
            same(answered, &axis) && (is_in_use || now - *since < IN_USE_AFTER)
        });
        let is_under_way = self.under_way.as_ref().is_some_and(|work| same(&work.axis, &axis));
        if is_steady && !is_answered && !is_under_way {
            self.begin(axis, scene_generation);
        }
    }

    /// Begins once the thread has ended that is at work on another axis.
    fn begin(&mut self, axis: Line, scene_generation: u64) {
        if self.under_way.is_some() {
            self.give_up();
            return;
        }
        self.generation += 1;
        let generation = self.generation;
        let kept = self.body.take().filter(|(of, _)| *of == scene_generation);
        let (source, stop) = (Arc::clone(&self.source), Arc::new(AtomicBool::new(false)));
        let stopped = Arc::clone(&stop);
        let work = move || {
            let body = kept.map_or_else(|| LineBody::of_source(&source), |(_, body)| Ok(body));
            // SYNC: nothing but the flag is carried.
            let mut goes_on = || !stopped.load(Ordering::Relaxed);
            let (body, line) = match body {
                Ok(body) => {
                    let line = body.prepare(generation, axis.entry_m, axis.axes[0], &mut goes_on);
                    let with_source = line.map(|line| {
                        let source = line.hand.source();
                        (line, source)
                    });
                    (Some(body), with_source)
                }
                Err(why) => (None, Err(why)),
            };
            Finished {
                scene_generation,
                body,
                line,
            }
        };
        // Without a thread there is no line; it is tried again at the next pass.
        if let Ok(thread) = std::thread::Builder::new().name("needle-line".to_owned()).spawn(work) {
            self.under_way = Some(LineTask { axis, thread, stop });
        }
    }

    fn give_up(&mut self) {
        if let Some(work) = &self.under_way {
            // SYNC: read by the thread; nothing but the flag is carried.
            work.stop.store(true, Ordering::Relaxed);
        }
    }

    fn take(&mut self, scene_generation: u64, loops: &mut LoopRings) {
        let Some(work) = self.under_way.take_if(|work| work.thread.is_finished()) else {
            return;
        };
        let axis = work.axis;
        let Ok(finished) = work.thread.join() else {
            self.answered = Some((axis, Instant::now()));
            return;
        };
        if finished.scene_generation != scene_generation {
            return;
        }
        self.body = finished.body.map(|body| (scene_generation, body));
        match finished.line {
            Ok((ReadyLine { hand, body }, source)) => {
                self.archive.keep(source);
                // Both rings are emptied at every tick: one that is full belongs to a loop that has ended.
                let _ = loops.tissue_orders.push(TissueOrder::Line(body));
                let _ = loops.lines.push(hand);
                self.answered = Some((axis, Instant::now()));
            }
            Err(NoLine::Line(stylet_sim::line::LineError::Stopped)) => {}
            // No tissue there, or none that can be solved for: the needle is felt as without a line.
            Err(_) => self.answered = Some((axis, Instant::now() + Duration::from_secs(3600))),
        }
    }
}

impl Drop for LinePreparer {
    fn drop(&mut self) {
        self.give_up();
    }
}

/// Whether a needle on `axis` counts as one on `of`.
fn same(of: &Line, axis: &Line) -> bool {
    of.is_met_by(&axis.entry_m.into(), &axis.axes[0].into(), SAME_M, SAME_RAD)
}

/// The line through the tip along the needle.
fn axis(record: &TickRecord) -> Option<Line> {
    let [x, y, z, w] = record.world_from_tool;
    let world_from_tool = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9)?;
    Line::new(record.tip_in_scene_m, (world_from_tool * Vector3::z()).into())
}
