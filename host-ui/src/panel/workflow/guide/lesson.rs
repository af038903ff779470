//! The texts of the guide for the next step.

use super::membranes::{MetMembranes, Puncture};
use crate::panel::workflow::progress::{Progress, needle_at_hand, progress};
use crate::shown::{NeedleLine, Outside, SeedError, Shown, own_errors};
use crate::words::counted;
use stylet_base::format;
use stylet_procedure::{AtHand, Operation};

/// Instruction, and observations during it.
#[derive(Debug, Default, PartialEq)]
pub struct Lesson {
    /// Instruction.
    pub what: String,
    /// Observations, during the step or after it.
    pub notes: Vec<String>,
}

/// Force below which zero is shown.
const LEAST_N: f64 = 5e-3;
/// Motion below which zero is shown, m.
const LEAST_M: f64 = 0.05e-3;
/// Number of seeds with a line of their own.
const SEEDS: usize = 6;

fn of(what: impl Into<String>, notes: &[&str]) -> Lesson {
    Lesson {
        what: what.into(),
        notes: notes.iter().map(|note| (*note).to_owned()).collect(),
    }
}

/// Returns the next lesson, by the state of the core.
pub fn lesson(shown: &Shown, membranes: &MetMembranes) -> Lesson {
    let lesson = next_lesson(shown, membranes);
    match &shown.watched {
        // A recording is described, not instructed.
        Some(_) if progress(shown) != Progress::Debrief => Lesson {
            what: format!(
                "This is a recording. During your own insertion you would read here: \u{201c}{}\u{201d}",
                lesson.what
            ),
            notes: lesson.notes,
        },
        _ => lesson,
    }
}

fn next_lesson(shown: &Shown, membranes: &MetMembranes) -> Lesson {
    if !shown.is_live() {
        let why =
            "The window shows what the core computes; it may be closed and opened again without the core noticing.";
        return of(
            "Start the simulator core: press \"Start it\" above the pictures, or run rt-core in a terminal.",
            &[why],
        );
    }
    if shown.running && shown.watched.is_none() {
        return of(
            "The script moves the needle now. Watch it, or press Stop to continue by hand.",
            &[],
        );
    }
    let next = needle_at_hand(shown).and_then(|needle| needle.next().map(|operation| (needle, operation)));
    match (progress(shown), next) {
        (Progress::Scene, _) => of(
            "Choose a scene: press \"paper\" in step 1. It is a gland without other organs.",
            &[],
        ),
        (Progress::Plan, _) if shown.planning.next_needle().is_some() => of(
            "Press \"First needle\" in step 2, or Enter. Enter always does what comes next.",
            &["Rings in the pictures show where the seeds should come to rest."],
        ),
        (Progress::Plan, _) if shown.planning.implant.is_some() => of(
            "Choose a hole in the template at the right, and press Enter there to add a needle.",
            &["\"Automatic plan\" in step 2 places all needles and seeds for you."],
        ),
        (Progress::Plan, _) => of(
            "Press \"Plan five seeds\" in step 2, or Enter. Enter always does what comes next.",
            &["Rings in the pictures show where the seeds should come to rest."],
        ),
        (Progress::Debrief, _) => debrief(shown, membranes),
        (_, Some((needle, operation))) => {
            let mut lesson = operation_lesson(shown, membranes, &needle, operation);
            let outside = shown.last_outside();
            lesson
                .notes
                .extend(outside.map(|place| format!("The last seed was {place}. Ctrl+Z undoes it.")));
            lesson
        }
        (_, None) => of("Press Enter for the next needle.", &[]),
    }
}

fn operation_lesson(shown: &Shown, membranes: &MetMembranes, needle: &AtHand, operation: Operation) -> Lesson {
    match operation {
        Operation::Place => place(shown),
        Operation::Insert | Operation::InsertTo(_) => insert(shown, membranes, needle),
        Operation::Drop(_) => of(
            "The tip is at the next planned place. Press Space: the seed leaves the needle here.",
            &["The tissue is still displaced by the needle."],
        ),
        Operation::DrawBack(_) => {
            let back_m = needle.next_drop_m.map_or(0.0, |next_m| needle.depth_m - next_m);
            of(
                format!(
                    "Draw the needle back by {} to the next place: hold S, or press Enter.",
                    format::length(back_m.max(0.0))
                ),
                &["Friction of the shaft pulls the tissue along, and the seed with it."],
            )
        }
        Operation::Retract | Operation::TakeOut => of(
            "All seeds are dropped. Take the needle out: hold S, or press Enter.",
            &["Watch the seeds as the tissue returns to its place."],
        ),
        Operation::Reset
        | Operation::PublishPlan
        | Operation::Engage
        | Operation::Leave
        | Operation::DrawOut
        | Operation::Settle => of("Wait until the tissue rests.", &[]),
    }
}

