//! Insertions at the speeds of the clinic: forces of each layer, and how far the gland goes along.

use nalgebra::Vector3;
use rt_core::needle::Phase;
use rt_core::rt::world::World;
use rt_core::scene::Scene;
use rt_core::tissue::TissueParameters;
use stylet_benches::desk::{Desk, axis_start, gland_shift_m};
use stylet_hw::Hand;

/// What an insertion was: largest force, largest shift of the gland, punctures.
fn insertion(scene: &str, depth_m: f64, speed_m_per_s: f64) -> (f64, f64, u32) {
    let scene = Scene::builtin(scene).expect("built in");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    let world = World::new(scene, limits, 1).expect("ChainMail takes every scene");
    let start = axis_start(&world);
    let mut desk = Desk::new(world, start, Hand::steady(), 5);
    desk.go_to(start + Vector3::z() * depth_m, speed_m_per_s);
    let (mut force_n, mut shift_m) = (0.0f64, 0.0f64);
    let mut phases = vec![Phase::Outside];
    for tick in 0..((depth_m / speed_m_per_s + 1.0) * 1e3) as u64 {
        let output = desk.step();
        force_n = force_n.max(-output.wrench.force_n.z);
        if tick % 5 == 0 {
            shift_m = shift_m.max(gland_shift_m(desk.tissue.world()));
        }
        if phases.last() != Some(&output.phase) {
            phases.push(output.phase);
        }
    }
    println!(
        "  {:.0} mm/s: {force_n:.2} N, gland {:.2} mm, {} punctures, {phases:?}",
        speed_m_per_s * 1e3,
        shift_m * 1e3,
        desk.chain.needle.punctures
    );
    (force_n, shift_m, desk.chain.needle.punctures)
}

#[test]
fn the_faster_the_needle_the_less_the_gland_moves() {
    let shifts = [0.005, 0.048, 0.28].map(|speed| insertion("paper", 0.035, speed).1);
    assert!(shifts[0] > shifts[1] && shifts[1] > shifts[2], "{shifts:?}");
    assert!(shifts[2] > 0.0, "the membrane still pushes the gland");
}

#[test]
fn skin_gives_way_at_its_own_force_and_is_not_the_last_membrane() {
    let (force_n, _, punctures) = insertion("pelvis", 0.08, 0.048);
    // 0.9 of 9 N and of the damping.
    assert!((8.0..8.5).contains(&force_n), "{force_n} N");
    assert!(punctures >= 2, "{punctures} punctures");
}
