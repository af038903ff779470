//! result.json, force.csv and the table on the terminal.

use super::Observations;
use super::error::ProcedureError;
use super::gland::Largest;
use super::job::{Job, PlannedDrop, placed};
use crate::pairing::SeedOffset;
use crate::plan::compensate::edges::EDGE_REACH_M;
use crate::plan::compensate::summary_m;
use crate::workflow::{NeedleTask, Pace};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use stylet_base::{write_streamed, write_whole};
use stylet_host::link::Link;
use stylet_shm_schema::*;

pub fn write(
    out: &Path,
    link: &Link,
    job: &Job,
    pace: &Pace,
    seen: &Observations,
    failure: Option<&String>,
    made: Value,
) -> Result<(), ProcedureError> {
    std::fs::create_dir_all(out).map_err(|why| ProcedureError::Folder {
        folder: out.to_owned(),
        why,
    })?;
    let first = job
        .tasks
        .first()
        .ok_or(ProcedureError::NothingReceived("nothing was planned"))?;
    let direction = first.plan.direction;
    let seeds = seeds(link, &job.planned(), &seen.lost);
    let result = json!({
        "completed": failure.is_none(),
        "failure": failure,
        "made": made,
        "seeds": seeds, "lost_seeds": seen.lost.iter().map(|n| n + 1).collect::<Vec<_>>(),
        "force": force(link, direction, seen),
        "lag": link.state().map(|s| json!({ "worst_ms": s.worst_lag_ns as f64 / 1e6, "worst_mm": s.worst_lag_m * 1e3 })),
        "timing": timing(link, seen),
        "plan": {
            "entry_mm": mm(first.plan.entry_m), "direction": direction, "needles": needles(job, seen),
            "insert_speed_mm_s": pace.insert_m_per_s * 1e3, "retract_speed_mm_s": pace.retract_m_per_s * 1e3,
        },
        "compensation": compensation(job),
        "stabilising_needles": stabilising(job, seen),
        "largest_displacement_before_puncture_mm": seen.displacement_before_puncture_m * 1e3,
        "tissue_folded_from_mm": folded_from_mm(&seen.records),
        "parameters": parameters(link),
        "scene": link.scene().map(|s| json!({
            "name": s.header.name.read(), "elements": s.header.element_count, "spacing_mm": s.header.spacing_m * 1e3,
            "solved_in_elements_of_mm": s.header.body_spacing_m() * 1e3,
            "volume_cm3": s.header.volume_m3 * 1e6,
            "structures": s.header.structures().iter().map(|t| json!({
                "name": t.name.read(), "label": t.label, "elements": t.element_count,
                "volume_cm3": f64::from(t.element_count) * s.header.spacing_m.powi(3) * 1e6,
            })).collect::<Vec<_>>(),
        })),
        "session": link.session().map(session),
        "versions": { "host_ui": env!("CARGO_PKG_VERSION"), "schema": SCHEMA_VERSION },
    });
    let text = serde_json::to_string_pretty(&result)?;
    write_whole(&out.join("result.json"), (text + "\n").as_bytes())?;
    write_streamed(&out.join("force.csv"), |file| force_csv(file, direction, seen))?;
    table(&result);
    println!("written: {}", out.display());
    Ok(())
}

fn mm(v: [f64; 3]) -> [f64; 3] {
    v.map(|c| c * 1e3)
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (Vector3::from(a) - Vector3::from(b)).norm()
}

fn seeds(link: &Link, planned: &[PlannedDrop], lost: &[usize]) -> Vec<Value> {
    let (Some(snapshot), Some(scene)) = (link.snapshot(), link.scene()) else {
        return Vec::new();
    };
    let patient = scene.header.patient();
    let to_patient = |v| mm(patient.patient_from_scene(v));
    let in_tissue = &snapshot.header.seeds[..snapshot.header.seed_count as usize];
    let pairs: Vec<(&PlannedDrop, &SeedPose)> = placed(planned, lost, in_tissue).collect();
    let poses: Vec<SeedPose> = pairs.iter().map(|(_, seed)| **seed).collect();
    pairs
        .iter()
        .enumerate()
        .map(|(number, (drop, seed))| {
            let off = SeedOffset::of(drop.planned_m, seed.position_m, drop.direction);
            json!({
                "needle": drop.needle + 1, "hole": drop.hole.map(|h| h.to_string()), "strength_u": drop.strength_u,
                "axis": seed.axis, "planned_mm": mm(drop.planned_m), "dropped_at_mm": mm(seed.dropped_at_m), "placed_mm": mm(seed.position_m),
                "planned_ras_mm": to_patient(drop.planned_m), "dropped_at_ras_mm": to_patient(seed.dropped_at_m),
                "placed_ras_mm": to_patient(seed.position_m), "error_mm": off.distance_m() * 1e3,
                "error_along_mm": off.along_m * 1e3, "error_across_mm": off.across_m * 1e3,
                "touches_seeds": touching(&poses, number),
                "rehearsed_mm": drop.rehearsed_m.map(mm),
                "off_rehearsal_mm": drop.rehearsed_m.map(|m| distance_m(m, seed.position_m) * 1e3),
            })
        })
        .collect()
}