fn place(shown: &Shown) -> Lesson {
    if shown.is_free_inside {
        return of(
            "Take the needle out first: press Enter. With a device, draw it back by hand.",
            &["After a reset the needle meets no tissue until its tip has been outside the body."],
        );
    }
    if !shown.is_engaged() {
        return of(
            "Press E to turn the force on. Without it no force is rendered, and every force reads 0.",
            &["A device pushes back from now on. With keys or mouse, watch the force at the upper right."],
        );
    }
    of(
        "Bring the tip to the entry: press Enter. With a device, move its tip there by hand.",
        &["A line in the pictures leads from the entry past the deepest seed."],
    )
}

fn insert(shown: &Shown, membranes: &MetMembranes, needle: &AtHand) -> Lesson {
    if shown.needle_line() == Some(NeedleLine::Preparing) {
        let wait = shown.line_wait.words();
        let so_far = if wait.is_empty() {
            wait
        } else {
            format!(" Waited {wait}.")
        };
        return of(
            format!("Wait here until LINE READY appears in the bar at the top.{so_far}"),
            &[],
        );
    }
    if let Some(share) = shown.membrane_tension() {
        return Lesson {
            what: format!(
                "Push on: the membrane resists, and its tension is {:.0} %. At 100 % it gives way.",
                share * 100.0
            ),
            notes: vec![
                "The force rises, and the needle pushes the gland ahead: follow the outlines in the slices.".to_owned(),
            ],
        };
    }
    let left_m = needle
        .deepest_drop_m
        .map_or(0.0, |deepest_m| deepest_m - needle.depth_m);
    let left = format::length(left_m.max(0.0));
    match membranes.punctures().last().filter(|_| shown.has_punctured()) {
        Some(puncture) => Lesson {
            what: format!("The membrane gave way. Continue to the deepest seed, {left} ahead: hold W, or press Enter."),
            notes: vec![
                pressed(puncture),
                "What you feel now is friction along the shaft; it grows with the depth.".to_owned(),
            ],
        },
        None => of(
            format!(
                "Push the needle in, {left} to the deepest seed: hold W; with Shift it goes slower, S draws it back."
            ),
            &["You can also drag the tip in a slice, or push a device. Watch the membrane tension at the right."],
        ),
    }
}

fn pressed(puncture: &Puncture) -> String {
    let by = format::length(puncture.pressed_m);
    match puncture.force_n >= LEAST_N {
        true => format!(
            "The membrane was pressed in by {by} before it gave way, at {}.",
            format::force(puncture.force_n)
        ),
        false => format!("The membrane was pressed in by {by} before it gave way. The force was off."),
    }
}

/// Depths of one seed along the needle, m.
#[derive(Clone, Copy)]
struct Depths {
    number: usize,
    planned_m: f64,
    left_m: f64,
    rests_m: f64,
    across_m: f64,
    outside: Option<Outside>,
}

impl Depths {
    fn error_m(&self) -> f64 {
        (self.rests_m - self.planned_m).hypot(self.across_m)
    }

    /// Returns the largest part of the error, in words.
    fn reason(&self) -> String {
        let (by_hand_m, by_tissue_m) = (self.left_m - self.planned_m, self.rests_m - self.left_m);
        let is_inwards = |way_m: f64| way_m > 0.0;
        let parts = [by_hand_m.abs(), by_tissue_m.abs(), self.across_m];
        match parts
            .iter()
            .position(|part| *part >= parts.iter().copied().fold(0.0, f64::max))
        {
            Some(0) => {
                let way = if is_inwards(by_hand_m) { "deep" } else { "shallow" };
                format!("it was dropped {} too {way}", format::length(parts[0]))
            }
            Some(1) => {
                let way = if is_inwards(by_tissue_m) { "deeper" } else { "shallower" };
                format!("the tissue carried it {} {way}", format::length(parts[1]))
            }
            _ => format!("it lies {} off axis", format::length(self.across_m)),
        }
    }
}

/// Motion of the seeds of a needle along it.
struct Moved {
    mean_m: f64,
    /// Mean of the sizes.
    size_m: f64,
}

impl Moved {
    fn of(ways_m: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let count = ways_m.len() as f64;
        Self {
            mean_m: ways_m.clone().sum::<f64>() / count,
            size_m: ways_m.map(f64::abs).sum::<f64>() / count,
        }
    }
}

