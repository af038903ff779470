//! Shipped models, through the real loops, against the converged solution of each tick.

use serde::Serialize;
use stylet_benches::error::quantile;
use stylet_benches::live::{Live, LiveCase, LiveTick, OwnTick, Theatre};
use stylet_sim::scene::TissueKind;

/// One insertion in one tissue.
#[derive(Clone, Debug, Serialize)]
pub struct Ships {
    pub scene: &'static str,
    pub tissue: &'static str,
    pub beside_mm: f64,
    pub speed_mm_per_s: f64,
    pub elements: usize,
    pub stations: usize,
    pub largest_mm: f64,
    /// Error over the largest displacement in each tick: mean, p99 and worst of the ticks' RMS, and the farthest
    /// element of all.
    pub field_percent: f64,
    pub field_p99_percent: f64,
    pub field_worst_percent: f64,
    pub farthest_mm: f64,
    pub nothing_moves_percent: f64,
    pub best_shift_percent: f64,
    /// Error over the largest force of the insertion: p99 and worst of the ticks.
    pub tip_p99_percent: f64,
    pub tip_worst_percent: f64,
    pub hand_p99_percent: f64,
    pub hand_worst_percent: f64,
    /// Errors against the model's own converged answer: as `field_*`, `tip_*`. Finite elements are their own.
    pub own_field_percent: f64,
    pub own_field_worst_percent: f64,
    pub own_tip_worst_percent: f64,
    pub haptic_p50_us: f64,
    pub haptic_p999_us: f64,
    pub tissue_p50_us: f64,
    pub tissue_p99_us: f64,
    pub tissue_p999_us: f64,
    pub prepared_s: f64,
    pub columns_mb: f64,
    /// Residual of the converged columns.
    pub twin_residual: f64,
}

/// Distance from the axis and depth, m; speed, m/s.
const fn case(scene: &'static str, [beside_m, depth_m, speed_m_per_s]: [f64; 3]) -> LiveCase {
    LiveCase {
        scene,
        beside_m,
        depth_m,
        speed_m_per_s,
    }
}

const CASES: [LiveCase; 4] = [
    case("paper", [0.0, 45e-3, 0.05]),
    case("paper", [10e-3, 40e-3, 0.05]),
    case("paper", [0.0, 45e-3, 0.28]),
    case("pelvis", [0.0, 90e-3, 0.05]),
];
/// Residual over load of the converged columns; what ships has 4.5e-2.
const CONVERGED: f64 = 1e-7;
/// The same of a body that is solved in f32.
const CONVERGED_SINGLE: f64 = 1e-5;

/// Returns every case, FEM first: its line says where the twin's stations are.
pub fn measure(rounds: usize) -> Vec<Ships> {
    let mut rows = Vec::new();
    for case in CASES {
        eprintln!(
            "as it ships: {}, {:.0} mm beside, {:.0} mm/s ...",
            case.scene,
            case.beside_m * 1e3,
            case.speed_m_per_s * 1e3
        );
        let theatre = Theatre::new(case);
        let fem = theatre.line(TissueKind::Fem);
        let mut twin = theatre.twin(&fem.0.hand, [CONVERGED, CONVERGED_SINGLE]);
        let chainmail = theatre.line(TissueKind::ChainMail);
        for (kind, (line, prepared_s)) in [(TissueKind::Fem, fem), (TissueKind::ChainMail, chainmail)] {
            let mut twins = theatre.twins(kind, &mut twin, &line.hand, CONVERGED);
            let live = theatre.run(kind, &line, &mut twins, rounds);
            let left_mm = twins.near_tip.left_m * 1e3;
            let row = row(case, kind, &live, prepared_s, twin.residual);
            eprintln!(
                "  {}: field {:.2} % of {:.1} mm on average, {:.2} % at worst; near the tip within {left_mm:.4} mm of rest",
                row.tissue, row.field_percent, row.largest_mm, row.field_worst_percent
            );
            rows.push(row);
        }
    }
    rows
}

fn row(case: LiveCase, kind: TissueKind, live: &Live, prepared_s: f64, twin_residual: f64) -> Ships {
    let ticks = &live.ticks;
    let share = |of: &dyn Fn(&LiveTick) -> f64| ticks.iter().map(|t| 100.0 * of(t) / t.largest_m).collect::<Vec<_>>();
    let field = share(&|t| t.rms_m[0]);
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let force = |pairs: Vec<[f64; 2]>| -> Vec<f64> {
        let peak_n = pairs.iter().map(|pair| pair[1].abs()).fold(0.0, f64::max);
        pairs
            .iter()
            .map(|[n, of_n]| 100.0 * (n - of_n).abs() / peak_n)
            .collect()
    };
    let tip = force(ticks.iter().map(|t| t.tip_n).collect());
    let hand = force(ticks.iter().map(|t| t.hand_n).collect());
    let own: Vec<OwnTick> = ticks.iter().filter_map(|t| t.own).collect();
    let (own_field, own_tip) = if own.is_empty() {
        (field.clone(), tip.clone())
    } else {
        (
            own.iter().map(|t| 100.0 * t.rms_m / t.largest_m).collect(),
            force(own.iter().map(|t| t.tip_n).collect()),
        )
    };
    Ships {
        scene: case.scene,
        tissue: kind.name(),
        beside_mm: case.beside_m * 1e3,
        speed_mm_per_s: case.speed_m_per_s * 1e3,
        elements: live.elements,
        stations: live.stations,
        largest_mm: ticks.iter().map(|t| t.largest_m * 1e3).fold(0.0, f64::max),
        field_percent: mean(&field),
        field_p99_percent: quantile(&field, 0.99),
        field_worst_percent: quantile(&field, 1.0),
        farthest_mm: ticks.iter().map(|t| t.worst_m * 1e3).fold(0.0, f64::max),
        nothing_moves_percent: mean(&share(&|t| t.rms_m[1])),
        best_shift_percent: mean(&share(&|t| t.rms_m[2])),
        tip_p99_percent: quantile(&tip, 0.99),
        tip_worst_percent: quantile(&tip, 1.0),
        hand_p99_percent: quantile(&hand, 0.99),
        hand_worst_percent: quantile(&hand, 1.0),
        own_field_percent: mean(&own_field),
        own_field_worst_percent: quantile(&own_field, 1.0),
        own_tip_worst_percent: quantile(&own_tip, 1.0),
        haptic_p50_us: quantile(&live.haptic_us, 0.5),
        haptic_p999_us: quantile(&live.haptic_us, 0.999),
        tissue_p50_us: quantile(&live.tissue_us, 0.5),
        tissue_p99_us: quantile(&live.tissue_us, 0.99),
        tissue_p999_us: quantile(&live.tissue_us, 0.999),
        prepared_s,
        columns_mb: live.column_bytes as f64 * 1e-6,
        twin_residual,
    }
}
