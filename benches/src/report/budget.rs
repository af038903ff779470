//! The error of the needle's line in the paper's gland, divided into its causes: solver, mesh, boundary.

use serde::Serialize;
use std::sync::Arc;
use stylet_anatomy::{Beyond, Surroundings};
use stylet_benches::bodies::cells;
use stylet_benches::error::{Field, Spread, largest_m, quantile, rms};
use stylet_benches::live::{LiveCase, Theatre};
use stylet_benches::twin::{self, Mean, Twin, TwinSettings, default_forces};
use stylet_sim::line::{HandLine, ReadyLine, StationSettings};
use stylet_sim::scene::{Labels, Lattice, Role, Scene, Structure, TissueKind};

/// One cause: what is compared with what, and what that changes.
#[derive(Serialize)]
pub struct Cause {
    pub cause: &'static str,
    pub between: String,
    /// Mean over the ticks and worst tick of the RMS distance, in percent of the tick's largest displacement.
    pub field_percent: f64,
    pub field_worst_percent: f64,
    /// RMS over the ticks and worst, in percent of the insertion's largest force: on the tip, on the hand.
    pub tip_percent: f64,
    pub tip_worst_percent: f64,
    pub hand_percent: f64,
    pub hand_worst_percent: f64,
}

const CASE: LiveCase = LiveCase {
    scene: "paper",
    beside_m: 0.0,
    depth_m: 45e-3,
    speed_m_per_s: 0.05,
};
/// Thickness of fat that springs of 250 kPa/m stand for.
const FAT_M: f64 = 20e-3;
const FAT_PA: [f64; 2] = [5e3, 2e3];
const TICK_S: f64 = 1e-3;
/// Every so many ticks of the force loop are compared.
const COMPARED: usize = 20;
const EXACT: f64 = 1e-8;
/// Tolerance for bodies with seven times as many elements, in f32.
const LARGE: f64 = 1e-4;

/// The insertion through one body: loads, forces and fields of the ticks compared.
struct Path {
    fields: Vec<Field>,
    tip_n: Vec<f64>,
    hand_n: Vec<f64>,
}

pub fn causes() -> Vec<Cause> {
    let theatre = Theatre::new(CASE);
    let (line, _) = theatre.line(TissueKind::Fem);
    let scene = Scene::builtin("paper").expect("built in").for_tissue(TissueKind::Fem);
    let settings = |tolerance: f64| TwinSettings {
        stations: StationSettings::of_lattice(scene.body.spacing_m),
        most: line.hand.source().stations(),
        tolerance,
        whole_of: None,
    };
    eprintln!("error budget: converged ...");
    let mut exact = Twin::of::<f64>(&scene, &line.hand, settings(EXACT));
    let converged = through(&mut exact, None);
    let mut causes = vec![cause(
        "solver",
        "columns to 4.5e-2 in f32 and 16 bits, as they ship; to 1e-8 in f64".to_owned(),
        &ships(&line),
        &converged,
    )];
    eprintln!("error budget: half the spacing ...");
    let fine = finer(&scene.lattice);
    let mut twin = Twin::of::<f32>(&fine, &line.hand, settings(LARGE));
    let mean = Mean::over(&fine.lattice, &scene.body);
    causes.push(cause(
        "mesh",
        format!(
            "{:.2} mm; {:.2} mm",
            scene.body.spacing_m * 1e3,
            fine.body.spacing_m * 1e3
        ),
        &converged,
        &through(&mut twin, Some(&mean)),
    ));
    for young_pa in FAT_PA {
        eprintln!("error budget: in fat of {} kPa ...", young_pa / 1e3);
        let block = in_fat(&scene.lattice, young_pa);
        // The gland is what moves as a whole here; the fat's other end does not move.
        let in_block = TwinSettings {
            whole_of: Some(0),
            ..settings(LARGE)
        };
        let mut twin = Twin::of::<f32>(&block, &line.hand, in_block);
        let mean = Mean::over(&block.lattice, &scene.body);
        causes.push(cause(
            "boundary",
            format!(
                "springs of 250 kPa/m; {:.0} mm of fat of {} kPa on something fixed",
                FAT_M * 1e3,
                young_pa / 1e3
            ),
            &converged,
            &through(&mut twin, Some(&mean)),
        ));
    }
    causes
}

/// Returns the shipped line and its columns, on the same path.
fn ships(line: &ReadyLine) -> Path {
    let columns = line.body.answer.columns();
    let mut hand = line.hand.as_ref().clone();
    along(&mut hand, |hand| {
        let axis = hand.line().axes[0];
        twin::sum(columns, hand.state().loads_n(), axis.map(|c| c * hand.whole_m()))
    })
}

fn through(twin: &mut Twin, mean: Option<&Mean>) -> Path {
    let mut hand = twin.hand.clone();
    along(&mut hand, |hand| {
        let field = twin.field_of(hand);
        match mean {
            Some(mean) => mean.of(|cell| field[cell as usize]),
            None => field,
        }
    })
}

