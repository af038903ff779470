//! Prepares needle lines in the background while the needle is outside the tissue.
//!
//! A needle that stays on an axis for [`STEADY_NS`] is expected to enter along it. The loops' line is replaced only
//! once the needle has left its axis, and only while it is outside the tissue. In idle time the lines of the planned
//! needle and of the one after it are solved ahead and kept until a needle arrives.

use super::line_archive::{Half, LineArchive};
use crate::background::{Task, Work, goes_on};
use crate::lines::{LineBody, NoLine};
use crate::rt::exchange::TissueOrder;
use crate::rt::wiring::ControlPorts;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_shm_schema::{TickRecord, flags};
use stylet_sim::line::{HandLine, Line, ReadyLine, Track};
use stylet_sim::scene::SceneSource;
use stylet_sim::tissue::TissueSpec;

/// Time for which the needle must keep its axis before its line is solved.
const STEADY_NS: u64 = 60_000_000;
/// Largest deviation of an axis, at its entry and in direction, that counts as the same.
const SAME_M: f64 = 3e-4;
const SAME_RAD: f64 = 5e-3;
/// After this time a line that both loops have counts as in use, if the needle is on it.
const IN_USE_AFTER_NS: u64 = 1_000_000_000;

/// Result of the solver thread.
struct Finished {
    scene_generation: u64,
    stiffness: f64,
    bends: bool,
    body: Option<LineBody>,
    line: Result<ReadyLine, NoLine>,
}

/// A line that awaits its needle.
struct Kept {
    axis: Line,
    line: ReadyLine,
}

/// The control thread's side of lines.
pub struct LinePreparer {
    source: Arc<SceneSource>,
    /// Body of the running scene; `None` before the first line in it, and while a line is being solved.
    body: Option<(u64, LineBody)>,
    /// Axis of the needle, and since when, ns.
    steady: Option<(Line, u64)>,
    under_way: Option<(Line, Task<Finished>)>,
    /// Axis of the line handed over last, and when, ns.
    handed_over: Option<(Line, u64)>,
    /// Axes without a line: no tissue there, or none that can be solved for.
    without: Vec<Line>,
    /// The planned needle and the one after it.
    expected: Vec<Line>,
    /// Solved lines of the expected needles.
    kept: Vec<Kept>,
    generation: u64,
    tissue: TissueSpec,
    /// Stiffness factor of an exercise relative to the scene, and displacement of the body.
    stiffness: f64,
    body_moved_m: [f64; 3],
    /// The needle bends, so lines are solved across the axis as well.
    bends: bool,
    archive: LineArchive,
    /// Tracks cut since the tissue was reset, oldest first.
    tracks: Vec<Track>,
    work: Work,
    /// Time of this pass.
    now_ns: u64,
}

impl LinePreparer {
    pub fn new(source: Arc<SceneSource>, tissue: impl Into<TissueSpec>, work: Work) -> Self {
        Self {
            source,
            body: None,
            steady: None,
            under_way: None,
            handed_over: None,
            without: Vec::new(),
            expected: Vec::new(),
            kept: Vec::new(),
            generation: 0,
            tissue: tissue.into(),
            stiffness: 1.0,
            body_moved_m: [0.0; 3],
            bends: false,
            archive: LineArchive::default(),
            tracks: Vec::new(),
            work,
            now_ns: 0,
        }
    }

    /// Returns the sources of the run's lines, for flight recordings.
    pub(super) fn archive(&self) -> &LineArchive {
        &self.archive
    }

    /// Switches to another scene.
    pub fn change_scene(&mut self, source: Arc<SceneSource>) {
        self.source = source;
        self.body = None;
        self.handed_over = None;
        self.without.clear();
        self.expected.clear();
        self.kept.clear();
        self.tracks.clear();
        self.give_up();
    }

    /// Scales the tissue stiffness by `factor` and solves the lines again.
    pub(super) fn stiffen(&mut self, factor: f64) {
        if self.stiffness == factor {
            return;
        }
        self.stiffness = factor;
        self.body = None;
        self.handed_over = None;
        self.without.clear();
        self.kept.clear();
        self.give_up();
    }

    /// Moves the body from its place in the scene: planned needles enter it elsewhere.
    pub(super) fn move_body(&mut self, by_m: [f64; 3]) {
        let from_m = std::mem::replace(&mut self.body_moved_m, by_m);
        for axis in &mut self.expected {
            axis.entry_m = [0, 1, 2].map(|a| axis.entry_m[a] + from_m[a] - by_m[a]);
        }
        self.forget_unexpected();
    }