fn needles(job: &Job, seen: &Observations) -> Vec<Value> {
    let deflections_m = deflections_m(job, &seen.records);
    let of_task = |(number, (task, deflection_m)): (usize, (&NeedleTask, f64))| {
        let motion = seen.motion.of_needle(number);
        let tip_along_mm = |largest: &Largest| {
            let from_entry = Vector3::from(largest.tip_m) - Vector3::from(task.drops.entry_m);
            from_entry.dot(&Vector3::from(task.drops.direction)) * 1e3
        };
        json!({
            "target_motion_mm": motion.map(|m| m.target.size_m * 1e3),
            "target_motion_tip_along_mm": motion.map(|m| tip_along_mm(&m.target)),
            "largest_displacement_mm": motion.map(|m| m.tissue.size_m * 1e3),
            "largest_displacement_tip_along_mm": motion.map(|m| tip_along_mm(&m.tissue)),
            "entry_mm": mm(task.drops.entry_m), "direction": task.drops.direction,
            "planned_along_mm": task.plan.seeds_m.iter().map(|s| task.plan.along_m(*s) * 1e3).collect::<Vec<_>>(),
            "dropped_along_mm": task.drops.along_m.iter().map(|a| a * 1e3).collect::<Vec<_>>(),
            "deflection_mm": deflection_m * 1e3,
        })
    };
    job.tasks.iter().zip(deflections_m).enumerate().map(of_task).collect()
}

/// Returns the largest deflection of the tip of each needle from a rigid one. A tick counts for the
/// needle on whose line the hand is.
fn deflections_m(job: &Job, records: &[TickRecord]) -> Vec<f64> {
    let beside_m = |task: &NeedleTask, tip_m: [f64; 3]| {
        let from_entry = Vector3::from(tip_m) - Vector3::from(task.drops.entry_m);
        from_entry.cross(&Vector3::from(task.drops.direction)).norm()
    };
    let mut largest_m = vec![0.0_f64; job.tasks.len()];
    for record in records.iter().filter(|r| r.tip_deflection_m != [0.0; 3]) {
        let beside = job
            .tasks
            .iter()
            .map(|task| beside_m(task, record.tip_in_scene_m))
            .enumerate();
        if let Some((needle, _)) = beside.min_by(|a, b| a.1.total_cmp(&b.1)) {
            largest_m[needle] = largest_m[needle].max(Vector3::from(record.tip_deflection_m).norm());
        }
    }
    largest_m
}

/// Returns the requested stabilising needles, each with its tip when it stayed in; `null` if it did
/// not.
fn stabilising(job: &Job, seen: &Observations) -> Vec<Value> {
    let each = job.stabilising.iter().enumerate();
    each.map(|(number, of_plan)| {
        json!({
            "hole": of_plan.hole.to_string(), "entry_mm": mm(of_plan.needle.entry_m),
            "direction": of_plan.needle.direction, "depth_mm": of_plan.needle.depth_m * 1e3,
            "tip_mm": seen.left.get(number).map(|left| mm(left.tip_m)),
        })
    })
    .collect()
}

/// Returns the predictions of the rehearsals.
fn compensation(job: &Job) -> Option<Value> {
    let [[mean_before, worst_before], [mean_after, worst_after]] =
        summary_m(job.compensations.values()).map(|e| e.map(|m| m * 1e3));
    (!job.compensations.is_empty()).then(|| {
        json!({
            "mean_error_before_mm": mean_before, "mean_error_after_mm": mean_after,
            "worst_error_before_mm": worst_before, "worst_error_after_mm": worst_after,
            "rehearsals": job.compensations.values().map(|c| c.rehearsals).sum::<usize>(),
            "rehearsals_for_edges": job.compensations.values().map(|c| c.for_edges).sum::<usize>(),
            "sensitive_seeds": sensitive(job),
        })
    })
}

/// Returns the seeds that rest elsewhere if the tip stops a little deeper or shallower; `null` for
/// lost seeds.
fn sensitive(job: &Job) -> Vec<Value> {
    let each = job.compensations.iter();
    each.flat_map(|(needle, done)| done.sensitive.iter().map(move |found| (needle, found)))
        .map(|(needle, found)| {
            json!({
                "needle": needle + 1, "seed_of_needle": found.seed + 1, "moves_mm": found.moves_m.map(|m| m * 1e3),
                "beside_mm": EDGE_REACH_M * 1e3,
            })
        })
        .collect()
}

