//! A needle that bends, on a line of the loops.

use super::*;
use crate::line::{Compliance, LayerForces, Line, NEEDLE_RADIUS_M, Rows};
use crate::needle::{LayerKind, Layers};
use nalgebra::Unit;

const STIFFNESS_PA: f64 = 44e3;
const ACROSS_M: f64 = 4e-3;
const STATIONS: usize = 128;
const EI: f64 = 0.016;
/// Much less than the gland's.
const CUT_N: f64 = 0.015;

/// Makes a line along z in a uniform medium of springs, with stations across as in the loops.
fn uniform(settings: &NeedleBending) -> (HandLine, LayerForces) {
    let line = Line::new([0.0; 3], [0.0, 0.0, 1.0]).expect("a direction");
    let straight = HandLine::uniform(1, line, STATIONS).expect("valid");
    let mut source = straight.source();
    let each = 1.0 / (STIFFNESS_PA * ACROSS_M);
    let rows = || Rows::new(32, |i, j| if i == j { each } else { 0.0 });
    let compliance: &mut Compliance = source.compliance_mut();
    (compliance.across, compliance.across_spacing_m) = ([rows(), rows()], ACROSS_M);
    let mut line = HandLine::of_source(source).expect("valid");
    let forces = LayerForces {
        membrane_gain: 0.0,
        shaft_gain: 0.0,
        cutting_gain: CUT_N / (2.0 * NEEDLE_RADIUS_M * Layers::default().of(LayerKind::Gland).toughness_j_per_m2),
        bending: *settings,
        ..LayerForces::default()
    };
    line.set_forces(&forces);
    (line, forces)
}

const WITHOUT_BEVEL: NeedleBending = NeedleBending {
    bending_stiffness_n_m2: EI,
    bevel: 0.0,
    template_gap_m: 0.0,
    template_distance_m: 0.0,
};

fn tool(turned_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_unchecked(Vector3::z()), turned_rad)
}

/// Inserts the needle straight to a depth.
fn insert(line: &mut HandLine, depth_m: f64) -> LineOutput {
    let mut last = line.step(0.0, 1e-3);
    for n in 0..=(depth_m / 1e-4).round() as u32 {
        let tip = Vector3::z() * (1e-4 * f64::from(n));
        last = line.step(tip.z, 1e-3);
        line.bend(&tip, &tool(0.0), &last).expect("bends");
    }
    last
}

/// Hetenyi: `2 P beta / k` at the end of a long beam on springs. P is the bevel's part of the cutting force, by the
/// roll of the hand.
#[test]
fn a_bevel_bends_the_needle_as_a_beam_on_springs() {
    let (mut line, mut forces) = uniform(&WITHOUT_BEVEL);
    // The tip is at the end of a station across: it hardly moves the tissue before it.
    let depth_m = 0.124;
    let cut = insert(&mut line, depth_m);
    assert!(
        (cut.tip_n - CUT_N).abs() < 1e-9 && (cut.tip_material_m - 0.124).abs() < 1e-4,
        "{cut:?}"
    );
    forces.bending.bevel = 30.0;
    line.set_forces(&forces);
    let beta = (STIFFNESS_PA / (4.0 * EI)).powf(0.25);
    let wanted_m = 2.0 * 30.0 * CUT_N * beta / STIFFNESS_PA;
    let [first, second] = line.across();
    for turned_rad in [0.0_f64, 1.0, 2.5] {
        let bent = line
            .bend(&(Vector3::z() * depth_m), &tool(turned_rad), &cut)
            .expect("bends");
        let off_m = first * bent.tip_m[0] + second * bent.tip_m[1];
        let towards = Vector3::new(turned_rad.cos(), turned_rad.sin(), 0.0);
        println!(
            "{:.4} mm, {:.4} mm: {:.2} %",
            1e3 * off_m.norm(),
            1e3 * wanted_m,
            100.0 * (off_m.norm() / wanted_m - 1.0)
        );
        assert!((off_m.norm() / wanted_m - 1.0).abs() < 0.01);
        assert!(off_m.normalize().dot(&towards) > 1.0 - 1e-9, "to the side of the bevel");
    }
}

#[test]
fn a_straight_track_does_not_bend_the_needle() {
    let (mut line, mut forces) = uniform(&WITHOUT_BEVEL);
    let cut = insert(&mut line, 0.06);
    let bent = line.bend(&(Vector3::z() * 0.06), &tool(0.0), &cut).expect("bends");
    assert!(
        bent.tip_m.iter().chain(&bent.force_on_hand_n).all(|v| v.abs() < 1e-12),
        "{bent:?}"
    );
    forces.bending.bending_stiffness_n_m2 = 0.0;
    line.set_forces(&forces);
    assert!(line.bend(&(Vector3::z() * 0.06), &tool(0.0), &cut).is_none());
    let plain = HandLine::uniform(1, *line.line(), 4).expect("valid");
    assert!(!plain.can_bend() && line.can_bend());
    line.reset();
    assert!(line.across_loads_n(0).iter().all(|f| *f == 0.0));
}

/// `cargo test --profile quick -p stylet-sim --lib times_of_a_bent_needle -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn times_of_a_bent_needle() {
    let settings = NeedleBending {
        bevel: 0.1,
        template_gap_m: 1e-4,
        template_distance_m: 0.02,
        ..WITHOUT_BEVEL
    };
    let (mut line, _) = uniform(&settings);
    let mut times_us: Vec<f64> = Vec::new();
    for n in 0..12_000 {
        let depth_m = 0.064 * (1.0 - (f64::from(n) / 1000.0).cos());
        let tip = Vector3::new(1e-3 * (f64::from(n) / 300.0).sin(), 0.0, depth_m);
        let answer = line.step(depth_m, 1e-3);
        let begun = std::time::Instant::now();
        line.bend(&tip, &tool(0.0), &answer).expect("bends");
        times_us.push(begun.elapsed().as_secs_f64() * 1e6);
    }
    times_us.sort_by(f64::total_cmp);
    let part = |p: f64| times_us[((times_us.len() - 1) as f64 * p) as usize];
    println!(
        "beam of up to 32 stations across: p50 {:.1}, p99 {:.1}, max {:.1} us",
        part(0.5),
        part(0.99),
        part(1.0)
    );
}