    /// Returns the axis in the scene's own body frame.
    fn in_body(&self, entry_m: [f64; 3], direction: [f64; 3]) -> Option<Line> {
        Line::new([0, 1, 2].map(|a| entry_m[a] - self.body_moved_m[a]), direction)
    }

    /// Sets whether the needle bends. A line solved for one case is useless in the other.
    pub(super) fn take_bending(&mut self, bends: bool) {
        if bends && !self.bends {
            self.handed_over = None;
            self.kept.clear();
            self.give_up();
        }
        self.bends = bends;
    }

    /// Forgets the tracks: the tissue was reset.
    pub fn forget_tracks(&mut self) {
        self.tracks.clear();
    }

    /// Sets the entry and direction of the plan's current needle; `None` withdraws it.
    pub(super) fn expect_planned(&mut self, needle: Option<([f64; 3], [f64; 3])>) {
        self.expected.clear();
        let axis = needle.and_then(|(entry_m, direction)| self.in_body(entry_m, direction));
        self.expected.extend(axis);
        self.forget_unexpected();
    }

    /// Sets the needle after the planned one.
    pub(super) fn expect_next(&mut self, entry_m: [f64; 3], direction: [f64; 3]) {
        self.expected.truncate(1);
        let axis = self.in_body(entry_m, direction);
        self.expected.extend(axis);
        self.forget_unexpected();
    }

    fn forget_unexpected(&mut self) {
        let expected = &self.expected;
        self.kept
            .retain(|kept| expected.iter().any(|axis| same(&kept.axis, axis)));
    }

    /// Hands over a finished line, and begins one for a needle that has none.
    pub(super) fn pass(
        &mut self,
        now_ns: u64,
        newest: Option<&TickRecord>,
        scene_generation: u64,
        loops: &mut ControlPorts,
    ) {
        self.now_ns = now_ns;
        while let Ok(line) = loops.old_hand_lines.pop() {
            self.archive.returned(line.generation, Half::Hand, now_ns);
            self.keep_track(&line);
        }
        while let Ok(line) = loops.old_body_lines.pop() {
            self.archive.returned(line.generation, Half::Body, now_ns);
        }
        if !self.tissue.has_lines() {
            return;
        }
        self.take(scene_generation, loops);
        let Some(record) = newest else { return };
        if let Some(axis) = self.axis_without_line(record) {
            if let Some(at) = self.kept.iter().position(|kept| same(&kept.axis, &axis)) {
                let kept = self.kept.swap_remove(at);
                self.hand_over(axis, kept.line, loops);
            } else if !self.is_under_way(&axis) {
                self.begin(axis, scene_generation);
            }
        } else if self.under_way.is_none()
            && let Some(axis) = self.expected.iter().find(|axis| !self.has_answer(axis)).copied()
        {
            self.begin(axis, scene_generation);
        }
    }

    fn keep_track(&mut self, line: &HandLine) {
        const MOST: usize = 256;
        if let Some(track) = line.track() {
            if self.tracks.len() >= MOST {
                self.tracks.remove(0);
            }
            self.tracks.push(track);
        }
    }

    /// Returns the axis of a steady needle outside the tissue for which the loops have no line.
    fn axis_without_line(&mut self, record: &TickRecord) -> Option<Line> {
        if record.flags & (flags::IN_CONTACT | flags::HAND_EMPTY) != 0 {
            self.steady = None;
            return None;
        }
        let axis = self.in_body(record.tip_in_scene_m, direction(record)?)?;
        let now_ns = self.now_ns;
        match &self.steady {
            Some((since, _)) if same(since, &axis) => {}
            _ => self.steady = Some((axis, now_ns)),
        }
        let is_steady = self
            .steady
            .as_ref()
            .is_some_and(|(_, since)| now_ns - *since >= STEADY_NS);
        let has_line = self.handed_over.as_ref().is_some_and(|(given, since)| {
            let is_in_use = record.flags & flags::LINE_READY != 0;
            same(given, &axis) && (is_in_use || now_ns - *since < IN_USE_AFTER_NS)
        });
        (is_steady && !has_line && !self.has_none(&axis)).then_some(axis)
    }

    fn is_under_way(&self, axis: &Line) -> bool {
        self.under_way.as_ref().is_some_and(|(of, _)| same(of, axis))
    }

