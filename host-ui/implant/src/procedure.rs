//! The whole procedure without a window; its results are written to files.

mod child;
mod debrief;
mod error;
mod gland;
/// Content of a procedure: its needles, planned and dropped.
pub mod job;
mod options;
mod parameters;
mod report;

use crate::provenance;
use crate::workflow::{Pace, Patience, Run, RunStatus, Step};
use child::Core;
pub use error::ProcedureError;
use gland::TargetMotion;
use job::Job;
pub use options::Options;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_base::format;
use stylet_base::interrupt::Interrupt;
use stylet_base::lines::Lines;
use stylet_base::output::new_folder;
use stylet_files::{self as files, scene::SceneFile};
use stylet_host::core_args::{CoreArgs, SceneChoice};
use stylet_host::link::{Link, LinkStatus, SceneModel};
use stylet_shm_schema::*;

/// Patience of a run that nobody watches: anything late by more will not come.
const UNWATCHED: Patience = Patience::AtLeast(60.0);
const POLL_EVERY: Duration = Duration::from_millis(5);
const FIND_LIMIT: Duration = Duration::from_secs(3);
/// A core that somebody starts at the same time is there by then.
const APPEAR_LIMIT: Duration = Duration::from_secs(1);
const START_LIMIT: Duration = Duration::from_secs(20);
const LOAD_LIMIT: Duration = Duration::from_secs(60);

/// Core that answers, with the requested scene.
pub struct Live {
    /// The link to the core.
    pub link: Link,
    /// Core that was started here; ends with this value.
    core: Option<Core>,
    /// Running scene.
    pub scene: Arc<SceneModel>,
    /// Content of the scene file beyond the scene.
    said: Option<SceneFile>,
    /// Set when the user ends the program.
    pub interrupted: Interrupt,
}

impl Live {
    /// Finds the core, or starts `program`, and loads the scene; returns an error if that fails.
    pub fn connect(asked: &CoreArgs, program: Option<&Path>) -> Result<Self, ProcedureError> {
        let volume = asked
            .file()
            .map(|path| files::watched(path, |progress| files::read(path, asked.label, progress)));
        let volume = volume.transpose()?;
        let scene_file = asked.file().filter(|path| files::scene::is_scene(path));
        let said = scene_file.map(files::scene::read).transpose()?;
        let interrupted = Interrupt::on_signals()?;
        let mut link = Link::new(asked.instance.clone());
        let mut core = None;
        let device = said.as_ref().and_then(|s| s.device.as_deref());
        find_core(&mut link, &mut core, program, device, &interrupted)?;
        if let Some(volume) = &volume {
            for note in &volume.warnings {
                println!("note: {}", stylet_base::format::printable_line(note));
            }
            load(&mut link, |link| Ok(link.upload(volume)?), &interrupted)?;
        }
        if let Some(SceneChoice::BuiltIn(number)) = asked.scene {
            let send = |link: &mut Link| {
                let sent = link.send(&Request::LoadBuiltinScene(number as u32));
                Ok(sent?)
            };
            load(&mut link, send, &interrupted)?;
        }
        let scene = link
            .scene()
            .ok_or(ProcedureError::NothingReceived("the core sent no scene"))?
            .clone();
        Ok(Self {
            link,
            core,
            scene,
            said,
            interrupted,
        })
    }
}

/// Observations while the script ran.
struct Observations {
    motion: TargetMotion,
    records: Vec<TickRecord>,
    punctured: bool,
    displacement_before_puncture_m: f64,
    last_event: Option<u64>,
    events: Vec<Event>,
    /// Numbers of planned drops that left no seed.
    lost: Vec<usize>,
    /// Needles that stayed in, the most at any time.
    left: Vec<LeftNeedlePose>,
}

