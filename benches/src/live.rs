//! The two loops through one insertion, as a scene ships, tick by tick against the converged solution of the same tick.

use crate::error::{Field, Spread, best_shift_m, field, largest_m};
use crate::own::OwnTwin;
use crate::session::{Session, axis_start};
use crate::twin::{Mean, Twin, TwinSettings, default_forces};
use crate::unfolded::Unfolded;
use nalgebra::Vector3;
use std::sync::Arc;
use std::time::Instant;
use stylet_hw::{Hand, LinkFaults};
use stylet_runtime::lines::LineBody;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::HAPTIC_TICKS_PER_TISSUE_TICK;
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::ChainOutput;
use stylet_sim::limits::TissueParameters;
use stylet_sim::line::{HandLine, ReadyLine, StationSettings};
use stylet_sim::scene::{SceneSource, TissueKind};
use stylet_sim::tissue::PackedField;

/// Ticks in which the largest displacement is less are not compared: nothing to be right about.
const LEAST_M: f64 = 0.5e-3;
/// Every so many ticks of the tissue loop are compared.
const COMPARED: usize = 4;
/// A larger body is solved in f32, which takes half of the time and is good to a residual of 1e-5.
const MOST_DOUBLE: usize = 30_000;
/// The force comes up within half a second after the hand engages.
const WAIT_S: f64 = 0.6;

/// One needle along z through a built-in scene.
#[derive(Clone, Copy, Debug)]
pub struct LiveCase {
    /// Built-in scene.
    pub scene: &'static str,
    /// Distance from the axis of the gland, along x.
    pub beside_m: f64,
    /// Depth of the tip.
    pub depth_m: f64,
    /// Speed of the hand, in and out.
    pub speed_m_per_s: f64,
}

/// One tick of the tissue loop, against the converged solution of the same tick.
#[derive(Clone, Copy, Debug)]
pub struct LiveTick {
    /// Largest displacement of an element, converged.
    pub largest_m: f64,
    /// Distance of the elements that move, RMS: as it ships, where nothing moves, by the best shift as one piece.
    pub rms_m: [f64; 3],
    /// Largest distance, as it ships.
    pub worst_m: f64,
    /// Force of the tip on the tissue, as it ships and converged.
    pub tip_n: [f64; 2],
    /// Force of tip and shaft on the hand against the way in, as it ships and converged.
    pub hand_n: [f64; 2],
    /// Error of ChainMail against its own converged answer.
    pub own: Option<OwnTick>,
}

/// Error of ChainMail in one tick against what it would be with nothing left to do.
#[derive(Clone, Copy, Debug)]
pub struct OwnTick {
    /// Largest displacement of an element, converged.
    pub largest_m: f64,
    /// Distance of the elements that move from the converged ones, RMS.
    pub rms_m: f64,
    /// Force of the tip, as it ships and converged.
    pub tip_n: [f64; 2],
}

/// Twins that a session is compared with.
pub struct Twins<'a> {
    /// Finite elements, and their tissue near the tip.
    pub fem: &'a mut Twin,
    pub near_tip: Unfolded,
    /// Converged answer of ChainMail itself.
    pub own: Option<OwnTwin>,
}

/// One insertion.
pub struct Live {
    /// Ticks that were compared.
    pub ticks: Vec<LiveTick>,
    /// Each tick of the force loop alone, and each together with a tick of the tissue loop, microseconds: the least of
    /// the rounds.
    pub haptic_us: Vec<f64>,
    pub tissue_us: Vec<f64>,
    /// Bytes of the columns that the tissue loop adds up.
    pub column_bytes: usize,
    /// Elements of the body that moves, and stations of the line.
    pub elements: usize,
    pub stations: usize,
}

/// A scene with the line of one needle: as it ships, and its twin.
pub struct Theatre {
    case: LiveCase,
    source: SceneSource,
    start: Vector3<f64>,
}

impl Theatre {
    /// # Panics
    ///
    /// If the scene is not built in.
    pub fn new(case: LiveCase) -> Self {
        let source = SceneSource::Builtin(case.scene.to_owned());
        let world = world(&source, TissueKind::ChainMail);
        let start = axis_start(&world) + Vector3::x() * case.beside_m;
        Self { case, source, start }
    }

