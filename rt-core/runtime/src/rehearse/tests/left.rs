//! Stabilising needles in rehearsals.

use super::*;

/// Four needles about the centre, 40 mm deep.
pub(super) fn stabilised(count: usize) -> NeedleRehearsal {
    let run = needle();
    let at = |n: usize| {
        let (sine, cosine) = (std::f64::consts::FRAC_PI_2 * (n as f64 + 0.5)).sin_cos();
        StabilisingNeedle {
            entry_m: (Vector3::from(run.entry_m) + Vector3::new(cosine, sine, 0.0) * 10e-3).into(),
            direction: [0.0, 0.0, 1.0],
            depth_m: 0.04,
        }
    };
    NeedleRehearsal {
        stabilising: (0..count).map(at).collect(),
        ..run
    }
}

/// Mean displacement of the target along the needle in each tissue tick, m, from the start of the needle that drops
/// seeds; the first is due to the others.
fn shifts_m(stage: &mut Stage, run: &NeedleRehearsal) -> (Vec<f64>, Rehearsed) {
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    let rehearsed = stage.rehearse(run, &set, &stop).expect("goes through");
    let active = activate(&set, &stage.device).expect("valid");
    let lines = stage.lines(run, false, &stop).expect("kept");
    let mut world = stage.world.take().expect("given back");
    world.tissue.return_to_rest();
    let mut rig = Rig::new(world, &active, (&stage.device, stage.hand), run);
    rig.take_lines(lines);
    let mut script = Script::new(run);
    let mut shifts_m = Vec::new();
    loop {
        if rig.tick() && script.is_at_needle() {
            shifts_m.push(stage.target.mean_m(rig.deformed()).z);
        }
        if script.advance(&mut rig).expect("goes on") {
            break;
        }
    }
    stage.world = Some(rig.into_world());
    (shifts_m, rehearsed)
}

#[test]
fn the_gland_moves_less_between_four_stabilising_needles() {
    for kind in [TissueKind::ChainMail, TissueKind::Fem] {
        let mut stage = stage_of(kind);
        let (alone_m, alone) = shifts_m(&mut stage, &needle());
        let (beside_m, beside) = shifts_m(&mut stage, &stabilised(4));
        let range_m = |shifts_m: &[f64]| {
            let from = shifts_m.first().copied().unwrap_or(0.0);
            let each = shifts_m.iter().map(|m| m - from);
            each.fold([0.0_f64; 2], |[out, inwards], m| [out.min(m), inwards.max(m)])
        };
        let ([out_m, in_m], [beside_out_m, beside_in_m]) = (range_m(&alone_m), range_m(&beside_m));
        println!(
            "{}: the gland moves {:.2} mm in and {:.2} mm out alone; beside four, which hold it {:.2} mm in, {:.2} and {:.2} mm; peak {:.2} and {:.2} N; seeds off {:?} and {:?} mm",
            kind.name(),
            in_m * 1e3,
            out_m * 1e3,
            beside_m[0] * 1e3,
            beside_in_m * 1e3,
            beside_out_m * 1e3,
            alone.peak_force_n,
            beside.peak_force_n,
            off_mm(&alone),
            off_mm(&beside)
        );
        assert!(beside_in_m < 0.7 * in_m, "{beside_in_m} {in_m}");
        assert!(beside_out_m.abs() < out_m.abs(), "{beside_out_m} {out_m}");
        assert_eq!(beside.seeds.len(), 3);
        // The same bytes again; the others leave no trace for a needle alone.
        let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
        assert_eq!(
            stage.rehearse(&stabilised(4), &set, &stop).expect("goes through"),
            beside
        );
        assert_eq!(stage.rehearse(&needle(), &set, &stop).expect("goes through"), alone);
    }
}

fn off_mm(run: &Rehearsed) -> Vec<f64> {
    let pairs = run.seeds.iter().zip(needle().drops_m);
    pairs
        .map(|(seed, drop)| ((seed.position_m[2] - drop[2]) * 1e5).round() / 100.0)
        .collect()
}

#[test]
fn more_needles_than_may_stay_and_tissue_without_lines_are_refused() {
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    let refused = stage().rehearse(&stabilised(5), &set, &stop).expect_err("too many");
    assert!(matches!(refused, RehearseError::TooManyLeft(5)), "{refused}");
    let refused = stage_of(TissueKind::Paper).rehearse(&stabilised(1), &set, &stop);
    assert!(matches!(refused, Err(RehearseError::NoneStaysIn)));
}

/// Crossing lines load the same elements: the joint problem stays definite because each station adds the compliance of
/// its radius.
#[test]
fn a_needle_goes_in_across_the_way_of_one_that_stays_in() {
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    for kind in [TissueKind::ChainMail, TissueKind::Fem] {
        let mut stage = stage_of(kind);
        let alone = stage.rehearse(&needle(), &set, &stop).expect("goes through");
        let mut run = needle();
        // They meet 30 mm behind the entry.
        let direction = Vector3::new(-0.012, 0.0, 0.03).normalize();
        let entry_m = Vector3::from(run.entry_m) + Vector3::x() * 0.012;
        run.stabilising = vec![StabilisingNeedle {
            entry_m: entry_m.into(),
            direction: direction.into(),
            depth_m: 0.042,
        }];
        let across = stage.rehearse(&run, &set, &stop).expect("goes through");
        println!(
            "{}: alone {:.2} N and {:.2} mm, across the way of another {:.2} N and {:.2} mm",
            kind.name(),
            alone.peak_force_n,
            alone.target_shift_m * 1e3,
            across.peak_force_n,
            across.target_shift_m * 1e3
        );
        assert_eq!(across.seeds.len(), 3);
        assert!(across.peak_force_n < 1.5 * alone.peak_force_n && across.target_shift_m < alone.target_shift_m);
    }
}

/// Seeds used to be reported where the needles that stay in held them, millimetres from where they rest once those are
/// out.
#[test]
fn seeds_rest_where_they_are_once_the_needles_that_stay_in_are_drawn_out() {
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    for kind in [TissueKind::ChainMail, TissueKind::Fem] {
        let mut stage = stage_of(kind);
        let run = stabilised(2);
        let rehearsed = stage.rehearse(&run, &set, &stop).expect("goes through");
        let active = activate(&set, &stage.device).expect("valid");
        let lines = stage.lines(&run, false, &stop).expect("kept");
        let mut world = stage.world.take().expect("given back");
        world.tissue.return_to_rest();
        let mut rig = Rig::new(world, &active, (&stage.device, stage.hand), &run);
        rig.take_lines(lines);
        let mut script = Script::new(&run);
        rig.tick();
        while !script.advance(&mut rig).expect("goes on") {
            rig.tick();
        }
        let held = rig.seeds();
        for number in 1..=2 {
            rig.draw_needle(number);
            (0..6000).for_each(|_| _ = rig.tick());
        }
        assert_eq!(rig.state().left_count, 0);
        let apart_m = |a: &SeedPose, b: &SeedPose| (Vector3::from(a.position_m) - Vector3::from(b.position_m)).norm();
        for ((rest, out), held) in rehearsed.seeds.iter().zip(&rig.seeds()).zip(&held) {
            println!(
                "{}: rehearsed {:.3} mm from where it is at last, held {:.3} mm from there",
                kind.name(),
                apart_m(rest, out) * 1e3,
                apart_m(held, out) * 1e3
            );
            assert!(apart_m(rest, out) < 0.05e-3 && apart_m(held, out) > 0.3e-3);
        }
        stage.world = Some(rig.into_world());
    }
}
