//! Updates of the plan during the procedure: contours and marks of the operator, and the predicted
//! dose.

use crate::intraoperative::Reviewed;
use crate::plan::optimise::Figures;
use maud::{Markup, html};
use serde_json::{Value, json};
use stylet_base::format;
use stylet_report::parts::{cell, numbers};

/// Returns the section; empty if the plan was not updated.
pub(super) fn section(updates: &[Reviewed]) -> Markup {
    html! {
        @if !updates.is_empty() {
            h2 { "Updates of the plan" }
            p {
                "The gland was contoured on the live picture and the remaining needles were replanned. Dice and distances \
                 compare the contour with the true gland at that moment; doses are those of the contoured gland."
            }
            @for (number, update) in updates.iter().enumerate() { (table(number + 1, update)) }
        }
    }
}

fn table(number: usize, update: &Reviewed) -> Markup {
    let columns = [
        &update.update.doses.now,
        &update.update.doses.continued,
        &update.update.updated,
    ];
    let value = |v: Option<f64>| cell(v.map_or_else(|| "not defined".to_owned(), |v| format::decimal(v, 1)));
    let row = |(name, of): (&str, Of)| [cell(name)].into_iter().chain(columns.map(|c| value(of(c)))).collect();
    let rows = MEASURES.map(row);
    html! {
        p {
            b { "Update " (number) ", " (if update.accepted { "accepted" } else { "not accepted" }) ": " }
            "after " (update.update.begun) " needles and " (update.lying) " seeds, " (update.seeds_from.name()) ". "
            (left(update)) " " (contour(update)) " " (marks(update))
        }
        (numbers(&["Measure", "placed so far", "plan if continued", "updated plan"], &rows))
    }
}

type Of = fn(&Figures) -> Option<f64>;

const MEASURES: [(&str, Of); 7] = [
    ("target D90 (% of the prescription)", |f| Some(f.d90)),
    ("target V100 (%)", |f| Some(f.v100)),
    ("target V150 (%)", |f| Some(f.v150)),
    ("target V200 (%)", |f| Some(f.v200)),
    ("urethra D10 (% of the prescription)", |f| f.urethra_d10),
    ("urethra D30 (% of the prescription)", |f| f.urethra_d30),
    ("rectum D2cc (% of the prescription)", |f| f.rectum_d2cc),
];

fn left(update: &Reviewed) -> String {
    let [[needles, seeds], [new_needles, new_seeds]] = update.left;
    format!("{needles} needles with {seeds} seeds remained, {new_needles} with {new_seeds} in the update.")
}

fn contour(update: &Reviewed) -> String {
    update.agreement.map_or_else(String::new, |a| {
        let [seen, truth] = a.volumes_m3.map(|m3| m3 * 1e6);
        format!(
            "Contour: Dice {:.3}, surfaces {:.2} mm apart on average and {:.1} mm at most, {seen:.1} cc of {truth:.1} cc.",
            a.dice,
            a.mean_m * 1e3,
            a.hausdorff_m * 1e3
        )
    })
}

fn marks(update: &Reviewed) -> String {
    let [marked, without_seed] = update.marked;
    if marked + without_seed == 0 {
        return "No seed was marked.".to_owned();
    }
    let off = update.residuals_m.map_or_else(String::new, |[mean, most]| {
        format!(", {:.1} mm off on average and {:.1} mm at most", mean * 1e3, most * 1e3)
    });
    format!("{marked} seeds were marked{off}; marks of no seed: {without_seed}.")
}

pub(super) fn to_json(update: &Reviewed) -> Value {
    let figures = |f: &Figures| {
        json!({
            "target_d90_percent": f.d90, "target_v100_percent": f.v100, "target_v150_percent": f.v150,
            "target_v200_percent": f.v200, "urethra_d10_percent": f.urethra_d10, "urethra_d30_percent": f.urethra_d30,
            "rectum_d2cc_percent": f.rectum_d2cc,
        })
    };
    let [before, after] = update
        .left
        .map(|[needles, seeds]| json!({ "needles": needles, "seeds": seeds }));
    json!({
        "needles_inserted": update.update.begun, "seeds_in_tissue": update.lying, "seeds": update.seeds_from.name(),
        "accepted": update.accepted, "left": before, "left_updated": after,
        "contour": update.agreement.map(|a| json!({
            "dice": a.dice, "mean_mm": a.mean_m * 1e3, "hausdorff_mm": a.hausdorff_m * 1e3,
            "volume_cc": a.volumes_m3[0] * 1e6, "true_volume_cc": a.volumes_m3[1] * 1e6,
        })),
        "marked": update.marked[0], "marks_without_seed": update.marked[1],
        "residual_mean_mm": update.residuals_m.map(|r| r[0] * 1e3), "residual_worst_mm": update.residuals_m.map(|r| r[1] * 1e3),
        "now": figures(&update.update.doses.now), "continued": figures(&update.update.doses.continued), "updated": figures(&update.update.updated),
    })
}
