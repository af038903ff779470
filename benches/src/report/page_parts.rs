//! The page's parts about what ships, causes of error, and the textbook's passes.

use crate::budget::Cause;
use crate::findings::Findings;
use crate::passes::Passes;
use std::fmt::Write as _;

/// Largest error of a tick that is accepted: field, and force on the tip, in percent.
const FIELD_PERCENT: f64 = 1.0;
const TIP_PERCENT: f64 = 3.0;

pub fn what_ships(text: &mut String, found: &Findings) -> std::fmt::Result {
    text.push_str(
        "## What ships\n\nThe two loops as a run has them, a steady hand along z: in, rest, half the way out. Beside each fourth tick of the \
         tissue loop stands the converged solution of the same tick: every column of the same line solved to a residual of 1e-7 (1e-5 in \
         `pelvis`) on the body that `--tissue fem` has, behind the same law of contact, on the tip's path of that session. Field: RMS \
         distance over the elements that move, in percent of the tick's largest displacement; null models as above, in the same ticks. \
         Forces: in percent of the insertion's largest. ChainMail is compared where its elements are, in `pelvis` with the means over \
         the elements of the finite elements. *Own*: ChainMail beside itself with nothing left to do in any tick: columns of its own \
         coarser body to 1e-7, limits to 1e-4 elements in as many passes as that takes, on the same path from the same past. Finite \
         elements are their own.\n\n",
    );
    text.push_str("| scene | tissue | beside, mm | mm/s | elements | largest, mm | field, mean | p99 | worst | nothing moves | best shift | tip, p99 | worst | hand, p99 | worst | own field, mean | worst | own tip, worst | met | own met |\n");
    text.push_str("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for s in found.ships {
        writeln!(
            text,
            "| `{}` | {} | {:.0} | {:.0} | {} | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {} | {} |",
            s.scene,
            s.tissue,
            s.beside_mm,
            s.speed_mm_per_s,
            s.elements,
            s.largest_mm,
            s.field_percent,
            s.field_p99_percent,
            s.field_worst_percent,
            s.nothing_moves_percent,
            s.best_shift_percent,
            s.tip_p99_percent,
            s.tip_worst_percent,
            s.hand_p99_percent,
            s.hand_worst_percent,
            s.own_field_percent,
            s.own_field_worst_percent,
            s.own_tip_worst_percent,
            met(s.field_worst_percent, s.tip_worst_percent),
            met(s.own_field_worst_percent, s.own_tip_worst_percent)
        )?;
    }
    writeln!(
        text,
        "\nMet: field within {FIELD_PERCENT} % and force on the tip within {TIP_PERCENT} % in every tick. Times of a tick on one thread, least of the \
         rounds; the tissue's with the force tick before it:\n"
    )?;
    text.push_str("| scene | tissue | mm/s | force tick p50, us | p99.9 | tissue tick p50, us | p99 | p99.9 | line ready, s | stations | columns, MB |\n");
    text.push_str("|---|---|---|---|---|---|---|---|---|---|---|\n");
    for s in found.ships {
        writeln!(
            text,
            "| `{}` | {} | {:.0} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} | {:.1} | {} | {:.1} |",
            s.scene,
            s.tissue,
            s.speed_mm_per_s,
            s.haptic_p50_us,
            s.haptic_p999_us,
            s.tissue_p50_us,
            s.tissue_p99_us,
            s.tissue_p999_us,
            s.prepared_s,
            s.stations,
            s.columns_mb
        )?;
    }
    text.push('\n');
    Ok(())
}

fn met(field_percent: f64, tip_percent: f64) -> &'static str {
    if field_percent <= FIELD_PERCENT && tip_percent <= TIP_PERCENT {
        "yes"
    } else {
        "**no**"
    }
}

pub fn causes(text: &mut String, causes: &[Cause]) -> std::fmt::Result {
    text.push_str(
        "## Causes of error\n\nOne needle through the middle of `paper` to 45 mm and half the way out, on one path, through one body and \
         another that differ in one thing. Field: mean and worst of the ticks, in percent of the tick's largest displacement. Forces: \
         RMS and worst, in percent of the largest. Linearity is of a patch that is pushed, not of a line, and of CalculiX alone: its \
         worst is one node, and its force that of the patch.\n\n",
    );
    text.push_str("| cause | one; the other | field | worst | force on the tip | worst | force on the hand | worst |\n|---|---|---|---|---|---|---|---|\n");
    for c in causes {
        writeln!(
            text,
            "| {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
            c.name,
            c.between,
            c.field_percent[0],
            c.field_percent[1],
            c.tip_percent[0],
            c.tip_percent[1],
            c.hand_percent[0],
            c.hand_percent[1]
        )?;
    }
    text.push('\n');
    Ok(())
}

pub fn passes(text: &mut String, rows: &[Passes]) -> std::fmt::Result {
    text.push_str(
        "## One pass over everything\n\nAn element in the middle is pulled so far that every element moves. The plain queue \
         is the textbook's (`benches/src/solvers`); it leaves limits violated, ours goes on until none is violated by more than 1e-3 elements. Least of \
         interleaved rounds.\n\n",
    );
    text.push_str("| scene | elements | solver | passes | time, us | ns an element and pass | violation left, elements |\n|---|---|---|---|---|---|---|\n");
    for p in rows {
        writeln!(
            text,
            "| `{}` | {} | {} | {} | {:.0} | {:.1} | {:.0e} |",
            p.scene,
            p.elements,
            p.solver,
            p.passes,
            p.us,
            p.ns_an_element(),
            p.violation
        )?;
    }
    text.push('\n');
    Ok(())
}