/// Runs the procedure; returns an error if a step was not completed.
pub fn run(options: Options) -> Result<(), ProcedureError> {
    if let Some(speed) = options.insert_speed.filter(|s| !(0.1..=500.0).contains(s)) {
        return Err(ProcedureError::InsertSpeed(speed));
    }
    if let Some(out) = &options.out {
        new_folder(out)?;
    }
    let Live {
        mut link,
        core,
        scene,
        said,
        interrupted,
    } = Live::connect(&options.core, options.program.as_deref())?;
    let usual = Pace::default();
    let of_file = |speed: fn(&SceneFile) -> Option<f64>| said.as_ref().and_then(speed);
    let pace = Pace {
        insert_m_per_s: options
            .insert_speed
            .map(|mm_per_s| mm_per_s / 1e3)
            .or(of_file(|s| s.insert_m_per_s))
            .unwrap_or(usual.insert_m_per_s),
        retract_m_per_s: of_file(|s| s.retract_m_per_s).unwrap_or(usual.retract_m_per_s),
        ..usual
    };
    let file_of_scene = options.core.file();
    let of_scene = file_of_scene.zip(said.as_ref().and_then(|s| s.plan.as_deref()));
    let of_scene = of_scene.map(|(scene, plan)| scene.with_file_name(plan));
    let plan = options.plan.as_deref().or(of_scene.as_deref());
    let inputs = [
        ("--scene", file_of_scene),
        ("--plan", plan),
        ("--source", options.source.as_deref()),
    ];
    let inputs: Vec<(&str, &Path)> = inputs.into_iter().filter_map(|(o, p)| Some((o, p?))).collect();
    let made = provenance::made(&inputs)?;
    let mut job = match plan {
        Some(path) => Job::from_file(path, &scene, file_of_scene)?,
        None => Job::suggested(&scene, usize::from(options.seeds)),
    };
    if let Some(implant) = &job.implant {
        debrief::source_of(implant, options.source.as_deref())?;
    }
    println!(
        "scene {}: {} elements of {:.2} mm{}",
        scene.header.name.read(),
        scene.header.element_count,
        scene.header.spacing_m * 1e3,
        match scene.header.body_edge {
            0 | 1 => String::new(),
            _ => format!(", solved in elements of {:.2} mm", scene.header.body_spacing_m() * 1e3),
        }
    );
    parameters::set(&mut link, &options.parameters, &interrupted)?;
    if options.stabilise > 0 {
        job.stabilise(&scene, usize::from(options.stabilise))?;
    }
    if options.compensate {
        job.compensate(&mut link, &pace, &interrupted)?;
    }
    let mut seen = Observations::of(&scene);
    let run = Run::of_needles(job.tasks.clone(), pace)
        .stabilised(&job.stabilising)
        .with_patience(UNWATCHED);
    let run = if options.rearm { run.rearming() } else { run };
    let outcome = perform(&mut link, &job, run, &interrupted, &mut seen);
    if outcome.is_err() {
        // Nobody holds the device any more: the motion stops, and the force turns off.
        let _asked = [Request::StopHand, Request::Disengage].map(|request| link.send(&request));
    }
    let out = options
        .out
        .unwrap_or_else(|| PathBuf::from(format!("out/procedure-{}", format::utc_now())));
    let failure = outcome.as_ref().err().map(ToString::to_string);
    let written = report::write(&out, &link, &job, &pace, &seen, failure.as_ref(), made.clone());
    let scored =
        written.and_then(|()| debrief::write(&out, &link, &scene, &job, &seen, options.source.as_deref(), made));
    drop(core);
    outcome?;
    scored
}

fn wait(
    link: &mut Link,
    interrupted: &Interrupt,
    limit: Duration,
    mut ready: impl FnMut(&mut Link) -> Result<bool, ProcedureError>,
) -> Result<bool, ProcedureError> {
    let begun = Instant::now();
    while begun.elapsed() < limit {
        if interrupted.asked() {
            return Err(ProcedureError::Interrupted);
        }
        link.poll();
        if ready(link)? {
            return Ok(true);
        }
        std::thread::sleep(POLL_EVERY);
    }
    Ok(false)
}

fn is_ready(link: &Link) -> bool {
    link.status() == LinkStatus::Live && link.state().is_some() && link.scene().is_some() && link.snapshot().is_some()
}

fn find_core(
    link: &mut Link,
    core: &mut Option<Core>,
    program: Option<&Path>,
    device: Option<&str>,
    interrupted: &Interrupt,
) -> Result<(), ProcedureError> {
    let begun = Instant::now();
    let is_alone = |link: &Link| begun.elapsed() > APPEAR_LIMIT && link.instance().epoch().is_none();
    let looked = |link: &mut Link| Ok(is_ready(link) || is_alone(link));
    if wait(link, interrupted, FIND_LIMIT, looked)? && is_ready(link) {
        return Ok(());
    }
    let missing = match link.status() {
        LinkStatus::Absent { why } => why,
        _ => return Err(ProcedureError::NoAnswer),
    };
    let path = program.ok_or(ProcedureError::NoCore(missing))?;
    let child = core.insert(Core::start(path, link.instance(), device)?);
    let found = wait(link, interrupted, START_LIMIT, |link| match child.ended() {
        Some(status) => Err(ProcedureError::CoreEnded(status)),
        None => Ok(is_ready(link)),
    })?;
    if found {
        return Ok(());
    }
    Err(ProcedureError::NoAnswerOfStarted)
}