fn along(direction: [f64; 3], r: &TickRecord) -> f64 {
    Vector3::from(r.force_on_hand_n).dot(&Vector3::from(direction))
}

fn force(link: &Link, direction: [f64; 3], seen: &Observations) -> Value {
    let puncture = seen
        .events
        .iter()
        .find(|e| EventKind::from_number(e.kind) == Some(EventKind::Puncture));
    let puncture_force = puncture.map(|p| {
        let before = seen.records.iter().filter(|r| r.tick <= p.tick);
        before.map(|r| along(direction, r).abs()).fold(0.0, f64::max)
    });
    let state = link.state();
    json!({
        "peak_n": state.map(|s| s.peak_force_n),
        "puncture_n": puncture_force,
        "puncture_depth_mm": puncture.map(|p| p.value * 1e3),
        "device_limit_n": state.map(|s| s.device_limit_n),
        "scale": state.map(|s| s.force_scale),
        "gate_interventions": state.map(|s| s.gate_interventions),
    })
}

/// Returns the smallest displacement of the tissue at the tip at which its linear answer folded;
/// `None` if it never did.
fn folded_from_mm(records: &[TickRecord]) -> Option<f64> {
    let folded = records.iter().map(|r| r.folded_from_um).filter(|um| *um > 0);
    folded.min().map(|um| f64::from(um) * 1e-3)
}

fn timing(link: &Link, seen: &Observations) -> Value {
    let advice = link.session().map(|s| s.advice.read()).filter(|a| !a.is_empty());
    let span = match (seen.records.first(), seen.records.last()) {
        (Some(first), Some(last)) => last.tick.saturating_sub(first.tick) + 1,
        _ => 0,
    };
    let worst_wake_ns = seen.records.iter().map(|r| r.wake_latency_ns).max();
    let state = link.state();
    json!({
        "real_time": state.is_some_and(|s| s.flags & flags::REAL_TIME != 0),
        "not_real_time_because": advice,
        "ticks": state.map(|s| s.tick),
        "missed_deadlines": state.map(|s| s.missed_deadlines),
        "worst_wake_us": state.map(|s| s.worst_wake_ns as f64 / 1e3),
        "worst_wake_in_records_us": worst_wake_ns.map(|n| n as f64 / 1e3),
        "worst_work_us": state.map(|s| s.worst_work_ns as f64 / 1e3),
        "tissue_missed_deadlines": state.map(|s| s.tissue_missed_deadlines),
        "tissue_worst_wake_us": state.map(|s| s.tissue_worst_wake_ns as f64 / 1e3),
        "tissue_worst_work_us": state.map(|s| s.worst_tissue_work_ns as f64 / 1e3),
        "worst_residual_elements": state.map(|s| s.worst_residual),
        "records_received": seen.records.len(),
        "records_not_received": span.saturating_sub(seen.records.len() as u64),
        "records_lost_in_core": state.map(|s| s.records_lost),
        "invalid_dropped": link.invalid_dropped(),
    })
}

fn parameters(link: &Link) -> Value {
    let Some(p) = link.parameters() else { return Value::Null };
    PARAMETERS
        .iter()
        .zip(p.set.values)
        .map(|(spec, value)| json!({ "key": spec.key, "value": value * spec.display_per_si, "unit": spec.unit }))
        .collect()
}

fn session(s: &Session) -> Value {
    let thread = |t: &ThreadReport| {
        json!({
            "scheduler": if t.is_fifo() { "SCHED_FIFO" } else { "SCHED_OTHER" },
            "priority": t.priority, "asked_priority": t.asked_priority,
            "core": (t.core != u32::MAX).then_some(t.core), "asked_core": (t.asked_core != u32::MAX).then_some(t.asked_core),
        })
    };
    json!({
        "id": format!("{:016x}", s.session_id), "core_version": s.version.read(), "device": s.device.read(),
        "period_us": s.period_ns as f64 / 1e3, "tissue_period_us": s.tissue_period_ns as f64 / 1e3,
        "haptic_thread": thread(&s.haptic), "tissue_thread": thread(&s.tissue),
        "memory_locked": s.memory_locked == 1, "no_rt_asked": s.no_rt_asked == 1,
    })
}

fn force_csv(file: &mut impl Write, direction: [f64; 3], seen: &Observations) -> std::io::Result<()> {
    writeln!(
        file,
        "time_s,tick,past_membrane_mm,speed_mm_s,force_n,phase,tissue_tick"
    )?;
    let begin = seen.records.first().map_or(0, |r| r.due_ns);
    for r in &seen.records {
        writeln!(
            file,
            "{:.6},{},{:.4},{:.3},{:.5},{},{}",
            r.due_ns.saturating_sub(begin) as f64 / 1e9,
            r.tick,
            r.depth_m * 1e3,
            r.speed_m_per_s * 1e3,
            along(direction, r),
            Phase::from_number(r.phase).map_or("unknown", Phase::name),
            r.tissue_tick
        )?;
    }
    Ok(())
}

