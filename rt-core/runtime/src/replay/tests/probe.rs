//! A probe pressed beside a needle, in a recording that repeats in every bit, in both loops.

use super::left::APART_M;
use super::*;
use crate::kept_probe::KeptError;
use crate::lines::NoProbe;
use crate::rt::outside::OutsideTape;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::tissue_tape::TapedOrder;
use stylet_anatomy::Beyond;
use stylet_shm_schema::flags;
use stylet_sim::probe::{BodyProbe, NoWall, ProbePose, ProbeShape};
use stylet_sim::scene::{Material, Role, Structure, Surroundings};

/// Height of the needle above the centre of the block.
const ABOVE_M: f64 = 8e-3;

/// A gland with a hollow of 24 x 16 mm in rectal wall below it.
fn hollow() -> SceneSource {
    hollow_in(1)
}

/// The same with `times` cells for each 4 mm.
fn hollow_in(times: usize) -> SceneSource {
    let dims = [12, 14, 12].map(|n| n * times);
    let mut cells = Vec::new();
    for _ in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let [i, j] = [i, j].map(|c| (c as f64 + 0.5) / times as f64);
                let from_middle = [i - 6.0, j - 4.0];
                let across = (from_middle[0] / 3.0).powi(2) + (from_middle[1] / 2.5).powi(2);
                cells.push(match across {
                    a if a <= 1.0 => 0,
                    a if a <= 2.4 => 2,
                    _ => 1,
                });
            }
        }
    }
    let structure = |name: &str, label, role, beyond| Structure {
        name: name.to_owned(),
        label,
        role,
        material: Material {
            limits: None,
            fixed: false,
            surroundings: Surroundings::all(beyond),
            young_pa: 15e3,
            poisson: 0.45,
        },
    };
    SceneSource::of_labels(
        "hollow",
        &Labels {
            dims,
            spacing_m: 4e-3 / times as f64,
            cells,
            structures: vec![
                structure("gland", 1, Role::Target, Beyond::Fat),
                structure("rectal wall", 2, Role::Spare, Beyond::Free),
            ],
        },
    )
}

impl Recorded {
    /// Puts a probe into the hollow.
    fn with_probe(kind: TissueKind) -> Self {
        let body = LineBody::of_source(&hollow(), kind).expect("valid").expect("has lines");
        let probe = body.prepare_probe(ProbeShape::default(), &mut |_| true);
        Self::with(hollow(), kind, probe.expect("a rectum"))
    }

    fn with(source: SceneSource, kind: TissueKind, probe: BodyProbe) -> Self {
        let mut run = Self::of(source, kind, &ForceParameters::default(), ABOVE_M);
        let control = &mut run.loops.control;
        assert!(control.outside_rooms.push(OutsideTape::new()).is_ok());
        let order = TissueOrder::Probe {
            generation: 1,
            room: ProbeTape::new(&probe),
            probe: Box::new(probe),
        };
        assert!(control.tissue_orders.push(order).is_ok());
        run
    }

    /// Moves the probe's axis from one height to the other.
    fn press(&mut self, [from_m, to_m]: [f64; 2], seconds: f64) {
        let ticks = (200.0 * seconds) as u32;
        for n in 1..=ticks {
            let y = from_m + (to_m - from_m) * f64::from(n) / f64::from(ticks);
            let pose = ProbePose::new([24e-3, y, 40e-3], [0.02, 0.0, 1.0]).expect("a pose");
            self.loops.tissue.move_probe(pose);
            self.run(5e-3);
        }
    }
}

