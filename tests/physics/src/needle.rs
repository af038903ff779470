//! Hard cases of a needle on its line, as shipped: both loops, the paper's gland, ChainMail and finite elements.

use nalgebra::Vector3;
use stylet_benches::session::{Session, Tick, axis_start, gland_shift_m};
use stylet_hw::{Hand, LinkFaults};
use stylet_runtime::lines::LineBody;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::HAPTIC_TICKS_PER_TISSUE_TICK;
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::TissueParameters;
use stylet_sim::line::ReadyLine;
use stylet_sim::scene::{SceneSource, TissueKind};

mod deep;
mod grazing;
mod hard;
mod off_line;

const KINDS: [TissueKind; 2] = [TissueKind::ChainMail, TissueKind::Fem];

/// Body and line, shared by successive insertions.
struct Theatre {
    world: Option<Box<World>>,
    start: Vector3<f64>,
    line: ReadyLine,
}

/// One needle in a steady hand; depths are from the body's surface.
struct Insertion {
    session: Session,
    surface: Vector3<f64>,
}

impl Theatre {
    fn of(tissue: TissueKind) -> Self {
        Self::in_scene("paper", tissue)
    }

    fn in_scene(scene: &str, tissue: TissueKind) -> Self {
        Self::beside_axis(&SceneSource::Builtin(scene.to_owned()), tissue, 0.0)
    }

    /// Builds a needle at that distance from the axis of the gland, along x.
    fn beside_axis(source: &SceneSource, tissue: TissueKind, beside_m: f64) -> Self {
        let scene = source.build().expect("no problem with it");
        let limits = TissueParameters::default().validate().expect("defaults are valid");
        let world = World::new(scene, tissue, limits, 1).expect("can be used");
        let start = axis_start(&world) + Vector3::x() * beside_m;
        let body = LineBody::of_source(source, tissue).expect("can be solved");
        let line = body
            .expect("has lines")
            .prepare(1, start.into(), [0.0, 0.0, 1.0], false, &[], &mut || true);
        Self {
            world: Some(Box::new(world)),
            start,
            line: line.expect("through the gland"),
        }
    }

    fn begin(&mut self) -> Insertion {
        self.begin_with(ForceParameters::default(), HAPTIC_TICKS_PER_TISSUE_TICK)
    }

    fn begin_with(&mut self, force: ForceParameters, tissue_every: u64) -> Insertion {
        let mut world = self.world.take().expect("given back");
        world.tissue.return_to_rest();
        let hand = (Hand::steady(), LinkFaults::default());
        let line = (self.start, self.line.clone());
        Insertion {
            session: Session::on_line_every(world, line, hand, force, tissue_every),
            surface: self.start + Vector3::z() * 5e-3,
        }
    }

    fn end(&mut self, insertion: Insertion) {
        self.world = Some(insertion.session.into_world());
    }
}

impl Insertion {
    /// Brings the tip there and holds it for half a second.
    fn go_to(&mut self, depth_m: f64, speed_m_per_s: f64) -> Vec<Tick> {
        let goal = self.surface + Vector3::z() * depth_m;
        let way_m = (goal - self.session.true_tip_in_world()).norm();
        self.session.go_to(goal, speed_m_per_s);
        let seconds = way_m / speed_m_per_s + 0.5;
        (0..(seconds * 1e3) as usize).map(|_| self.session.tick()).collect()
    }

    /// Returns the largest displacement of an element, m.
    fn displacement_m(&self) -> f64 {
        let body = self.session.world().tissue.deformed();
        let elements = 0..body.lattice.element_count() as u32;
        let largest = elements
            .map(|e| Vector3::from(body.displacement(e)).norm())
            .fold(0.0, f64::max);
        largest * body.lattice.spacing_m
    }
}

/// Returns the largest force against the hand, N.
fn peak_n(ticks: &[Tick]) -> f64 {
    ticks.iter().map(|t| -t.output.wrench.force_n.z).fold(0.0, f64::max)
}

fn rest_n(ticks: &[Tick]) -> f64 {
    -ticks.last().expect("ticks").output.wrench.force_n.z
}

/// A pierced membrane is a hole: on the same track it is not felt again.
#[test]
fn a_second_pass_on_one_track_meets_no_membrane() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut needle = theatre.begin();
        let first = needle.go_to(12e-3, 0.05);
        needle.go_to(-2e-3, 0.05);
        let second = needle.go_to(12e-3, 0.05);
        let [first_n, second_n] = [&first, &second].map(|ticks| peak_n(ticks));
        println!("{kind:?}: first pass {first_n:.2} N, second {second_n:.2} N");
        assert!(first_n > 4.5 && second_n < 0.6 * first_n, "{first_n} {second_n}");
        theatre.end(needle);
    }
}

/// ChainMail by eq. 6 had 37 % more displacement at 3 mm after 6 mm than on the way there. Friction has a memory too,
/// so the test requires the same displacement after each further reversal.
#[test]
fn turns_at_depth_come_back_to_the_same_force() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut needle = theatre.begin();
        let mut at_n = vec![rest_n(&needle.go_to(45e-3, 0.05))];
        for _ in 0..5 {
            needle.go_to(25e-3, 0.05);
            at_n.push(rest_n(&needle.go_to(45e-3, 0.05)));
        }
        println!("{kind:?}: at 45 mm, and after each turn at 25 mm: {at_n:.3?} N");
        let (low, high) = at_n[1..]
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), n| (l.min(*n), h.max(*n)));
        // The hand stops within 0.1 mm of its goal.
        assert!(low > 1.0 && high - low < 0.01 * high, "{at_n:?}");
        theatre.end(needle);
    }
}