    /// Returns the line as it ships in that tissue, and how long it took.
    ///
    /// # Panics
    ///
    /// If the needle meets no tissue.
    pub fn line(&self, tissue: TissueKind) -> (ReadyLine, f64) {
        let body = LineBody::of_source(&self.source, tissue).expect("built in");
        let begun = Instant::now();
        let line = body
            .expect("has lines")
            .prepare(1, self.start.into(), [0.0, 0.0, 1.0], false, &[], &mut || true)
            .expect("through the gland");
        (line, begun.elapsed().as_secs_f64())
    }

    /// Solves the converged line in the finite elements that the scene has with `--tissue fem`, against `like` that
    /// ships there; to the first residual in f64, or to the second in f32 where the body is large.
    ///
    /// # Panics
    ///
    /// If the scene has no finite elements.
    pub fn twin(&self, like: &HandLine, [double, single]: [f64; 2]) -> Twin {
        let scene = self.source.build().expect("built in").for_tissue(TissueKind::Fem);
        let settings = |tolerance: f64| TwinSettings {
            stations: StationSettings::of_lattice(scene.body.spacing_m),
            most: like.source().stations(),
            tolerance,
            whole_of: None,
        };
        if scene.body.element_count() > MOST_DOUBLE {
            Twin::of::<f32>(&scene, like, settings(single))
        } else {
            Twin::of::<f64>(&scene, like, settings(double))
        }
    }

    /// Returns what the line `like` that ships in that tissue is compared with: `fem`, and ChainMail's own twin, whose
    /// columns are solved to a residual.
    ///
    /// # Panics
    ///
    /// If the scene has no finite elements.
    pub fn twins<'a>(&self, tissue: TissueKind, fem: &'a mut Twin, like: &HandLine, tolerance: f64) -> Twins<'a> {
        let period_s = HAPTIC_TICKS_PER_TISSUE_TICK as f64 * 1e-3;
        let is_own = tissue == TissueKind::ChainMail;
        Twins {
            fem,
            near_tip: Unfolded::new(&self.source.build().expect("built in").for_tissue(TissueKind::Fem)),
            own: is_own.then(|| OwnTwin::of(&self.source, like, tolerance, period_s)),
        }
    }

    /// Returns the insertion: in, half a second of rest, half the way out, rest. The first round is compared with the
    /// twins.
    pub fn run(&self, tissue: TissueKind, line: &ReadyLine, twins: &mut Twins<'_>, rounds: usize) -> Live {
        let mut live = Live {
            ticks: Vec::new(),
            haptic_us: Vec::new(),
            tissue_us: Vec::new(),
            column_bytes: line.body.answer.columns().iter().map(PackedField::bytes).sum(),
            elements: 0,
            stations: line.hand.source().stations(),
        };
        let mut world = Box::new(world(&self.source, tissue));
        live.elements = world.scene.body.element_count();
        for round in 0..rounds.max(1) {
            world.tissue.return_to_rest();
            let hand = (Hand::steady(), LinkFaults::default());
            let session = Session::on_line(world, (self.start, line.clone()), hand, ForceParameters::default());
            let mut watch = (round == 0).then(|| Watch::new(line.hand.as_ref(), twins));
            world = self.round(session, &mut live, watch.as_mut(), round);
        }
        live
    }

    fn round(&self, mut session: Session, live: &mut Live, mut watch: Option<&mut Watch>, round: usize) -> Box<World> {
        let LiveCase {
            depth_m, speed_m_per_s, ..
        } = self.case;
        let at = |depth_m: f64| self.start + Vector3::z() * (5e-3 + depth_m);
        let legs = [
            (-5e-3, WAIT_S),
            (depth_m, depth_m / speed_m_per_s + 0.5),
            (0.5 * depth_m, 0.5 * depth_m / speed_m_per_s + 0.3),
        ];
        let (mut tick, mut haptic, mut tissue) = (0, 0, 0);
        for (depth_m, seconds) in legs {
            session.go_to(at(depth_m), speed_m_per_s);
            for _ in 0..(seconds * 1e3) as usize {
                tick += 1;
                let is_tissue_tick = tick % HAPTIC_TICKS_PER_TISSUE_TICK == 0;
                let begun = Instant::now();
                let output = session.step();
                let us = begun.elapsed().as_secs_f64() * 1e6;
                let (list, at) = if is_tissue_tick {
                    (&mut live.tissue_us, &mut tissue)
                } else {
                    (&mut live.haptic_us, &mut haptic)
                };
                keep_least(list, *at, us, round);
                *at += 1;
                if let Some(watch) = &mut watch {
                    watch.step(&session, &output);
                    if is_tissue_tick {
                        watch.step_tissue();
                    }
                    if is_tissue_tick && tissue % COMPARED == 0 {
                        live.ticks.extend(watch.compare(session.world()));
                    }
                }
            }
        }
        session.into_world()
    }
}

