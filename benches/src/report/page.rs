//! The page that says in words what was measured, and which model to pick for what.

use crate::findings::Findings;
use crate::models::Family;
use crate::page_parts::{causes, passes, what_ships};
use crate::table::{Point, Row, pareto};
use std::fmt::Write as _;
use stylet_benches::insertions::{GLAND, TICK_S};

/// The error that is asked for, in percent of the tip's travel.
const ASKED_PERCENT: f64 = 10.0;

pub fn write(found: &Findings) -> Result<String, std::fmt::Error> {
    let mut text = String::from("# Speed against error of the tissue models\n\n");
    writeln!(
        text,
        "The same needle insertions through every model, on the paper's gland cut at three spacings, in surroundings of the same\n\
         stiffness. Error: distance from the converged FEM (f64) on the same lattice, over the elements that it moves by more than 1 % of\n\
         the tip's travel, compared every fourth tick of {} ms. The tip patch is 7.5 mm wide at every spacing. Times are the least of\n\
         equal rounds, interleaved. Insertions: {} ({} fitted to). `speed-vs-error.csv` holds every row.\n",
        TICK_S * 1e3,
        GLAND.map(|i| i.name).join("; "),
        GLAND
            .iter()
            .filter(|i| i.fitted)
            .map(|i| i.name)
            .collect::<Vec<_>>()
            .join("; ")
    )?;
    text.push_str("![Time of a tick against error](speed-vs-error.svg)\n\n");
    choices(&mut text, found)?;
    what_ships(&mut text, found)?;
    causes(&mut text, found.causes)?;
    passes(&mut text, found.passes)?;
    all_points(&mut text, found.points)?;
    fit(&mut text, found)?;
    refinement(&mut text, found)?;
    text.push_str("## Machine\n\n");
    for (name, value) in found.machine {
        writeln!(text, "- {name}: {value}")?;
    }
    writeln!(text, "- whole report: {:.0} s", found.seconds)?;
    Ok(text)
}

/// Returns the points at the finest spacing.
fn finest(points: &[Point]) -> Vec<&Point> {
    let least = points.iter().map(|p| p.spacing_mm).fold(f64::INFINITY, f64::min);
    points.iter().filter(|p| p.spacing_mm == least).collect()
}

fn choices(text: &mut String, found: &Findings) -> std::fmt::Result {
    let here = finest(found.points);
    writeln!(
        text,
        "## Which to pick\n\nAt {:.2} mm, over the insertions held back. Without any model the error is {:.1} % where nothing moves, and {:.1} % \
         where the body is shifted as one piece by what fits each tick best:\n",
        here[0].spacing_mm, here[0].nothing_moves_percent, here[0].best_shift_percent
    )?;
    let of = |family: Family| here.iter().copied().filter(move |p| p.family == family);
    let best = |family: Family| of(family).min_by(|a, b| a.rms_percent.total_cmp(&b.rms_percent));
    let fastest_within = |family: Family, percent: f64| {
        of(family)
            .filter(|p| p.worst_rms_percent <= percent)
            .min_by(|a, b| a.mean_us.total_cmp(&b.mean_us))
    };
    if let Some(p) = of(Family::Sweeps).min_by(|a, b| a.mean_us.total_cmp(&b.mean_us)) {
        writeln!(
            text,
            "- **Feel of a membrane, many scenes at once, weak machines:** ChainMail, solved ({}): {:.0} us a tick, {:.1} % off. \
             Its limits hold in every tick, but it answers to a limit of strain, not to forces.",
            p.setting, p.mean_us, p.rms_percent
        )?;
    }
    match fastest_within(Family::Relaxed, ASKED_PERCENT).or(best(Family::Relaxed)) {
        Some(p) => writeln!(
            text,
            "- **{}:** ChainMail, relaxed, {}: {:.0} us a tick, {:.1} % off on average, {:.1} % in the worst \
             insertion ({} {ASKED_PERCENT} %).",
            match fastest_within(Family::Fem, 1.0) {
                Some(fem) if fem.mean_us <= p.mean_us =>
                    "For nothing but an even tick, as FEM within 1 % is faster on average",
                _ => "Where seeds end, at little cost",
            },
            p.setting,
            p.mean_us,
            p.rms_percent,
            p.worst_rms_percent,
            if p.worst_rms_percent <= ASKED_PERCENT {
                "within"
            } else {
                "more than"
            }
        )?,
        None => text.push_str("- ChainMail, relaxed, was not run.\n"),
    }
    if let Some(p) = fastest_within(Family::Fem, 1.0) {
        writeln!(
            text,
            "- **Forces and millimetres within 1 % of the converged solution on the same lattice:** FEM, f32, {}: {:.0} us a tick on average, p99 {:.0} us, {:.2} % off in the \
             worst insertion.",
            p.setting, p.mean_us, p.worst_p99_us, p.worst_rms_percent
        )?;
    }
    if let (Some(single), Some(double)) = (best(Family::Fem), best(Family::FemDouble)) {
        writeln!(
            text,
            "- **f64** is for reference: f32 at its tightest tolerance is {:.3} % off, f64 {:.4} %.",
            single.rms_percent, double.rms_percent
        )?;
    }
    for point in here.iter().filter(|p| p.rms_percent > p.best_shift_percent) {
        writeln!(
            text,
            "- {}, {}: {:.1} % off, more than the best shift as one piece.",
            point.family.name(),
            point.setting,
            point.rms_percent
        )?;
    }
    text.push('\n');
    if let (Some(relaxed), Some(fem)) = (
        fastest_within(Family::Relaxed, ASKED_PERCENT).or(best(Family::Relaxed)),
        fastest_within(Family::Fem, 1.0),
    ) {
        let tightest = best(Family::Fem).unwrap_or(fem);
        writeln!(
            text,
            "Relaxed ChainMail ({}) takes {:.2} times as long as FEM within 1 % ({}), {:.2} times as long as FEM at {}. \
             Springs are relaxed in every tick; FEM solves once for each patch of tissue that the tip holds, and adds up what it has in \
             between. The solution is in the times here, mostly in their p99; a live loop works it out ahead, in idle ticks \
             (`docs/adr/0008-two-tissue-models.md`). That is why a twentieth of its time cannot be had with an error like this one.\n",
            relaxed.setting,
            relaxed.mean_us / fem.mean_us,
            fem.setting,
            relaxed.mean_us / tightest.mean_us,
            tightest.setting
        )?;
    }
    Ok(())
}

