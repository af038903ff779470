//! The core as the link of a window takes it: stepped by the clock.

use host_ui::app::Home;
use std::rc::Rc;
use stylet_host::link::{Link, LocalCore, Published};
use stylet_runtime::control::{Asked, Told};
use stylet_runtime::stepped_core::{SteppedCore, SteppedCoreError};
use stylet_shm_schema::{Command, UploadHeader};
use stylet_sim::scene::TissueKind;
use web_time::{Instant, SystemTime, UNIX_EPOCH};

/// Scene to begin with.
pub const SCENE: &str = "paper";

/// Begins a core for each link of a window: the first, and one after each recording.
pub fn home(scene: impl Into<String>, tissue: TissueKind) -> Home {
    let scene = scene.into();
    Rc::new(move |instance| {
        let scene = scene.clone();
        Link::here(instance, move || Demo::new(&scene, tissue))
    })
}

/// A core, and the clock that steps it.
struct Demo {
    core: SteppedCore,
    begun: Instant,
    /// Time at which it began, which no other run has, ns since 1970.
    begun_ns: u64,
}

impl Demo {
    fn new(scene: &str, tissue: TissueKind) -> Result<Self, SteppedCoreError> {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let begun_ns = since_1970.as_nanos() as u64;
        Ok(Self {
            core: SteppedCore::new(scene, tissue, begun_ns)?,
            begun: Instant::now(),
            begun_ns,
        })
    }
}

impl LocalCore for Demo {
    fn command(&mut self, command: &Command) {
        self.core.ask(Asked::Command(Box::new(*command)));
    }

    fn upload(&mut self, header: &UploadHeader, cells: &[u8]) {
        self.core.ask(Asked::Volume(Box::new(*header), cells.to_vec()));
    }

    fn run(&mut self, publish: &mut dyn FnMut(Published<'_>)) {
        self.core.step(self.begun_ns + self.begun.elapsed().as_nanos() as u64);
        for told in self.core.take() {
            publish(match &told {
                Told::Session(session) => Published::Session(session),
                Told::Parameters(parameters) => Published::Parameters(parameters),
                Told::Plan(plan) => Published::Plan(plan),
                Told::Event(event) => Published::Event(event),
                Told::Reply(reply) => Published::Reply(reply),
                Told::Rehearsal(rehearsal) => Published::Rehearsal(rehearsal),
                Told::Records(records) => Published::Records(records),
                Told::Scene(header, words) => Published::Scene(header, words),
                Told::Snapshot(header, vertices) => Published::Snapshot(header, vertices),
            });
        }
        publish(Published::State(self.core.state()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use stylet_base::interrupt::Interrupt;
    use stylet_implant::plan::rehearse::{LinkRehearser, Rehearser};
    use stylet_implant::workflow::{NeedleTask, Pace, Run, RunStatus, default_plan};
    use stylet_shm_schema::Instance;

    /// The loops of a live run give the seeds of a rehearsal to some micrometres.
    const AGREES_M: f64 = 20e-6;

    #[test]
    fn five_seeds_rest_where_the_rehearsal_of_the_same_needle_puts_them() {
        let mut link = home(SCENE, TissueKind::ChainMail)(Instance::new("demo-test").expect("a name"));
        let begun = Instant::now();
        let wait = |link: &mut Link| {
            assert!(begun.elapsed() < Duration::from_secs(300));
            std::thread::sleep(Duration::from_millis(2));
            link.poll();
        };
        while link.scene().is_none() {
            wait(&mut link);
        }
        let plan = default_plan(&link.scene().expect("a scene").header);
        let task = NeedleTask::as_planned(plan.clone());
        let rehearsed = LinkRehearser {
            link: &mut link,
            interrupted: &Interrupt::default(),
            stabilising: &[],
            earlier: &[],
        };
        let rehearsed = { rehearsed }.rehearse(&task.drops, &Pace::default(), false);
        let rehearsed = rehearsed.expect("a rehearsal").seeds_m;
        let mut run = Run::new(plan, Pace::default());
        loop {
            wait(&mut link);
            match run.advance(&mut link) {
                RunStatus::Working => {}
                RunStatus::Done => break,
                RunStatus::Failed(why) => panic!("{why}"),
            }
        }
        let header = &link.snapshot().expect("a snapshot").header;
        let seeds = &header.seeds[..header.seed_count as usize];
        assert_eq!(seeds.len(), 5);
        for (seed, expected) in seeds.iter().zip(rehearsed) {
            let off = (0..3)
                .map(|a| seed.position_m[a] - expected[a])
                .map(|d| d * d)
                .sum::<f64>()
                .sqrt();
            assert!(off < AGREES_M, "{off:e} m");
        }
    }
}