#[test]
fn through_the_far_side_and_out_again_the_body_returns_to_rest() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut needle = theatre.begin();
        let lattice = &needle.session.world().scene.lattice;
        let (low, high) = lattice.bounds_m();
        let length_m = high[2] - low[2];
        let through = needle.go_to(length_m + 20e-3, 0.05);
        let (there_m, there_n) = (needle.displacement_m(), rest_n(&through));
        let out = needle.go_to(-5e-3, 0.05);
        let _ = (0..6000).map(|_| needle.session.tick()).count();
        let (left_m, left_n) = (needle.displacement_m(), rest_n(&out));
        println!(
            "{kind:?}: body of {:.0} mm: beyond it {there_n:.2} N and {:.2} mm, peak {:.2} N; outside {left_n:.3} N and {:.4} mm",
            length_m * 1e3,
            there_m * 1e3,
            peak_n(&through),
            left_m * 1e3
        );
        assert!(peak_n(&through) < 8.5 && there_m < 15e-3, "{there_m} m");
        assert!(left_n.abs() < 0.01 && left_m < 0.05e-3, "{left_n} N, {left_m} m");
        theatre.end(needle);
    }
}

/// Stuck stations must neither creep nor ratchet.
#[test]
fn a_hand_that_trembles_for_a_minute_at_depth_moves_nothing_on() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut needle = theatre.begin();
        needle.go_to(45e-3, 0.05);
        let shift = |needle: &Insertion| needle.session.response().local.displacement_m.z;
        let tremble = |needle: &mut Insertion, seconds: usize| {
            for half in 0..seconds * 16 {
                let side = if half % 2 == 0 { 0.15e-3 } else { -0.15e-3 };
                needle
                    .session
                    .go_to(needle.surface + Vector3::z() * (45e-3 + side), 0.05);
                for _ in 0..62 {
                    needle.session.tick();
                }
            }
        };
        tremble(&mut needle, 2);
        let (begun_m, begun) = (needle.displacement_m(), shift(&needle));
        tremble(&mut needle, 60);
        let (ended_m, ended) = (needle.displacement_m(), shift(&needle));
        println!(
            "{kind:?}: largest displacement {:.4} mm, after a minute {:.4} mm; at the tip {:.4} and {:.4} mm",
            begun_m * 1e3,
            ended_m * 1e3,
            begun * 1e3,
            ended * 1e3
        );
        assert!((ended_m - begun_m).abs() < 0.05e-3, "{begun_m} m, {ended_m} m");
        theatre.end(needle);
    }
}

/// Slip is decided by force: the tissue's load and the felt force are the same at any speed.
#[test]
fn speeds_from_half_a_millimetre_to_123_in_a_second_end_alike() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut ends = Vec::new();
        for speed in [0.5e-3, 5e-3, 0.05, 0.123] {
            let mut needle = theatre.begin();
            // A fast hand goes 0.3 mm too far and comes back, which friction remembers; a slow one does not.
            needle.go_to(27e-3, speed);
            let ticks = needle.go_to(30e-3, 0.5e-3);
            ends.push((rest_n(&ticks), needle.displacement_m()));
            println!(
                "{kind:?}, {:.1} mm/s: {:.3} N, {:.3} mm",
                speed * 1e3,
                ends[ends.len() - 1].0,
                ends[ends.len() - 1].1 * 1e3
            );
            theatre.end(needle);
        }
        let spread = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = ends
                .iter()
                .fold((f64::MAX, f64::MIN), |(l, h), e| (l.min(of(e)), h.max(of(e))));
            high - low
        };
        assert!(spread(|e| e.0) < 0.005 * ends[0].0, "{ends:?}");
        assert!(spread(|e| e.1) < 0.02e-3, "{ends:?}");
    }
}

/// Patients: 15 mm median at the base after 16 needles (PMID 15090279), 6.0 to 6.6 mm in biopsies (Schouten 2012). By
/// eq. 6 the gland of `pelvis` moved by 0.4 mm.
#[test]
fn the_gland_moves_by_millimetres_until_its_membrane_gives_way() {
    for (scene, kind) in [
        ("paper", TissueKind::ChainMail),
        ("paper", TissueKind::Fem),
        ("pelvis", TissueKind::ChainMail),
        ("pelvis", TissueKind::Fem),
    ] {
        let mut theatre = Theatre::in_scene(scene, kind);
        let mut needle = theatre.begin();
        let goal = needle.surface + Vector3::z() * 60e-3;
        needle.session.go_to(goal, 0.05);
        let mut largest_m = 0.0_f64;
        for tick in 0..1500 {
            needle.session.tick();
            if tick % 5 == 0 {
                largest_m = largest_m.max(gland_shift_m(needle.session.world()));
            }
        }
        println!(
            "{scene}, {kind:?}: the gland moves by {:.2} mm at 50 mm/s",
            largest_m * 1e3
        );
        assert!((1e-3..15e-3).contains(&largest_m), "{largest_m} m");
        theatre.end(needle);
    }
}