#[test]
fn a_recording_with_a_probe_repeats_in_every_bit() {
    for kind in [TissueKind::Fem, TissueKind::ChainMail] {
        let mut run = Recorded::with_probe(kind);
        run.haptic(HapticOrder::Engage);
        run.give_line(1);
        run.run(0.1);
        run.go(14e-3);
        run.press([16e-3, 18e-3], 2.0);
        run.press([18e-3, 23e-3], 2.0);
        run.go(20e-3);
        run.press([23e-3, 17e-3], 2.0);
        run.press([17e-3, 24e-3], 2.5);
        run.go(16e-3);
        run.press([24e-3, 19e-3], 3.0);
        let flight = through_a_file(&run.flight());
        assert_eq!(run.heap_calls, 0, "heap calls of the loops");
        let tissue = flight.tissue.as_ref().expect("recorded");
        assert!(tissue.memory.probe.is_there, "it begins with a probe");
        assert!(tissue.probe.len() > 1000 && tissue.probe.iter().any(|(_, entry)| entry.wrench[1] < -0.5));
        let haptic = flight.haptic.as_ref().expect("recorded");
        let moved = haptic.outside.iter().flat_map(|(_, outside)| outside.rows_m());
        assert!(haptic.ticks_on_line() > 3000 && moved.fold(0.0, |most: f64, m| most.max(m.abs())) > 1e-5);
        assert_repeats(&flight, true);
        // The recorded pose of the probe and its effect on the line matter.
        let mut other = flight.clone();
        other.tissue.as_mut().expect("recorded").probe[300].1.pose.tip_m[1] += 1e-5;
        other.haptic.as_mut().expect("recorded").outside.clear();
        assert_repeats(&other, false);
    }
}

/// The probe presses while one needle stays in and another goes in beside it; its effect on both lines is recorded, and
/// matters.
#[test]
fn a_recording_with_probe_and_staying_needle_repeats_bit_for_bit() {
    for kind in [TissueKind::Fem, TissueKind::ChainMail] {
        let mut run = Recorded::with_probe(kind);
        run.make_room_to_leave();
        run.give_line(1);
        run.press([16e-3, 16e-3], 0.1);
        run.go(14e-3);
        run.press([16e-3, 16e-3], 1.6);
        run.haptic(HapticOrder::LeaveNeedle);
        run.press([16e-3, 16e-3], 0.1);
        assert!(run.left_count() == 1 && run.has(flags::HAND_EMPTY));
        run.go(-8e-3);
        run.press([16e-3, 18e-3], 1.5);
        let second = run.beside_in(&hollow(), kind, 2, APART_M);
        run.go_beside(APART_M, -8e-3);
        run.press([18e-3, 18e-3], 0.6);
        run.give(&second);
        run.press([18e-3, 20e-3], 0.5);
        run.go_beside(APART_M, 12e-3);
        run.press([20e-3, 24e-3], 1.5);
        run.press([24e-3, 19e-3], 1.5);
        let flight = through_a_file(&run.flight());
        assert_eq!(run.heap_calls, 0, "heap calls of the loops");
        assert_repeats(&flight, true);
        let haptic = flight.haptic.as_ref().expect("recorded");
        assert_eq!(haptic.left.line_numbers().collect::<Vec<_>>(), [1]);
        assert!(haptic.ticks_on_line() > 1000);
        let mut other = flight.clone();
        let outside = &mut other.haptic.as_mut().expect("recorded").outside;
        let before = outside.len();
        outside.retain(|(_, of_line)| of_line.generation != 1);
        assert!(
            outside.len() > 200 && before > 2 * outside.len() - 100,
            "{before} {}",
            outside.len()
        );
        let found = repeat::haptic(&other, other.haptic.as_ref().expect("recorded")).expect("can be run");
        assert!(!found.is_identical(), "the needle that stays in feels the probe");
    }
}