/// Moves in, and half the way out.
fn along(hand: &mut HandLine, field: impl Fn(&HandLine) -> Field) -> Path {
    hand.reset();
    hand.set_forces(&default_forces());
    let step_m = CASE.speed_m_per_s * TICK_S;
    let (before, inwards) = ((1e-3 / step_m) as i64, (CASE.depth_m / step_m) as i64);
    let places = (-before..=inwards).chain((inwards / 2..inwards).rev());
    let mut path = Path {
        fields: Vec::new(),
        tip_n: Vec::new(),
        hand_n: Vec::new(),
    };
    for (tick, place) in places.enumerate() {
        let answer = hand.step(place as f64 * step_m, TICK_S);
        if tick % COMPARED == 0 && place > 0 {
            path.fields.push(field(hand));
            path.tip_n.push(answer.tip_n);
            path.hand_n.push(-answer.force_on_hand_n);
        }
    }
    path
}

fn cause(cause: &'static str, between: String, of: &Path, reference: &Path) -> Cause {
    let field: Vec<f64> = of
        .fields
        .iter()
        .zip(&reference.fields)
        .filter_map(|(a, b)| distance_percent(a, b))
        .collect();
    let force = |a: &[f64], b: &[f64]| {
        let peak_n = b.iter().map(|n| n.abs()).fold(0.0, f64::max);
        let off: Vec<f64> = a.iter().zip(b).map(|(a, b)| 100.0 * (a - b).abs() / peak_n).collect();
        (rms(&off), quantile(&off, 1.0))
    };
    let (tip_percent, tip_worst_percent) = force(&of.tip_n, &reference.tip_n);
    let (hand_percent, hand_worst_percent) = force(&of.hand_n, &reference.hand_n);
    Cause {
        cause,
        between,
        field_percent: field.iter().sum::<f64>() / field.len() as f64,
        field_worst_percent: quantile(&field, 1.0),
        tip_percent,
        tip_worst_percent,
        hand_percent,
        hand_worst_percent,
    }
}

/// Returns the RMS over the elements that the reference moves, of its largest displacement; nothing to compare below
/// half a millimetre.
fn distance_percent(field: &Field, reference: &Field) -> Option<f64> {
    let largest_m = largest_m(reference);
    let mut spread = Spread::default();
    spread.add_field(reference, |e| field[e], largest_m);
    (largest_m >= 0.5e-3).then(|| 100.0 * spread.rms_m() / largest_m)
}

/// Returns the same cells, each divided into eight.
fn finer(lattice: &Lattice) -> Scene {
    let dims = lattice.dims.map(|n| 2 * n);
    let inside = |[i, j, k]: [usize; 3]| lattice.element_of_cell(i / 2, j / 2, k / 2).is_some();
    let labels = Labels {
        dims,
        spacing_m: 0.5 * lattice.spacing_m,
        cells: cells(dims).map(|cell| u8::from(inside(cell))).collect(),
        structures: Vec::new(),
    };
    Scene::from_labels("gland, half the spacing", &labels).expect("as valid as the first")
}

/// Returns the gland in fat, which ends on something fixed.
fn in_fat(lattice: &Arc<Lattice>, young_pa: f64) -> Scene {
    let mut gland = Structure::soft("gland", 1);
    gland.role = Role::Target;
    let mut fat = Structure::soft("fat", 2);
    fat.role = Role::Tissue;
    fat.material.young_pa = young_pa;
    for structure in [&mut gland, &mut fat] {
        structure.material.surroundings = Surroundings::all(Beyond::Fixed);
    }
    let labels = Labels {
        dims: lattice.dims,
        spacing_m: lattice.spacing_m,
        cells: near(lattice, FAT_M),
        structures: vec![gland, fat],
    };
    Scene::from_labels("gland in fat", &labels).expect("a gland in fat")
}

/// Labels tissue 1, and 2 where it is nearer than `reach_m` to its surface.
fn near(lattice: &Lattice, reach_m: f64) -> Vec<u8> {
    let [nx, ny, nz] = lattice.dims;
    let reach = reach_m / lattice.spacing_m;
    let far = reach.ceil() as i64;
    let mut labels = vec![0_u8; nx * ny * nz];
    let at = |[i, j, k]: [usize; 3]| i + nx * (j + ny * k);
    for element in 0..lattice.element_count() as u32 {
        let cell = lattice.cell(element);
        labels[at(cell)] = 1;
        if lattice.neighbours(element).iter().all(Option::is_some) {
            continue;
        }
        for z in -far..=far {
            for y in -far..=far {
                for x in -far..=far {
                    let place = [0, 1, 2].map(|a| usize::try_from(cell[a] as i64 + [x, y, z][a]).unwrap_or(usize::MAX));
                    let is_near = ((x * x + y * y + z * z) as f64) <= reach * reach;
                    if is_near && (0..3).all(|a| place[a] < lattice.dims[a]) && labels[at(place)] == 0 {
                        labels[at(place)] = 2;
                    }
                }
            }
        }
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_a_body_is_a_layer_of_even_thickness() {
        let cells = cells([30; 3])
            .map(|c| u8::from(c.iter().all(|n| (13..17).contains(n))))
            .collect();
        let labels = Labels {
            dims: [30; 3],
            spacing_m: 1e-3,
            cells,
            structures: Vec::new(),
        };
        let lattice = Scene::from_labels("cube", &labels).expect("valid").lattice;
        let near = near(&lattice, 5e-3);
        let along: Vec<u8> = (0..30).map(|i| near[i + 30 * (15 + 30 * 15)]).collect();
        assert_eq!(along.iter().filter(|&&l| l == 1).count(), 4);
        assert_eq!(along.iter().filter(|&&l| l == 2).count(), 10);
    }
}
