//! The mode `paper` keeps its bits: eight scripted procedures, stepped without a clock, digested over all ticks.

use super::script::Script;
use super::*;

/// FNV-1a, 64 bits.
struct Digest(u64);

impl Digest {
    fn take(&mut self, values: &[f64]) {
        for byte in values.iter().flat_map(|v| v.to_bits().to_le_bytes()) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
}

/// Digests tip, force, torque, depth, speed and displacement of every tick, then the deeper ends of the seeds, which
/// were their places once, and the largest force. Adds every 200th tick and those ends to a trace.
fn digest(stage: &mut Stage, run: &NeedleRehearsal, case: f64, trace: &mut Vec<Vec<f64>>) -> u64 {
    let active = activate(&ParameterSet::default(), &stage.device).expect("valid");
    let mut world = stage.world.take().expect("given back");
    world.tissue.return_to_rest();
    let mut rig = Rig::new(world, &active, (&stage.device, stage.hand), run);
    let (mut script, mut all) = (Script::new(run), Digest(0xcbf2_9ce4_8422_2325));
    for tick in 0_u32.. {
        rig.tick();
        let state = rig.state();
        all.take(&state.tip_in_scene_m);
        all.take(&state.force_on_hand_n);
        all.take(&state.torque_on_hand_nm);
        all.take(&[state.depth_m, state.speed_m_per_s, rig.displacement_m()]);
        if tick.is_multiple_of(200) {
            let force_n = Vector3::from(state.force_on_hand_n).norm();
            trace.push(vec![
                case,
                f64::from(tick),
                state.depth_m,
                force_n,
                rig.displacement_m(),
            ]);
        }
        assert!(rig.seconds() < 120.0, "it does not end");
        if script.advance(&mut rig).expect("goes on") {
            break;
        }
    }
    for [x_m, y_m, z_m] in rig.tissue().deeper_ends_m() {
        all.take(&[x_m, y_m, z_m]);
        trace.push(vec![case, -1.0, x_m, y_m, z_m]);
    }
    all.take(&[rig.state().peak_force_n]);
    stage.world = Some(rig.into_world());
    all.0
}

/// A needle through a scene's target, that far off its centre, with three drops.
fn through(scene: &str, speed_m_per_s: f64, beside_m: f64) -> (Stage, NeedleRehearsal) {
    let source = SceneSource::Builtin(scene.to_owned());
    let stage = Stage::build(&source, TissueKind::Paper, DeviceInfo::phantom_premium_1_5()).expect("built in");
    let built = stylet_sim::scene::Scene::builtin(scene).expect("built in");
    let (low, high) = built.target_bounds_m();
    let (outside, _) = built.lattice.bounds_m();
    let (x, y) = ((low[0] + high[0]) / 2.0 + beside_m, (low[1] + high[1]) / 2.0);
    let half_a_seed_m = 0.5 * stylet_shm_schema::SEED_LENGTH_M;
    // The tip stops half a seed deeper.
    let at = |share: f64| [x, y, low[2] + share * (high[2] - low[2]) - half_a_seed_m];
    let run = NeedleRehearsal {
        entry_m: [x, y, outside[2] - 0.01],
        insert_m_per_s: speed_m_per_s,
        retract_m_per_s: speed_m_per_s,
        drops_m: [0.8, 0.5, 0.2].map(at).to_vec(),
        ..needle()
    };
    (stage, run)
}

/// Digests of the last commit before the needle line (097ef98).
const KEPT: [u64; 8] = [
    0x77dc_8ed7_802c_7a90,
    0x4f92_e141_4347_4a35,
    0xbd1d_2490_452f_b805,
    0xef0c_0ee9_5422_7cf0,
    0x212a_595c_0369_36e4,
    0xe574_d9d5_f4e9_9fef,
    0xca80_6868_9896_0b9f,
    0xa625_4abe_fb5d_02d8,
];

#[test]
fn the_paper_as_printed_keeps_its_bits() {
    let (mut found, mut trace) = (Vec::new(), Vec::new());
    for scene in ["paper", "pelvis"] {
        for (speed_m_per_s, beside_m) in [(0.01, 0.0), (0.05, 0.0), (0.123, 0.0), (0.05, 0.004)] {
            let (mut stage, run) = through(scene, speed_m_per_s, beside_m);
            let case = found.len() as f64;
            found.push(digest(&mut stage, &run, case, &mut trace));
        }
    }
    // Rows of a seed have the tick -1 and the place of its deeper end.
    let columns = [
        "case",
        "tick",
        "depth_m or x_m",
        "force_n or y_m",
        "displacement_m or z_m",
    ];
    let path = "rt-core/runtime/src/rehearse/tests/paper.csv";
    let changed = stylet_test_kit::trace::first_difference(path, &columns, &trace);
    assert_eq!(changed, None);
    assert_eq!(found, KEPT, "less than the trace shows: {found:#018x?}");
}