impl Moved {
    /// Says how far and which way, with a word for inwards and one for outwards.
    fn words(&self, inwards: &str, outwards: &str) -> String {
        let far = format::length(self.size_m);
        if self.size_m < LEAST_M {
            return format!("{far} off plan on average");
        }
        // Ways that go against each other would cancel out in a mean.
        if self.mean_m.abs() <= 0.9 * self.size_m {
            return format!("{far} on average, some {inwards} and some {outwards}");
        }
        let way = if self.mean_m > 0.0 { inwards } else { outwards };
        format!("{far} {way} on average")
    }
}

fn depths(shown: &Shown) -> Vec<Depths> {
    let needle = shown.planning.at_work().map_or(0, |(number, _)| number);
    let of_seed = |row: SeedError| {
        let seed = shown.own_seeds().get(row.placed?)?;
        let rests_m = shown.depth_of_m(seed.position_m)?;
        Some(Depths {
            number: row.planned + 1,
            planned_m: rests_m - row.along_m,
            left_m: shown.depth_of_m(seed.dropped_at_m)?,
            rests_m,
            across_m: row.across_m,
            outside: shown.outside(needle, &row),
        })
    };
    own_errors(shown).into_iter().filter_map(of_seed).collect()
}

/// Explains why the seeds missed, in figures of this insertion.
fn debrief(shown: &Shown, membranes: &MetMembranes) -> Lesson {
    let seeds = depths(shown);
    if seeds.is_empty() {
        return of(
            "The needle is out, and no seed was dropped. Press Reset to try again.",
            &[],
        );
    }
    let by_hand = Moved::of(seeds.iter().map(|seed| seed.left_m - seed.planned_m));
    let by_tissue = Moved::of(seeds.iter().map(|seed| seed.rests_m - seed.left_m));
    let mut notes: Vec<String> = membranes.punctures().iter().map(pressed).collect();
    notes.extend(seeds.iter().take(SEEDS).map(|seed| {
        format!(
            "Seed {}: planned {} deep, dropped at {}, came to rest at {}, {} off axis{}.",
            seed.number,
            format::length(seed.planned_m),
            format::length(seed.left_m),
            format::length(seed.rests_m),
            format::length(seed.across_m),
            seed.outside.map_or_else(String::new, |place| format!("; {place}"))
        )
    }));
    let is_of_tissue = by_tissue.size_m >= by_hand.size_m;
    let by_tissue = by_tissue.words("deeper", "shallower");
    let by_hand = by_hand.words("too deep", "too shallow");
    notes.push(match is_of_tissue {
        true => format!(
            "Most of the error comes from the tissue: as the needle left, it recoiled and carried the seeds {by_tissue}. \
             The hand dropped them {by_hand}."
        ),
        false => format!(
            "Most of the error comes from the hand: it dropped the seeds {by_hand}. The tissue carried them {by_tissue}."
        ),
    });
    notes.push(
        "In a plan of many needles, \"Compensate\" shifts the drops so that the seeds come to rest on plan.".to_owned(),
    );
    Lesson {
        what: headline(shown, membranes, &seeds),
        notes,
    }
}

/// Says how far the seeds rest from plan, which one is farthest and why, and what else went wrong.
fn headline(shown: &Shown, membranes: &MetMembranes, seeds: &[Depths]) -> String {
    let mean_m = seeds.iter().map(Depths::error_m).sum::<f64>() / seeds.len() as f64;
    let worst = seeds.iter().min_by(|a, b| b.error_m().total_cmp(&a.error_m()));
    let fault = membranes.fault().map_or_else(String::new, |fault| {
        format!("A fault turned the force off: {}. ", fault.message())
    });
    let missing = match own_errors(shown).iter().filter(|row| row.placed.is_none()).count() {
        0 => String::new(),
        count => format!(" {} missing.", counted(count, "planned seed")),
    };
    let worst = worst.map_or_else(String::new, |seed| {
        let far = format::length(seed.error_m());
        format!("; the worst is seed {}, {far} off: {}", seed.number, seed.reason())
    });
    let mean = format::length(mean_m);
    format!("{fault}The seeds rest {mean} from plan on average{worst}.{missing}")
}

#[cfg(test)]
mod tests {
    use super::Moved;

    #[test]
    fn motions_that_cancel_are_not_averaged_away() {
        let said = |ways_mm: [f64; 5]| Moved::of(ways_mm.iter().map(|mm| mm * 1e-3)).words("deeper", "shallower");
        assert_eq!(said([2.0, 4.0, 3.0, 3.0, 3.0]), "3.0 mm deeper on average");
        assert_eq!(said([-2.0, -4.0, -3.0, -3.0, -3.0]), "3.0 mm shallower on average");
        assert_eq!(
            said([-5.6, -3.2, -0.7, 1.7, 4.2]),
            "3.1 mm on average, some deeper and some shallower"
        );
    }
}