/// Returns that number of each entry that has it.
fn all<'a>(list: &'a Value, key: &'a str) -> impl Iterator<Item = f64> + 'a {
    list.as_array()
        .into_iter()
        .flatten()
        .filter_map(move |v| v[key].as_f64())
}

/// Describes how far needles moved the target, and names the one with the largest effect.
fn motion_line(needles: &Value) {
    let each = || needles.as_array().into_iter().flatten().enumerate();
    let most = |key: &str| {
        let all = each().filter_map(|(n, needle)| Some((n + 1, needle, needle[key].as_f64()?)));
        all.max_by(|a, b| a.2.total_cmp(&b.2))
    };
    let (Some(target), Some(tissue)) = (most("target_motion_mm"), most("largest_displacement_mm")) else {
        return;
    };
    let motions_mm: Vec<f64> = all(needles, "target_motion_mm").collect();
    let at_mm = |needle: &Value, key: &str| needle[key].as_f64().unwrap_or(f64::NAN);
    println!(
        "motion of the target: mean {:.1} mm, largest {:.1} mm (needle {}, tip {:.0} mm from its entry); of any tissue at most {:.1} mm (needle {}, tip {:.0} mm from its entry)",
        motions_mm.iter().sum::<f64>() / motions_mm.len() as f64,
        target.2,
        target.0,
        at_mm(target.1, "target_motion_tip_along_mm"),
        tissue.2,
        tissue.0,
        at_mm(tissue.1, "largest_displacement_tip_along_mm")
    );
}

fn table(result: &Value) {
    println!("seed  along the needle (mm)  across (mm)  total (mm)  touches seeds");
    for (index, seed) in result["seeds"].as_array().into_iter().flatten().enumerate() {
        let value = |key: &str| seed[key].as_f64().unwrap_or(f64::NAN);
        println!(
            "{:4}  {:21.3}  {:11.3}  {:10.3}  {:>13}",
            index + 1,
            value("error_along_mm"),
            value("error_across_mm"),
            value("error_mm"),
            seed["touches_seeds"].to_string().trim_matches(['[', ']'])
        );
    }
    motion_line(&result["plan"]["needles"]);
    let bent: Vec<f64> = all(&result["plan"]["needles"], "deflection_mm")
        .filter(|d| *d > 0.0)
        .collect();
    if !bent.is_empty() {
        println!(
            "deflection of the tip: {} needles, mean {:.2} mm, worst {:.2} mm",
            bent.len(),
            bent.iter().sum::<f64>() / bent.len() as f64,
            bent.iter().copied().fold(0.0, f64::max)
        );
    }
    if let Some(lag_mm) = result["lag"]["worst_mm"].as_f64().filter(|mm| *mm > 0.0) {
        let lag_ms = result["lag"]["worst_ms"].as_f64().unwrap_or(f64::NAN);
        println!("without a line the tissue was up to {lag_ms:.0} ms behind, the tip up to {lag_mm:.2} mm ahead");
    }
    print_distances("live against rehearsed", all(&result["seeds"], "off_rehearsal_mm"));
    print_distances("off plan", all(&result["seeds"], "error_mm"));
    let (force, timing) = (&result["force"], &result["timing"]);
    let number = |v: &Value| v.as_f64().map_or_else(|| "-".to_owned(), |n| format!("{n:.3}"));
    println!(
        "force: peak {} N, at puncture {} N, device limit {} N",
        number(&force["peak_n"]),
        number(&force["puncture_n"]),
        number(&force["device_limit_n"])
    );
    if let Some(mm) = result["tissue_folded_from_mm"].as_f64() {
        println!(
            "the linear tissue model folds at the tip from {mm:.1} mm of displacement: force and places are wrong there"
        );
    }
    println!(
        "timing: real time {}, {} deadlines missed, worst wake-up {} us; records received {}, not received {}",
        timing["real_time"],
        timing["missed_deadlines"],
        number(&timing["worst_wake_us"]),
        timing["records_received"],
        timing["records_not_received"]
    );
    if let Some(why) = timing["not_real_time_because"].as_str() {
        println!("{why}");
    }
}

fn print_distances(name: &str, mm: impl Iterator<Item = f64>) {
    let mm: Vec<f64> = mm.collect();
    if !mm.is_empty() {
        let (mean, worst) = (
            mm.iter().sum::<f64>() / mm.len() as f64,
            mm.iter().copied().fold(0.0, f64::max),
        );
        println!("{name}: {} seeds, mean {mean:.3} mm, worst {worst:.3} mm", mm.len());
    }
}
