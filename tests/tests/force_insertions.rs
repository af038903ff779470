//! Insertions at the speeds of the clinic: forces of each layer, what gives way, and how far the gland goes along.

use host_ui::workflow::default_plan;
use nalgebra::Vector3;
use rt_core::needle::{LayerKind, Layers, Phase};
use rt_core::rt::world::World;
use rt_core::scene::Scene;
use rt_core::tissue::TissueParameters;
use stylet_benches::desk::{Desk, axis_start, gland_shift_m};
use stylet_hw::Hand;
use stylet_tests::rehearsal::Theatre;

/// What an insertion was.
struct Insertion {
    largest_force_n: f64,
    largest_shift_m: f64,
    /// Each membrane that gave way, and how far from the start it was met.
    gave_way: Vec<(LayerKind, f64)>,
}

fn world(scene: &str) -> World {
    let scene = Scene::builtin(scene).expect("built in");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    World::new(scene, limits, 1).expect("ChainMail takes every scene")
}

fn insertion(scene: &str, depth_m: f64, speed_m_per_s: f64) -> Insertion {
    let world = world(scene);
    let start = axis_start(&world);
    insertion_from(world, start, depth_m, speed_m_per_s)
}

/// Along z.
fn insertion_from(world: World, start: Vector3<f64>, depth_m: f64, speed_m_per_s: f64) -> Insertion {
    let mut desk = Desk::new(world, start, Hand::steady(), 5);
    desk.go_to(start + Vector3::z() * depth_m, speed_m_per_s);
    let (mut force_n, mut shift_m) = (0.0f64, 0.0f64);
    let (mut phases, mut gave_way, mut contact_m) = (vec![Phase::Outside], Vec::new(), 0.0);
    for tick in 0..((depth_m / speed_m_per_s + 1.0) * 1e3) as u64 {
        let output = desk.step();
        force_n = force_n.max(-output.wrench.force_n.z);
        let tip_m = desk.chain.tip_in_world.map_or(0.0, |tip| tip.z - start.z);
        if phases == [Phase::Outside] {
            contact_m = tip_m;
        }
        if tick % 5 == 0 {
            shift_m = shift_m.max(gland_shift_m(desk.tissue.world()));
        }
        if phases.last() != Some(&output.phase) {
            phases.push(output.phase);
        }
        if gave_way.len() < desk.chain.needle.punctures as usize {
            let section = desk.chain.path.sections().last().expect("what gave way was met");
            println!(
                "  {:?} met at {:.1} mm",
                section.kind,
                (contact_m + section.entry_m) * 1e3
            );
            println!("    gave way at {:.1} mm", tip_m * 1e3);
            gave_way.push((section.kind, contact_m + section.entry_m));
        }
    }
    println!(
        "  {:.0} mm/s: {force_n:.2} N, gland {:.2} mm, {} punctures, {phases:?}",
        speed_m_per_s * 1e3,
        shift_m * 1e3,
        gave_way.len()
    );
    Insertion {
        largest_force_n: force_n,
        largest_shift_m: shift_m,
        gave_way,
    }
}

/// Layers with a membrane that a line along z meets in the body at rest, each kind once, as they are felt.
fn membranes_on_line(world: &World, start: Vector3<f64>, depth_m: f64) -> Vec<(LayerKind, f64)> {
    let (lattice, layers) = (&world.scene.lattice, Layers::default());
    let half_m = 0.5 * lattice.spacing_m;
    let mut on_line: Vec<(f64, LayerKind)> = (0..lattice.element_count() as u32)
        .filter(|&e| {
            let at = lattice.rest_m(e);
            let off = |axis: usize| start[axis] - at[axis];
            (0..2).all(|a| off(a) >= -half_m && off(a) < half_m) && (start.z..start.z + depth_m).contains(&at[2])
        })
        .map(|e| (lattice.rest_m(e)[2] - half_m - start.z, world.layer(e)))
        .collect();
    on_line.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut met: Vec<(LayerKind, f64)> = Vec::new();
    for (at_m, kind) in on_line {
        if layers.of(kind).has_membrane() && met.iter().all(|(known, _)| *known != kind) {
            println!("  at rest: {kind:?} from {:.1} mm", at_m * 1e3);
            met.push((kind, at_m));
        }
    }
    met
}

#[test]
fn the_faster_the_needle_the_less_the_gland_moves() {
    let shifts = [0.005, 0.048, 0.28].map(|speed| insertion("paper", 0.035, speed).largest_shift_m);
    assert!(shifts[0] > shifts[1] && shifts[1] > shifts[2], "{shifts:?}");
    assert!(shifts[2] > 0.0, "the membrane still pushes the gland");
}

#[test]
fn skin_gives_way_at_its_own_force_and_is_not_the_last_membrane() {
    let was = insertion("pelvis", 0.08, 0.048);
    // 0.9 of 9 N and of the damping.
    let force_n = was.largest_force_n;
    assert!((8.0..8.5).contains(&force_n), "{force_n} N");
    assert_eq!(was.gave_way.first().map(|(kind, _)| *kind), Some(LayerKind::Perineum));
    assert!(was.gave_way.len() >= 2, "{:?}", was.gave_way);
}

/// The axis of the gland goes through skin, capsule and urethra, the planned path past the urethra: three and two.
#[test]
fn what_gives_way_in_the_pelvis_is_what_lies_on_the_needles_line() {
    let theatre = Theatre::builtin("pelvis");
    let plan = default_plan(&theatre.scene.header);
    assert_eq!(plan.direction, [0.0, 0.0, 1.0]);
    let axis = axis_start(&world("pelvis"));
    for (what, start) in [("axis of the gland", axis), ("planned path", plan.entry_m.into())] {
        let depth_m = 0.1;
        println!("{what}, from {:.1} {:.1} mm:", start.x * 1e3, start.y * 1e3);
        let at_rest = membranes_on_line(&world("pelvis"), start, depth_m);
        let was = insertion_from(world("pelvis"), start, depth_m, 0.048);
        let kinds = |list: &[(LayerKind, f64)]| list.iter().map(|(kind, _)| *kind).collect::<Vec<_>>();
        assert_eq!(kinds(&was.gave_way), kinds(&at_rest), "{what}");
        for ((kind, met_m), (_, rest_m)) in was.gave_way.iter().zip(&at_rest) {
            // The needle pushes before it the tissue that it then meets: never nearer than at rest by more than an element.
            let moved_m = met_m - rest_m;
            assert!(
                (-2e-3..0.02).contains(&moved_m),
                "{what}, {kind:?}: met {moved_m} m deeper than it lies"
            );
        }
    }
}
