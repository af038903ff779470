//! Pushes a needle at 20 mm/s into the paper's gland, holds it there, and draws it back: the force on the hand and the
//! displacement of the gland, every 2 mm.
//!
//! ```text
//! cargo run --release -p stylet-sim --example needle_into_gland
//! ```

use std::error::Error;

use nalgebra::{UnitQuaternion, Vector3};
use stylet_device::{DeviceInfo, Sample};
use stylet_settings::ParameterSet;
use stylet_sim::active::activate;
use stylet_sim::force::{ChainParameters, ChainState, LocalResponse, Touch, chain};
use stylet_sim::needle::{LayerKind, Phase};
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{ChainMailTissue, Held, MaterialPoint, TissueModel};

const DT_S: f64 = 1e-3;
/// Ticks of the force loop for each tick of the tissue.
const TISSUE_EVERY: usize = 5;
const SPEED_M_PER_S: f64 = 20e-3;
/// Depth of the tip at the start: outside the gland.
const START_M: f64 = -4e-3;
const DEEPEST_M: f64 = 30e-3;
const HOLD_S: f64 = 0.5;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::builtin("paper")?;
    let device = DeviceInfo::phantom_premium_1_5();
    let active = activate(&ParameterSet::default(), &device)?;
    let parameters = ChainParameters {
        needle: active.needle,
        force: active.force,
    };
    let mut tissue = ChainMailTissue::new(&scene, active.limits);

    // The needle enters at the apex, along +z, and holds the element that it meets first.
    let (low_m, high_m) = scene.lattice.bounds_m();
    let middle_m = [0, 1].map(|axis| 0.5 * (low_m[axis] + high_m[axis]));
    let entry = (0..)
        .map(|n| low_m[2] + 1e-4 * f64::from(n))
        .take_while(|z| *z < high_m[2])
        .find_map(|z| MaterialPoint::at_rest(&scene.lattice, [middle_m[0], middle_m[1], z]))
        .ok_or("no tissue on the axis of the needle")?;
    let contact = Vector3::from(entry.rest_m(&scene.lattice));
    let mut held = Held {
        element: entry.element,
        position_m: scene.lattice.rest_m(entry.element),
        patch_m: 0.0,
    };
    let touch = Touch {
        contact_in_world: contact,
        path_direction: Vector3::z(),
        layer: LayerKind::Gland,
        layer_number: 1,
        layer_in_world: contact,
        local: LocalResponse::default(),
    };

    let mut state = ChainState::new(&device);
    state.gate.engage();
    let inwards_s = (DEEPEST_M - START_M) / SPEED_M_PER_S;
    let ticks = ((2.0 * inwards_s + HOLD_S) / DT_S) as usize;
    let mut is_out = false;
    let mut travel_before = Vector3::zeros();
    println!(" depth mm   force N  gland moves mm  phase");
    for tick in 0..=ticks {
        let time_s = tick as f64 * DT_S;
        let moving_s = time_s.min(inwards_s) - (time_s - inwards_s - HOLD_S).max(0.0);
        let depth_m = START_M + SPEED_M_PER_S * moving_s;
        let tip = contact + depth_m * Vector3::z();
        let sample = Sample {
            tip_in_world: tip,
            world_from_tool: UnitQuaternion::identity(),
            buttons: 0,
            sequence: tick as u64,
        };
        let touches = !is_out && (depth_m > 0.0 || state.path.innermost() > 0);
        let out = chain::step(
            &parameters,
            &device,
            &mut state,
            &sample,
            touches.then_some(&touch),
            DT_S,
        );
        is_out |= out.left;
        if out.puncture {
            println!("{:9.1}  the capsule gives way", 1e3 * depth_m);
        }
        if tick % TISSUE_EVERY == 0 {
            // Until the puncture the tip carries its element along; then the tissue slips along the shaft (eq. 6).
            if state.needle.punctured {
                let point = MaterialPoint::locate(&tissue.deformed(), tip.into(), Some(held.element));
                if let Some(point) = point.filter(|point| point.element != held.element) {
                    held.element = point.element;
                    held.position_m = tissue.deformed().position_m(point.element);
                }
            }
            let travel = state.held_travel_m - travel_before;
            travel_before = state.held_travel_m;
            for axis in 0..3 {
                held.position_m[axis] += travel[axis];
            }
            let holds = out.phase != Phase::Outside;
            let report = tissue.step(holds.then_some(held), TISSUE_EVERY as f64 * DT_S);
            if tick % 100 == 0 {
                let moved_mm = 1e3 * f64::from(report.max_displacement) * scene.lattice.spacing_m;
                let force_n = out.wrench.force_n.z;
                println!("{:9.1}  {force_n:8.2}  {moved_mm:14.2}  {:?}", 1e3 * depth_m, out.phase);
            }
        }
    }
    Ok(())
}
