//! Needle lines of a recording: the force loop's half from the file, the tissue loop's columns solved again.

use super::file::Flight;
use super::repeat::RepeatError;
use crate::lines::{LineBody, NoProbe};
use crate::rt::tissue_tape::TissueFlight;
use std::path::Path;
use stylet_sim::line::{BodyAnswer, BodyLine, HandLine, LineSource};
use stylet_sim::probe::{BodyProbe, NoWall, ProbeShape};
use stylet_sim::tissue::fem::batch::Part;

/// Progress of solving one line's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineProgress {
    /// Number of the line.
    pub generation: u64,
    /// Columns solved so far.
    pub ready: usize,
    /// Columns in all.
    pub of: usize,
}

/// The tissue loop's half of each line of a recording.
#[derive(Debug, Default)]
pub struct LinesAgain {
    bodies: Vec<BodyLine>,
    /// The probe, if there was one.
    pub(super) probe: Option<BodyProbe>,
    /// Lines whose columns were solved again.
    pub solved: usize,
    /// Number of them that differ from the recorded ones in any bit.
    pub different: usize,
}

/// Solves for the columns of every line that loaded the recorded tissue, and for its probe: some seconds each for a
/// body of 20,000 elements, minutes for a probe in the scene's own cells that is not saved in `kept_in`. No recording
/// holds them; they follow from the scene and the line.
///
/// Call before this thread turns denormal numbers off as the loops do: the thread that prepared the lines did not.
pub fn solve_again(
    flight: &Flight,
    recorded: &TissueFlight,
    kept_in: Option<&Path>,
    report: &mut dyn FnMut(LineProgress),
) -> Result<LinesAgain, RepeatError> {
    let mut again = LinesAgain::default();
    let mut body: Option<(f64, LineBody)> = None;
    for generation in recorded.line_numbers() {
        if again.bodies.iter().any(|body| body.generation == generation) {
            continue;
        }
        let source = source_of(flight, generation)?;
        if !recorded.is_pushed_by(generation) {
            // Its columns do not matter.
            let nothing = BodyAnswer::Columns(Vec::new());
            again
                .bodies
                .push(BodyLine::new(generation, source.line, Part::default(), nothing));
            continue;
        }
        let stiffness = source.stiffness();
        let kept = body.take().filter(|(of, _)| *of == stiffness);
        let (_, body) = match kept {
            Some(kept) => body.insert(kept),
            None => {
                let of_scene = LineBody::of_stiffened(&recorded.scene, stiffness, recorded.tissue)?;
                body.insert((stiffness, of_scene.ok_or(RepeatError::NoLine(generation))?))
            }
        };
        let ready = body.prepare_along(generation, source.line, source.bends(), &[], &mut |progress| {
            report(LineProgress {
                generation,
                ready: progress.ready,
                of: progress.of,
            });
            true
        })?;
        again.solved += 1;
        again.different += usize::from(!ready.hand.source().is_identical(source));
        again.bodies.push(*ready.body);
    }
    if let Some(edge_m) = recorded.probe_edge_m() {
        let body = LineBody::of_source(&recorded.scene, recorded.tissue)?.ok_or(NoProbe::from(NoWall::NoForces))?;
        again.probe = Some(probe_again(&body, edge_m, kept_in)?);
    }
    Ok(again)
}

/// Restores the probe in the recorded elements: from saved answers, if they are of those.
fn probe_again(body: &LineBody, edge_m: f64, kept_in: Option<&Path>) -> Result<BodyProbe, RepeatError> {
    let shape = ProbeShape::default();
    let [quick_m, fine_m] = body.probe_edges_m();
    if edge_m == quick_m {
        return Ok(body.prepare_probe(shape, &mut |_| true).map_err(NoProbe::from)?);
    }
    if edge_m != fine_m {
        return Err(RepeatError::OtherProbe);
    }
    let kept = kept_in.and_then(|folder| body.kept_probe(shape, folder).ok().flatten());
    if let Some(probe) = kept {
        return Ok(probe);
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    Ok(BodyProbe::new(body.solve_in_cells(shape, threads, &mut |_| true)?))
}

impl LinesAgain {
    pub(super) fn take(&mut self, generation: u64) -> Option<Box<BodyLine>> {
        let at = self.bodies.iter().position(|line| line.generation == generation)?;
        Some(Box::new(self.bodies.swap_remove(at)))
    }
}

fn source_of(flight: &Flight, generation: u64) -> Result<&LineSource, RepeatError> {
    let found = flight.lines.iter().find(|line| line.generation == generation);
    found.ok_or(RepeatError::NoLine(generation))
}

/// Returns the force loop's half of that line, in tissue at rest.
pub(super) fn hand_line(flight: &Flight, generation: u64) -> Result<Box<HandLine>, RepeatError> {
    let source = source_of(flight, generation)?.clone();
    let line = HandLine::of_source(source).map_err(crate::lines::NoLine::from)?;
    Ok(Box::new(line))
}
