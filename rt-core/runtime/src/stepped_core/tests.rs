//! A core on one thread: a procedure through its requests, beside a rehearsal of the same needle.

use super::*;
use crate::rehearse::Stage;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use stylet_hw::DeviceInfo;
use stylet_procedure::{HandRequest, NeedleWay, Next, Observed, Pace, Procedure, Reply as Answer};
use stylet_shm_schema::*;
use stylet_sim::scene::TissueKind;

const HOST: u64 = 7;
const MS: u64 = 1_000_000;

/// A host that steps a core by 1 ms.
struct Host {
    core: SteppedCore,
    now_ns: u64,
    asked: u64,
    /// First tick with each change, or why it was refused.
    replies: BTreeMap<u64, Result<u64, String>>,
    records: Vec<TickRecord>,
    scenes: Vec<SceneHeader>,
    snapshot: SnapshotHeader,
}

impl Host {
    fn new(tissue: TissueKind) -> Self {
        Self {
            core: SteppedCore::new("paper", tissue, 5 * MS).expect("built in"),
            now_ns: 5 * MS,
            asked: 0,
            replies: BTreeMap::new(),
            records: Vec::new(),
            scenes: Vec::new(),
            snapshot: SnapshotHeader::default(),
        }
    }

    fn ask(&mut self, request: &Request) -> u64 {
        self.asked += 1;
        let command = request.encode(HOST, self.asked).expect("short");
        self.core.ask(Asked::Command(Box::new(command)));
        self.asked
    }

    fn step(&mut self, by_ns: u64) {
        self.now_ns += by_ns;
        self.core.step(self.now_ns);
        for told in self.core.take() {
            match told {
                Told::Reply(reply) => {
                    let is_accepted = reply.status == ReplyStatus::Accepted as u32;
                    let answer = is_accepted.then_some(reply.effective_tick);
                    let answer = answer.ok_or_else(|| reply.text.read());
                    self.replies.insert(reply.command_id, answer);
                }
                Told::Records(records) => self.records.extend(records),
                Told::Scene(header, words) => {
                    assert!(!words.is_empty());
                    self.scenes.push(*header);
                }
                Told::Snapshot(header, values) => {
                    assert_eq!(values.len(), (header.vertex_count + header.node_count) as usize);
                    self.snapshot = *header;
                }
                _ => {}
            }
        }
    }

    fn answer(&mut self, request: &Request) -> Result<u64, String> {
        let id = self.ask(request);
        for _ in 0..200 {
            self.step(MS);
            if let Some(answer) = self.replies.remove(&id) {
                return answer;
            }
        }
        panic!("{request:?} was not answered within 200 ms");
    }

    fn request(&mut self, request: HandRequest, way: &NeedleWay) -> u64 {
        let request = match request {
            HandRequest::Reset => Request::Reset,
            HandRequest::PublishPlan { .. } => Request::SetPlan(Some(PlannedNeedle {
                entry_m: way.entry_m.into(),
                direction: way.direction.into(),
                seeds_m: Vec::new(),
                prescribed: Prescribed::default(),
            })),
            HandRequest::Engage => Request::Engage,
            HandRequest::MoveHand(goal) => Request::MoveHand(goal),
            HandRequest::DropSeed { strand_pitch_m } => Request::DropSeed { strand_pitch_m },
            other => panic!("{other:?} has no place in this procedure"),
        };
        self.ask(&request)
    }

    /// Carries out the procedure of one needle, as `host-ui procedure` does.
    fn perform(&mut self, way: &NeedleWay, pace: Pace) {
        let mut procedure = Procedure::of_needles(vec![way.clone()], pace);
        let mut sent = None;
        for tick in 0..120_000_u32 {
            let state = *self.core.state();
            let observed = Observed {
                state: &state,
                displacement_m: Some(self.snapshot.max_displacement_m),
            };
            let answer = match sent.and_then(|id| self.replies.get(&id)) {
                None => Answer::Pending,
                Some(Ok(from)) if state.tick >= *from => Answer::InEffect,
                Some(Ok(_)) => Answer::Accepted,
                Some(Err(why)) => Answer::Refused(why.clone()),
            };
            match procedure
                .advance(f64::from(tick) * 1e-3, Some(&observed), answer)
                .expect("goes on")
            {
                Next::Send(request) => sent = Some(self.request(request, way)),
                Next::Continue => sent = None,
                Next::Done => return,
                Next::Wait => {}
            }
            if tick % 16 == 0 {
                self.ask(&Request::KeepMoving { valid_s: 0.3 });
            }
            self.step(MS);
        }
        panic!("the procedure did not end within 120 s");
    }
}

fn rehearsal() -> NeedleRehearsal {
    let scene = Scene::builtin("paper").expect("built in");
    let (low, high) = scene.lattice.bounds_m();
    let (x, y) = ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0);
    let pace = Pace::default();
    let drops_m = [0.8, 0.65, 0.5, 0.35, 0.2].map(|share| [x, y, low[2] + share * (high[2] - low[2])]);
    NeedleRehearsal {
        entry_m: [x, y, low[2] - 0.01],
        direction: [0.0, 0.0, 1.0],
        insert_m_per_s: pace.insert_m_per_s,
        retract_m_per_s: pace.retract_m_per_s,
        approach_m_per_s: pace.approach_m_per_s,
        acceleration_m_per_s2: pace.acceleration_m_per_s2,
        retract_to_m: 0.0,
        strand_pitch_m: None,
        stabilising: Vec::new(),
        earlier: Vec::new(),
        as_points: false,
        drops_m: drops_m.to_vec(),
    }
}

