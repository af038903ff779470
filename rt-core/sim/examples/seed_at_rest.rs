//! Drops seeds from a needle that drags the gland along, then draws the needle out: each seed comes to rest nearer to
//! the apex than it was dropped.
//!
//! ```text
//! cargo run --release -p stylet-sim --example seed_at_rest
//! ```

use std::error::Error;

use stylet_sim::scene::{Scene, TissueKind};
use stylet_sim::tissue::{FemTissue, Held, MaterialPoint, TissueModel, TissueSpec};

const DT_S: f64 = 5e-3;
/// Ticks in which the tip moves.
const TICKS: u32 = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Scene::builtin("paper")?;
    let mut tissue = FemTissue::<f32>::new(&scene).map_err(|problems| format!("{problems:?}"))?;
    let (low_m, high_m) = scene.target_bounds_m();
    let at_rest = [0, 1, 2].map(|axis| 0.5 * (low_m[axis] + high_m[axis]));
    let element = scene
        .lattice
        .element_at_rest(at_rest)
        .ok_or("no tissue in the middle")?;

    println!("drag mm  force N   dropped at z mm  rests at z mm   error mm");
    for drag_mm in 0..=5 {
        let mut held = Held {
            element,
            position_m: scene.lattice.rest_m(element),
            patch_m: TissueSpec::from(TissueKind::Fem).tip_patch_m,
        };
        // The solver does a few cycles in each tick, so the tip moves over several.
        let mut report = tissue.step(Some(held), DT_S);
        for _ in 0..TICKS {
            held.position_m[2] += 1e-3 * f64::from(drag_mm) / f64::from(TICKS);
            report = tissue.step(Some(held), DT_S);
        }
        let position_m = held.position_m;
        // The needle leaves the seed where its tip is: in the tissue that it holds.
        let seed =
            MaterialPoint::locate(&tissue.deformed(), position_m, Some(element)).ok_or("tip outside the tissue")?;
        tissue.step(None, DT_S);
        let rest_m = seed.position_m(&tissue.deformed());
        let force_n = report.tip_force_n.map_or(0.0, |force| force[2]);
        let [dropped_mm, rest_mm] = [position_m[2], rest_m[2]].map(|z| 1e3 * (z - low_m[2]));
        println!(
            "{drag_mm:7}  {force_n:7.2}  {dropped_mm:15.2}  {rest_mm:13.2}  {:9.2}",
            rest_mm - dropped_mm
        );
    }
    Ok(())
}
