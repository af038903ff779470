//! Insertions at clinical speeds: forces of each layer, punctures, and displacement of the gland.

use nalgebra::Vector3;
use stylet_benches::session::{Session, axis_start, gland_shift_m};
use stylet_hw::Hand;
use stylet_implant::workflow::default_plan;
use stylet_runtime::rt::world::World;
use stylet_sim::limits::TissueParameters;
use stylet_sim::needle::{LayerKind, Layers, Phase};
use stylet_sim::scene::{Scene, TissueKind};
use stylet_sim::tissue::MaterialPoint;
use stylet_tests::rehearsal::Theatre;

/// Result of an insertion.
struct Insertion {
    largest_force_n: f64,
    largest_shift_m: f64,
    /// Each punctured membrane, and the distance from the start at which it was met.
    gave_way: Vec<(LayerKind, f64)>,
}

fn world(scene: &str) -> World {
    let scene = Scene::builtin(scene).expect("built in");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    World::new(scene, TissueKind::default(), limits, 1).expect("ChainMail takes every scene")
}

fn insertion(scene: &str, depth_m: f64, speed_m_per_s: f64) -> Insertion {
    let world = world(scene);
    let start = axis_start(&world);
    insertion_from(world, start, depth_m, speed_m_per_s)
}

/// Runs an insertion along z.
fn insertion_from(world: World, start: Vector3<f64>, depth_m: f64, speed_m_per_s: f64) -> Insertion {
    let mut session = Session::new(world, start, Hand::steady(), 5);
    session.go_to(start + Vector3::z() * depth_m, speed_m_per_s);
    let (mut force_n, mut shift_m) = (0.0f64, 0.0f64);
    let (mut phases, mut gave_way, mut contact_m) = (vec![Phase::Outside], Vec::new(), 0.0);
    for tick in 0..((depth_m / speed_m_per_s + 1.0) * 1e3) as u64 {
        let output = session.step();
        force_n = force_n.max(-output.wrench.force_n.z);
        let tip_m = session.chain().tip_in_world.map_or(0.0, |tip| tip.z - start.z);
        if phases == [Phase::Outside] {
            contact_m = tip_m;
        }
        if tick % 5 == 0 {
            shift_m = shift_m.max(gland_shift_m(session.world()));
        }
        if phases.last() != Some(&output.phase) {
            phases.push(output.phase);
        }
        if gave_way.len() < session.chain().needle.punctures as usize {
            let section = session.chain().path.sections().last().expect("what gave way was met");
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

/// Layers with a membrane on a line along z through the body at rest.
fn membranes_on_line(world: &World, start: Vector3<f64>, depth_m: f64) -> Vec<(LayerKind, f64)> {
    let (lattice, layers) = (&world.scene.lattice, Layers::default());
    let half_m = 0.5 * lattice.spacing_m;
    let mut on_line: Vec<(f64, LayerKind)> = (0..lattice.element_count() as u32)
        .filter(|&e| {
            let at = lattice.rest_m(e);
            let off = |axis: usize| start[axis] - at[axis];
            (0..2).all(|a| off(a) >= -half_m && off(a) < half_m) && (start.z..start.z + depth_m).contains(&at[2])
        })
        .map(|e| {
            (
                lattice.rest_m(e)[2] - half_m - start.z,
                world.layer(&MaterialPoint::centre(e)),
            )
        })
        .collect();
    on_line.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut met: Vec<(LayerKind, f64)> = Vec::new();
    for (at_m, kind) in on_line {
        if layers.of(kind).has_membrane() && met.last().is_none_or(|(known, _)| *known != kind) {
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

/// Largest shift, to and fro, of the place where a layer is met: two elements.
const MET_WITHIN_M: f64 = 2e-3;

fn assert_met(what: &str, met: &[(LayerKind, f64)], lies: &[(LayerKind, f64)]) {
    let kinds = |list: &[(LayerKind, f64)]| list.iter().map(|(kind, _)| *kind).collect::<Vec<_>>();
    assert_eq!(kinds(met), kinds(lies), "{what}");
    for ((kind, met_m), (_, lies_m)) in met.iter().zip(lies) {
        let off_m = met_m - lies_m;
        assert!(
            off_m.abs() < MET_WITHIN_M,
            "{what}, {kind:?}: met {off_m} m from its place"
        );
    }
}

/// Three punctures in the pelvis were once mistaken for one too many: the third is the bladder.
#[test]
fn what_gives_way_in_the_pelvis_lies_on_the_needles_line() {
    let plan = default_plan(&Theatre::builtin("pelvis").scene.header);
    assert_eq!(plan.direction, [0.0, 0.0, 1.0]);
    let deepest_m = plan.seeds_m.iter().map(|s| plan.along_m(*s)).fold(0.0, f64::max);
    let start = Vector3::from(plan.entry_m);
    // To the deepest point that the window allows, and on into the bladder.
    for (what, depth_m, membranes) in [("planned path", deepest_m + 0.01, 2), ("beyond it", 0.11, 3)] {
        let lies = membranes_on_line(&world("pelvis"), start, depth_m);
        assert_eq!(lies.len(), membranes, "{what}: {lies:?}");
        let was = insertion_from(world("pelvis"), start, depth_m, 0.048);
        assert_met(what, &was.gave_way, &lies);
    }
}

/// `docs/physics.md`, layers: the tip is already in the urethra when the capsule before it gives way.
#[test]
fn on_the_gland_axis_urethra_feels_as_gland_and_the_bladder_yields() {
    let start = axis_start(&world("pelvis"));
    let lies = membranes_on_line(&world("pelvis"), start, 0.1);
    let [skin, capsule, _urethra, _capsule, bladder] = lies[..] else {
        panic!("another line than it was: {lies:?}")
    };
    let was = insertion_from(world("pelvis"), start, 0.1, 0.048);
    assert_met("axis", &was.gave_way, &[skin, capsule, bladder]);
}