/// Returns the needle of a rehearsal: a seed lies with its deeper end at the tip.
fn way(run: &NeedleRehearsal) -> NeedleWay {
    let direction = Vector3::from(run.direction);
    let tip_m = |middle_m: &[f64; 3]| Vector3::from(*middle_m) + direction * (0.5 * SEED_LENGTH_M);
    NeedleWay {
        entry_m: run.entry_m.into(),
        direction,
        drops_m: run.drops_m.iter().map(tip_m).collect(),
        retract_to_m: 0.0,
        strand_pitch_m: None,
    }
}

/// A slow host makes 100 ms of ticks after one renewal, and a fast motion may go on for 37 ms without another.
#[test]
fn a_motion_goes_on_within_a_long_step() {
    let tip_m = |step_ms: u64| {
        let mut host = Host::new(TissueKind::ChainMail);
        let [x, y, z] = host.core.state().tip_in_scene_m;
        host.ask(&Request::MoveHand(HandMove {
            tip_m: [x, y, z - 0.05],
            direction: [0.0, 0.0, 1.0],
            speed_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
        }));
        for _ in 0..400 / step_ms {
            host.ask(&Request::KeepMoving { valid_s: 0.3 });
            host.step(step_ms * MS);
        }
        host.core.state().tip_in_scene_m
    };
    assert_eq!(tip_m(100), tip_m(2));
}

/// The requests of a host give what a rehearsal of the same needle with the same hand gives: the seeds to 0.1 mm, and
/// the largest force to 1 %.
#[test]
fn a_procedure_of_five_seeds_ends_as_its_rehearsal_does() {
    for tissue in [TissueKind::ChainMail, TissueKind::Paper] {
        let run = rehearsal();
        let mut stage = Stage::build(
            &SceneSource::Builtin("paper".to_owned()),
            tissue,
            DeviceInfo::phantom_premium_1_5(),
        )
        .expect("built in");
        stage.seeds_and_forces_alone();
        let wanted = stage
            .rehearse(&run, &ParameterSet::default(), &AtomicBool::new(false))
            .expect("goes through");
        let mut host = Host::new(tissue);
        host.perform(&way(&run), Pace::default());
        assert_eq!(host.snapshot.seed_count, 5);
        for (seed, wanted) in host.snapshot.seeds.iter().zip(&wanted.seeds) {
            let off_m = (Vector3::from(seed.position_m) - Vector3::from(wanted.position_m)).norm();
            println!("{tissue:?}: a seed {:.1} µm beside the rehearsed one", 1e6 * off_m);
            assert!(off_m < 1e-4, "{off_m} m");
        }
        let peak_n = host.core.state().peak_force_n;
        println!("{tissue:?}: peak {peak_n} N, rehearsed {} N", wanted.peak_force_n);
        assert!((peak_n / wanted.peak_force_n - 1.0).abs() < 0.01);
        assert!(host.records.windows(2).all(|pair| pair[1].tick == pair[0].tick + 1));
        assert_eq!(host.core.lost_ns(), 0);
    }
}

#[test]
fn the_same_requests_give_the_same_bytes() {
    let run = || {
        let mut host = Host::new(TissueKind::ChainMail);
        host.answer(&Request::Engage).expect("armed");
        let goal = HandMove {
            tip_m: rehearsal().drops_m[2],
            direction: [0.0, 0.0, 1.0],
            speed_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
        };
        host.ask(&Request::MoveHand(goal));
        for _ in 0..60 {
            host.ask(&Request::KeepMoving { valid_s: 0.3 });
            host.step(16 * MS);
        }
        // Both depend on the clock of the machine.
        let times = |record: &TickRecord| TickRecord {
            force_written_ns: 0,
            work_ns: 0,
            ..*record
        };
        let records = host.records.iter().map(times).collect::<Vec<_>>();
        bytemuck::cast_slice::<_, u8>(&records).to_vec()
    };
    let first = run();
    assert!(first == run(), "the second run differs");
}

#[test]
fn a_step_that_comes_late_makes_up_for_a_tenth_of_a_second() {
    let mut host = Host::new(TissueKind::Paper);
    host.step(1000 * MS);
    assert_eq!((host.core.state().tick, host.core.lost_ns()), (100, 900 * MS));
    host.step(3 * MS);
    assert_eq!((host.core.state().tick, host.core.lost_ns()), (103, 900 * MS));
    assert_eq!(host.core.state().fault, 0);
}

#[test]
fn another_scene_runs_and_a_flight_is_refused() {
    let mut host = Host::new(TissueKind::Paper);
    host.answer(&Request::LoadBuiltinScene(1)).expect("built in");
    let generations = host.scenes.iter().map(|scene| scene.generation).collect::<Vec<_>>();
    assert_eq!(generations, [1, 2]);
    host.step(100 * MS);
    assert_eq!(host.snapshot.scene_generation, 2);
    let why = host.answer(&Request::SaveFlight).expect_err("no recordings");
    assert!(why.contains("keeps no flight recordings"), "{why}");
}