/// A saved probe, solved in the scene's own cells: a run with it repeats from the saved answers, and when solved again.
#[test]
fn a_recording_with_a_probe_that_was_kept_repeats_in_every_bit() {
    let (source, kind, shape) = (hollow_in(2), TissueKind::ChainMail, ProbeShape::default());
    let folder = std::env::temp_dir().join(format!("stylet-kept-{}", std::process::id()));
    let body = LineBody::of_source(&source, kind).expect("valid").expect("has lines");
    assert_eq!(body.probe_edges_m(), [4e-3, 2e-3]);
    assert!(body.kept_probe(shape, &folder).expect("nothing wrong").is_none());
    let ready = body.solve_in_cells(shape, 2, &mut |_| true).expect("a rectum");
    let alone = body.solve_in_cells(shape, 1, &mut |_| true).expect("a rectum");
    assert!(
        ready.solved == alone.solved,
        "the answers do not depend on the number of threads"
    );
    let stopped = body.solve_in_cells(shape, 2, &mut |_| false);
    assert!(matches!(stopped, Err(NoProbe::Wall(NoWall::Stopped))));
    body.keep_probe(&ready, &folder).expect("written");
    let kept = body.kept_probe(shape, &folder).expect("sound").expect("kept");
    assert!(kept.ready().solved == ready.solved);

    let mut run = Recorded::with(source, kind, kept);
    run.give_line(1);
    run.press([16e-3, 16e-3], 0.1);
    run.go(14e-3);
    run.press([16e-3, 23e-3], 2.0);
    let flight = through_a_file(&run.flight());
    assert_eq!(run.heap_calls, 0, "heap calls of the loops");
    assert_repeats(&flight, true);
    let tissue = flight.tissue.as_ref().expect("recorded");
    assert_eq!(tissue.probe_edge_m(), Some(2e-3));
    let lines = solve_again(&flight, tissue, Some(&folder), &mut |_| {}).expect("kept");
    assert!(
        repeat::tissue(&flight, tissue, lines)
            .expect("can be run")
            .is_identical()
    );
    // Other elements give another probe; unknown ones are an error.
    for (edge_m, is_known) in [(4e-3, true), (3e-3, false)] {
        let mut other = tissue.clone();
        other.memory.probe.edge_m = edge_m;
        for (_, order) in &mut other.orders {
            if let TapedOrder::Probe { edge_m: of } = order {
                *of = edge_m;
            }
        }
        let lines = solve_again(&flight, &other, Some(&folder), &mut |_| {});
        assert_eq!(lines.is_ok(), is_known);
        if let Ok(lines) = lines {
            assert!(
                !repeat::tissue(&flight, &other, lines)
                    .expect("can be run")
                    .is_identical()
            );
        }
    }

    // A damaged file is not used.
    let path = body.probe_file(&shape, &folder);
    let bytes = std::fs::read(&path).expect("kept");
    let stiffer = LineBody::of_stiffened(&hollow_in(2), 2.0, kind)
        .expect("valid")
        .expect("has lines");
    assert_ne!(stiffer.probe_file(&shape, &folder), path);
    std::fs::write(stiffer.probe_file(&shape, &folder), &bytes).expect("written");
    assert!(matches!(stiffer.kept_probe(shape, &folder), Err(KeptError::Other(_))));
    let damaged = |at: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1;
        bytes
    };
    for wrong in [
        damaged(0),
        damaged(9),
        damaged(bytes.len() / 2),
        damaged(bytes.len() - 1),
        bytes[..bytes.len() - 1].to_vec(),
        bytes[..20].to_vec(),
        Vec::new(),
    ] {
        std::fs::write(&path, wrong).expect("written");
        assert!(matches!(body.kept_probe(shape, &folder), Err(KeptError::Other(_))));
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

fn assert_repeats(flight: &Flight, is_same: bool) {
    let found = repeat::haptic(flight, flight.haptic.as_ref().expect("recorded")).expect("can be run");
    assert_eq!(found.is_identical(), is_same, "forces: {found:?}");
    let tissue = flight.tissue.as_ref().expect("recorded");
    let lines = solve_again(flight, tissue, None, &mut |_| {}).expect("solved");
    let found = repeat::tissue(flight, tissue, lines).expect("can be run");
    assert_eq!(found.is_identical(), is_same, "tissue: {found:?}");
    assert!(found.positions > 0);
}