fn keep_least(list: &mut Vec<f64>, at: usize, us: f64, round: usize) {
    match list.get_mut(at) {
        Some(least) if round > 0 => *least = least.min(us),
        _ => list.push(us),
    }
}

fn world(source: &SceneSource, tissue: TissueKind) -> World {
    let scene = source.build().expect("built in");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    World::new(scene, tissue, limits, 1).expect("can be used")
}

/// Follows the needle of a session with a copy of its line, and with the twins.
struct Watch<'a, 'b> {
    ships: HandLine,
    twins: &'a mut Twins<'b>,
    mean: Option<Mean>,
}

impl<'a, 'b> Watch<'a, 'b> {
    fn new(ships: &HandLine, twins: &'a mut Twins<'b>) -> Self {
        let mut ships = ships.clone();
        for hand in [&mut ships, &mut twins.fem.hand] {
            hand.reset();
            hand.set_forces(&default_forces());
        }
        Self {
            ships,
            twins,
            mean: None,
        }
    }

    /// Moves both lines to the tip that the force loop has just had.
    fn step(&mut self, session: &Session, output: &ChainOutput) {
        let Some(tip) = session.chain().tip_in_world else {
            return;
        };
        let along_m = self.ships.along_m(&tip);
        let ships = self.ships.step(along_m, 1e-3);
        self.twins.fem.hand.step(along_m, 1e-3);
        if let Some(own) = &mut self.twins.own {
            own.line.hand.step(along_m, 1e-3);
        }
        // The copy is the loop's own line, or nothing here means anything.
        let felt_n = (output.terms.membrane_n + output.terms.friction_n).z;
        assert!(
            (felt_n - ships.force_on_hand_n).abs() < 1e-9 || !self.ships.is_in_tissue(),
            "{felt_n} N in the loop, {} N on its line",
            ships.force_on_hand_n
        );
    }

    fn step_tissue(&mut self) {
        if let Some(own) = &mut self.twins.own {
            own.step();
        }
    }

    /// Compares ChainMail with its own answer.
    fn compare_own(&mut self, shown: &Field) -> Option<OwnTick> {
        let own = self.twins.own.as_mut()?;
        let now = own.field();
        let largest_m = largest_m(&now);
        let mut spread = Spread::default();
        spread.add_field(&now, |e| shown[e], largest_m);
        let lines = [&self.ships, &own.line.hand];
        Some(OwnTick {
            largest_m,
            rms_m: spread.rms_m(),
            tip_n: lines.map(|line| line.state().tip().force_n),
        })
    }

    fn compare(&mut self, world: &World) -> Option<LiveTick> {
        let body = world.tissue.deformed();
        let h = body.lattice.spacing_m;
        let converged = self.twins.near_tip.field(self.twins.fem);
        let moved = |element: u32| body.displacement(element).map(|u| u * h);
        let own = self.compare_own(&field(&body));
        let shown: Field = if body.lattice.element_count() == converged.len() {
            (0..converged.len() as u32).map(moved).collect()
        } else {
            let reference = Arc::clone(&self.twins.fem.body);
            let mean = self.mean.get_or_insert_with(|| Mean::over(body.lattice, &reference));
            mean.of(moved)
        };
        let largest_m = largest_m(&converged);
        if largest_m < LEAST_M {
            return None;
        }
        let shift_m = best_shift_m(&converged, largest_m);
        let (mut ships, mut nothing, mut shifted) = <(Spread, Spread, Spread)>::default();
        ships.add_field(&converged, |e| shown[e], largest_m);
        nothing.add_field(&converged, |_| [0.0; 3], largest_m);
        shifted.add_field(&converged, |_| shift_m, largest_m);
        let lines = [&self.ships, &self.twins.fem.hand];
        let state = lines.map(|line| line.state());
        Some(LiveTick {
            largest_m,
            rms_m: [ships, nothing, shifted].map(|spread| spread.rms_m()),
            worst_m: ships.max_m,
            tip_n: state.map(|s| s.tip().force_n),
            hand_n: state.map(|s| s.shaft_n().iter().sum::<f64>() + s.tip().force_n),
            own,
        })
    }
}