fn all_points(text: &mut String, points: &[Point]) -> std::fmt::Result {
    text.push_str("## All of it, insertions held back\n\n");
    text.push_str("| spacing, mm | model | setting | mean, us | worst p99, us | RMS, % | nothing moves, % | best shift, % | worst RMS, % | worst max, % | seeds, mm | worst force on the tip, % | unmet ticks | on the front |\n");
    text.push_str("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for p in points {
        let same: Vec<&Point> = points.iter().filter(|q| q.spacing_mm == p.spacing_mm).collect();
        let front = pareto(&same).iter().any(|q| std::ptr::eq(*q, p));
        writeln!(
            text,
            "| {:.2} | {} | {} | {:.0} | {:.0} | {:.3} | {:.1} | {:.1} | {:.3} | {:.1} | {:.3} | {} | {} | {} |",
            p.spacing_mm,
            p.family.name(),
            p.setting,
            p.mean_us,
            p.worst_p99_us,
            p.rms_percent,
            p.nothing_moves_percent,
            p.best_shift_percent,
            p.worst_rms_percent,
            p.worst_max_percent,
            p.seed_rms_mm,
            p.worst_tip_force_percent.map_or("-".to_owned(), |f| format!("{f:.2}")),
            p.unconverged_ticks,
            if front { "yes" } else { "" }
        )?;
    }
    text.push('\n');
    Ok(())
}

fn fit(text: &mut String, found: &Findings) -> std::fmt::Result {
    let (l, r) = (&found.fitted.limits, &found.fitted.relaxed);
    writeln!(
        text,
        "## The fit\n\nMade at 1.5 mm. Limits: stretch {:.3} to {:.3}, shear {:.1} deg, recovery {:.3} s. Relaxation: shear stiffness {:.3} of axial, \
         surroundings {:.4} of axial.\n\nRMS error in % of the travel, fitted to and held back:\n",
        l.min_stretch, l.max_stretch, l.shear_deg, l.recovery_time_s, r.shear_to_axial, r.foundation_to_axial
    )?;
    text.push_str("| insertion | fitted to | solved, fitted limits | relaxed, 16 iterations |\n|---|---|---|---|\n");
    let at = |insertion: &str, family: Family, setting: &str| {
        let fit_spacing = |row: &&Row| (row.spacing_mm - 1.5).abs() < 0.01 && row.insertion == insertion;
        let row = found
            .rows
            .iter()
            .filter(fit_spacing)
            .find(|row| row.family == family && row.setting == setting);
        row.map_or(f64::NAN, |row| row.rms_percent)
    };
    for insertion in GLAND {
        writeln!(
            text,
            "| {} | {} | {:.1} | {:.1} |",
            insertion.name,
            if insertion.fitted { "yes" } else { "" },
            at(insertion.name, Family::Sweeps, "fitted limits"),
            at(insertion.name, Family::Relaxed, "16 iterations")
        )?;
    }
    text.push('\n');
    Ok(())
}

fn refinement(text: &mut String, found: &Findings) -> std::fmt::Result {
    text.push_str("## What the spacing costs\n\nConverged FEM at each spacing against the finest, at the seeds, at the end of the push:\n\n");
    text.push_str("| spacing, mm | RMS, mm | largest, mm |\n|---|---|---|\n");
    for (spacing_mm, rms, largest) in found.refinement {
        writeln!(text, "| {spacing_mm:.2} | {rms:.3} | {largest:.3} |")?;
    }
    text.push('\n');
    Ok(())
}
