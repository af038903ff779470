//! `rt-core probe`: solves for the ultrasound probe in a scene's own cells and saves the answers for later runs.

use clap::Args;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use stylet_runtime::args::{scenes, tissue_kinds};
use stylet_runtime::kept_probe::{self, KeptError};
use stylet_runtime::lines::{LineBody, NoLine, NoProbe};
use stylet_runtime::replay::file::{Flight, FlightError};
use stylet_sim::probe::{NoWall, ProbeShape};
use stylet_sim::scene::{SceneSource, TissueKind};

/// Reason why nothing was saved.
#[derive(Debug, thiserror::Error)]
pub enum ProbeTaskError {
    /// The recording cannot be read.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The recording has no scene.
    #[error("{0}: the recording has no tissue, so no scene: take one of a smaller body, or the scene's name (--scene)")]
    NoScene(PathBuf),
    /// The scene cannot be used.
    #[error(transparent)]
    Body(#[from] NoLine),
    /// The scene has no probe.
    #[error(transparent)]
    Probe(#[from] NoProbe),
    /// The file cannot be used.
    #[error(transparent)]
    File(#[from] KeptError),
    /// There is no folder for it.
    #[error("neither XDG_CACHE_HOME nor HOME is set: set one, for the folder of the answers")]
    NoFolder,
}

/// The command.
#[derive(Args, Debug)]
pub struct ProbeArgs {
    /// Built-in scene
    #[arg(long, default_value = "pelvis", value_parser = scenes())]
    scene: String,
    /// The scene of a flight recording (*.flight) in place of a built-in one
    #[arg(long, value_name = "FILE", conflicts_with = "scene")]
    flight: Option<PathBuf>,
    /// Tissue model of the runs [default: that of the recording, or of a run]
    #[arg(long, value_parser = tissue_kinds())]
    tissue: Option<TissueKind>,
    /// Threads that solve, some hundred megabytes each [default: one for each processor]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Solve again although the answers are there
    #[arg(long)]
    again: bool,
}

impl ProbeArgs {
    /// Solves, prints a line for each tenth, and saves the answers.
    pub fn run(&self, stop: &AtomicBool) -> Result<(), ProbeTaskError> {
        let folder = kept_probe::default_folder().ok_or(ProbeTaskError::NoFolder)?;
        let (source, recorded) = self.source()?;
        let tissue = self.tissue.or(recorded).unwrap_or_default();
        let body = LineBody::of_source(&source, tissue)?.ok_or(NoProbe::from(NoWall::NoForces))?;
        let shape = ProbeShape::default();
        let file = body.probe_file(&shape, &folder);
        if !self.again && body.kept_probe(shape, &folder)?.is_some() {
            println!("{}: solved for before", file.display());
            return Ok(());
        }
        let [quick_mm, fine_mm] = body.probe_edges_m().map(|edge_m| 1e3 * edge_m);
        // A recording names the probe by this edge, which would be ambiguous.
        if quick_mm == fine_mm {
            println!("a run solves in cells of {fine_mm:.2} mm, which are the scene's own: nothing to keep");
            return Ok(());
        }
        let threads = self.threads.map_or_else(processors, usize::from);
        let begun = Instant::now();
        let mut tenths = None;
        let ready = body.solve_in_cells(shape, threads, &mut |[ready, of]| {
            let before = tenths.replace(10 * ready / of);
            if before.is_none() {
                println!(
                    "in cells of {fine_mm:.2} mm, where a run has elements of {quick_mm:.2} mm; {threads} threads"
                );
            } else if before != tenths {
                let left_s = begun.elapsed().as_secs_f64() * (of - ready) as f64 / ready as f64;
                println!("{ready} of {of} columns, about {left_s:.0} s left");
            }
            // SYNC: set by a signal handler; nothing but the flag is carried.
            !stop.load(Ordering::Acquire)
        })?;
        body.keep_probe(&ready, &folder)?;
        let [columns, others] = ready.bytes();
        println!(
            "{}: {} columns, residual {:.1e} at most, {:.0} MB, {:.0} s",
            file.display(),
            ready.rows(),
            ready.solved.residual,
            1e-6 * (columns + others) as f64,
            begun.elapsed().as_secs_f64()
        );
        Ok(())
    }

    /// Returns the scene, and the tissue recorded with it.
    fn source(&self) -> Result<(SceneSource, Option<TissueKind>), ProbeTaskError> {
        let Some(path) = &self.flight else {
            return Ok((SceneSource::Builtin(self.scene.clone()), None));
        };
        let tissue = Flight::read(path)?.tissue;
        let tissue = tissue.ok_or_else(|| ProbeTaskError::NoScene(path.clone()))?;
        Ok((tissue.scene, Some(tissue.tissue)))
    }
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