fn load(
    link: &mut Link,
    send: impl FnOnce(&mut Link) -> Result<u64, ProcedureError>,
    interrupted: &Interrupt,
) -> Result<(), ProcedureError> {
    let before = link.scene().map(|s| s.header.id());
    let id = send(link)?;
    let mut accepted = false;
    let shown = wait(link, interrupted, LOAD_LIMIT, |link| {
        if let Some(answer) = link.reply(id) {
            answer.map_err(ProcedureError::SceneRefused)?;
            accepted = true;
        }
        Ok(accepted && link.scene().map(|s| s.header.id()) != before && link.snapshot().is_some())
    })?;
    if shown {
        Ok(())
    } else {
        let why = "the core did not show the scene in time";
        Err(ProcedureError::NothingReceived(why))
    }
}

fn perform(
    link: &mut Link,
    job: &Job,
    mut run: Run,
    interrupted: &Interrupt,
    seen: &mut Observations,
) -> Result<(), ProcedureError> {
    // A terminal that is closed or stopped must not delay a needle.
    let lines = Lines::to_stdout();
    let begun = Instant::now();
    let mut step: Option<(usize, Option<usize>, Step)> = None;
    seen.last_event = link.events().back().map(|e| e.sequence);
    link.take_records();
    loop {
        if interrupted.asked() {
            return Err(ProcedureError::Interrupted);
        }
        link.poll();
        let status = run.advance(link);
        let now = (run.needle(), run.stabilising(), run.step());
        if step != Some(now) {
            step = Some(now);
            let seconds = begun.elapsed().as_secs_f64();
            let which = match run.stabilising() {
                Some(number) => format!("stabilising needle {} of {}", number + 1, job.stabilising.len()),
                None => format!("needle {} of {}", run.needle() + 1, job.tasks.len()),
            };
            lines.say(format!("{seconds:7.2} s  {which}, step: {}", run.step().name()));
        }
        seen.take(link, begun, &lines);
        seen.most_left(link);
        // The first plan is published before stabilising needles move the target.
        if run.stabilising().is_none()
            && run.step() > Step::Plan
            && let (Some(scene), Some(snapshot)) = (link.scene(), link.snapshot())
        {
            seen.motion.take(run.needle(), scene, snapshot);
        }
        for number in run.lost().iter().skip(seen.lost.len()) {
            let seed = number + 1;
            lines.say(format!("note: seed {seed} is lost: the tip was outside the tissue"));
        }
        seen.lost = run.lost().to_vec();
        match status {
            RunStatus::Working => std::thread::sleep(POLL_EVERY),
            RunStatus::Done => return Ok(()),
            RunStatus::Failed(why) if why.is_standing_fault() => return Err(ProcedureError::FaultStands(why)),
            RunStatus::Failed(why) => return Err(why.into()),
        }
    }
}

impl Observations {
    fn of(scene: &SceneModel) -> Self {
        Self {
            motion: TargetMotion::of(scene),
            records: Vec::new(),
            punctured: false,
            displacement_before_puncture_m: 0.0,
            last_event: None,
            events: Vec::new(),
            lost: Vec::new(),
            left: Vec::new(),
        }
    }

    fn most_left(&mut self, link: &Link) {
        if let Some(snapshot) = link.snapshot().filter(|s| s.header.left().len() > self.left.len()) {
            self.left = snapshot.header.left().to_vec();
        }
    }

    fn take(&mut self, link: &mut Link, begun: Instant, lines: &Lines) {
        self.records.extend(link.take_records());
        for event in link
            .events()
            .iter()
            .filter(|e| self.last_event.is_none_or(|last| e.sequence > last))
        {
            self.events.push(*event);
            let kind = EventKind::from_number(event.kind);
            self.punctured |= kind == Some(EventKind::Puncture);
            let what = kind.map_or_else(String::new, |k| format!("{k:?}"));
            let text = stylet_base::format::printable_line(&event.text.read());
            let seconds = begun.elapsed().as_secs_f64();
            lines.say(format!("{seconds:7.2} s  {what} {text}"));
        }
        self.last_event = link.events().back().map(|e| e.sequence).or(self.last_event);
        if let Some(s) = link.snapshot().filter(|_| !self.punctured) {
            self.displacement_before_puncture_m = self.displacement_before_puncture_m.max(s.header.max_displacement_m);
        }
    }
}