    fn has_answer(&self, axis: &Line) -> bool {
        let has_line = self.handed_over.as_ref().is_some_and(|(given, _)| same(given, axis));
        has_line || self.has_none(axis) || self.kept.iter().any(|kept| same(&kept.axis, axis))
    }

    fn has_none(&self, axis: &Line) -> bool {
        self.without.iter().any(|without| same(without, axis))
    }

    /// Marks an axis as having no line until the scene changes.
    fn do_without(&mut self, axis: Line) {
        const MOST: usize = 64;
        self.without.truncate(MOST - 1);
        self.without.insert(0, axis);
    }

    /// Begins a line once the thread has finished with any other.
    fn begin(&mut self, axis: Line, scene_generation: u64) {
        if self.under_way.is_some() {
            self.give_up();
            return;
        }
        self.generation += 1;
        let generation = self.generation;
        let kept = self.body.take().filter(|(of, _)| *of == scene_generation);
        let (source, tissue, bends) = (Arc::clone(&self.source), self.tissue, self.bends);
        let stiffness = self.stiffness;
        let waiting = self.kept.iter().map(|kept| &kept.line.stations);
        let others: Vec<_> = self.archive.in_use().chain(waiting).cloned().collect();
        let work = move |stop: &AtomicBool| {
            let body = match kept {
                Some((_, body)) => Ok(Some(body)),
                None => LineBody::of_stiffened(&source, stiffness, tissue),
            };
            let (body, line) = match body {
                Ok(Some(body)) => {
                    let mut goes_on = || goes_on(stop);
                    let line = body.prepare(generation, axis.entry_m, axis.axes[0], bends, &others, &mut goes_on);
                    (Some(body), line)
                }
                Ok(None) => (None, Err(stylet_sim::line::LineError::NoTissue.into())),
                Err(why) => (None, Err(why)),
            };
            Finished {
                scene_generation,
                stiffness,
                bends,
                body,
                line,
            }
        };
        // The thread could not be started; the next pass tries again.
        self.under_way = Task::spawn("needle-line", self.work, work)
            .ok()
            .map(|task| (axis, task));
    }

    fn give_up(&mut self) {
        if let Some((_, task)) = &self.under_way {
            task.stop();
        }
    }

    fn take(&mut self, scene_generation: u64, loops: &mut ControlPorts) {
        let Some((axis, task)) = self.under_way.take_if(|(_, task)| task.is_finished()) else {
            return;
        };
        let Some(finished) = task.result() else {
            self.do_without(axis);
            return;
        };
        if finished.scene_generation != scene_generation || finished.stiffness != self.stiffness {
            return;
        }
        self.body = finished.body.map(|body| (scene_generation, body));
        if self.bends && !finished.bends {
            return;
        }
        let is_expected = self.expected.iter().any(|expected| same(expected, &axis));
        let stands_there = self.steady.as_ref().is_some_and(|(steady, _)| same(steady, &axis));
        match finished.line {
            Ok(line) if stands_there => self.hand_over(axis, line, loops),
            Ok(line) if is_expected => self.kept.push(Kept { axis, line }),
            Ok(_) | Err(NoLine::Line(stylet_sim::line::LineError::Stopped)) => {}
            Err(_) => self.do_without(axis),
        }
    }

    fn hand_over(&mut self, axis: Line, line: ReadyLine, loops: &mut ControlPorts) {
        let ReadyLine {
            mut hand,
            body,
            stations,
        } = line;
        for track in &self.tracks {
            hand.open_track(track);
        }
        let source = hand.source().in_tissue_as_stiff(self.stiffness);
        self.archive.keep(source, stations, self.now_ns);
        // The loops empty both rings every tick: a full ring belongs to a loop that has ended.
        let _ = loops.tissue_orders.push(TissueOrder::Line(body));
        let _ = loops.lines.push(hand);
        self.handed_over = Some((axis, self.now_ns));
    }
}

/// True if a needle on `axis` counts as being on `of`.
fn same(of: &Line, axis: &Line) -> bool {
    of.is_met_by(&axis.entry_m.into(), &axis.axes[0].into(), SAME_M, SAME_RAD)
}

/// Direction of the needle, from hub to tip.
fn direction(record: &TickRecord) -> Option<[f64; 3]> {
    let [x, y, z, w] = record.world_from_tool;
    let world_from_tool = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9)?;
    Some((world_from_tool * Vector3::z()).into())
}

#[cfg(test)]
mod tests;
