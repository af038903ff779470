//! A score as JSON and as a page.

use super::{Score, ScoreError, page, updates};
use serde_json::{Value, json};
use std::path::Path;
use stylet_base::write_whole;

/// Returns every figure of a score; lengths in mm, patient frame (RAS) for places.
pub fn to_json(score: &Score) -> Value {
    let i = &score.implant;
    let frames = i.anatomy.patient;
    let ras_mm = |p: [f64; 3]| frames.patient_from_scene(p).map(|c| c * 1e3);
    let [mean, worst] = score.errors_m();
    let seed = |((pair, cost), touching): ((&super::SeedPair, &super::Cost), Vec<usize>)| {
        let off = pair.offset();
        json!({
            "needle": pair.needle + 1, "hole": pair.hole.map(|h| h.to_string()), "strength_u": pair.planned.strength_u,
            "planned_ras_mm": ras_mm(pair.planned.position_m), "delivered_ras_mm": ras_mm(pair.delivered.position_m),
            "axis_ras": pair.delivered.axis.map(|a| frames.patient_from_scene_direction(a)),
            "error_mm": off.distance_m() * 1e3, "error_along_mm": off.along_m * 1e3,
            "error_across_mm": off.across_m * 1e3, "touches_seeds": touching,
            "cost": {
                "target_d90_gy": cost.target_d90_gy, "target_v100_percent": cost.target_v100_percent,
                "urethra_d10_gy": cost.urethra_d10_gy, "urethra_d30_gy": cost.urethra_d30_gy,
            },
        })
    };
    let m = &score.implant.motion;
    json!({
        "title": i.title, "source": i.source, "prescription_gy": i.prescription_gy,
        "seeds_planned": i.pairs.len() + i.lost.len(), "seeds_lost": i.lost.len(), "seeds_unplanned": i.unplanned.len(),
        "mean_error_mm": mean * 1e3, "worst_error_mm": worst * 1e3,
        "planned": score.judge.to_json(&score.planned),
        "delivered": score.judge.to_json(&score.delivered),
        "cost_is": "gain if this seed alone lay on plan: D90 and V100 lost, dose to the urethra saved",
        "moments": i.moments.iter().map(|m| json!({ "at_s": score.at_s(m), "kind": m.kind.name(), "text": m.text })).collect::<Vec<_>>(),
        "updates": i.updates.iter().map(updates::to_json).collect::<Vec<_>>(),
        "seeds": i.pairs.iter().zip(&score.costs).zip(score.touching()).map(seed).collect::<Vec<_>>(),
        "motion": {
            "duration_s": m.duration_s, "in_tissue_s": m.in_tissue_s,
            "mean_insertion_mm_s": m.mean_insertion_m_per_s * 1e3, "peak_insertion_mm_s": m.peak_insertion_m_per_s * 1e3,
            "peak_force_n": m.peak_force_n, "largest_deflection_mm": m.deflection_m * 1e3, "insertions": m.insertions, "reinsertions": m.reinsertions,
            "ticks_seen": m.seen.seen, "ticks_not_seen": m.seen.unseen,
            "begins_with_the_procedure": !m.is_from_middle,
        },
    })
}

/// Returns the debrief as files, each with its name; `made` is their provenance.
pub fn files(score: &Score, made: Value) -> Result<[(&'static str, String); 2], ScoreError> {
    let mut value = to_json(score);
    value["made"] = made;
    let json = serde_json::to_string_pretty(&value)? + "\n";
    Ok([("score.json", json), ("debrief.html", page::page(score)?)])
}

/// Writes the debrief's files into an existing folder.
pub fn write(score: &Score, made: Value, folder: &Path) -> Result<(), ScoreError> {
    for (name, text) in files(score, made)? {
        write_whole(&folder.join(name), text.as_bytes())?;
    }
    Ok(())
}
