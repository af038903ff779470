//! Plans received one after the other, with the seeds in the tissue at the time.

use super::*;
use bytemuck::Zeroable;
use stylet_shm_schema::PlannedSeed;

/// Creates needle `number` of three, at its own x, with two seeds.
fn plan(generation: u64, number: u32) -> PlanInForce {
    let mut plan = PlanInForce::zeroed();
    (plan.session_id, plan.generation, plan.seed_count) = (1, generation, 2);
    (plan.entry_m, plan.direction) = ([0.01 * f64::from(number), 0.0, 0.0], [0.0, 0.0, 1.0]);
    for (seed, z) in plan.seeds.iter_mut().zip([0.05, 0.04]) {
        *seed = PlannedSeed {
            position_m: [plan.entry_m[0], 0.0, z],
        };
    }
    plan.prescribed = Prescribed {
        needle: number,
        last_needle: 3,
        strength_u: 0.4,
        ..Prescribed::default()
    };
    plan
}

/// Returns a seed from the needle of that number, 2 mm too deep.
fn seed(number: u32, z: f64) -> SeedPose {
    let x = 0.01 * f64::from(number);
    SeedPose {
        position_m: [x, 0.0, z + 2e-3],
        axis: [0.0, 0.0, 1.0],
        dropped_at_m: [x, 0.0, z],
    }
}

impl ReceivedProcedure {
    fn hear(&mut self, plan: &PlanInForce, seeds: &[SeedPose]) {
        self.seeds = seeds.to_vec();
        self.take_plan(Some(plan), None);
    }
}

fn placed(heard: &ReceivedProcedure) -> Vec<(usize, Option<usize>)> {
    heard
        .planned(0.5)
        .iter()
        .map(|seed| (seed.needle, seed.placed))
        .collect()
}

#[test]
fn each_needle_has_the_seeds_that_came_after_its_plan() {
    let mut heard = ReceivedProcedure::default();
    let seeds = [seed(1, 0.05), seed(1, 0.04), seed(3, 0.05), seed(3, 0.04)];
    heard.hear(&plan(1, 1), &[]);
    heard.hear(&plan(1, 1), &seeds[..2]);
    assert!(!heard.is_whole(), "it is not the last needle");
    heard.hear(&plan(2, 3), &seeds[..2]);
    assert_eq!(placed(&heard), [(0, Some(0)), (0, Some(1)), (2, None), (2, None)]);
    heard.hear(&plan(2, 3), &seeds);
    assert!(heard.is_whole());
    assert_eq!(placed(&heard)[2..], [(2, Some(2)), (2, Some(3))]);
    let (pairs, lost, unplanned) = heard.pairs(0.5);
    assert!(lost.is_empty() && unplanned.is_empty() && pairs.iter().all(|p| (p.offset().along_m - 2e-3).abs() < 1e-12));
    assert!(
        pairs
            .iter()
            .all(|p| p.planned.strength_u == 0.4 && p.delivered.strength_u == 0.4)
    );
    // A third seed of a needle with two places has no plan.
    heard.hear(&plan(2, 3), &[&seeds[..], &[seed(3, 0.03)]].concat());
    assert_eq!(heard.pairs(0.5).2.len(), 1);
    // A needle that is planned again keeps its seeds; one by hand is separate.
    heard.hear(&plan(3, 3), &seeds[..3]);
    assert_eq!(placed(&heard)[2..], [(2, Some(2)), (2, None)]);
    let mut by_hand = plan(4, 0);
    by_hand.prescribed = Prescribed::default();
    heard.hear(&by_hand, &[seed(0, 0.04), seed(0, 0.05)]);
    assert_eq!(
        placed(&heard),
        [(0, Some(1)), (0, Some(0))],
        "by where they were dropped"
    );
    assert_eq!(heard.pairs(0.5).0[0].planned.strength_u, 0.5);
}

#[test]
fn a_reset_starts_a_new_implant() {
    let mut heard = ReceivedProcedure::default();
    let seeds = [seed(1, 0.05), seed(1, 0.04), seed(2, 0.05), seed(2, 0.04)];
    heard.hear(&plan(1, 1), &[]);
    heard.hear(&plan(2, 2), &seeds[..2]);
    heard.hear(&plan(2, 2), &seeds);
    // A reset removes all seeds; the plan of the first needle comes a moment later.
    heard.hear(&plan(2, 2), &[]);
    heard.hear(&plan(3, 1), &[]);
    assert_eq!(placed(&heard), [(0, None), (0, None)]);
    heard.hear(&plan(3, 1), &seeds[..1]);
    assert_eq!(placed(&heard), [(0, Some(0)), (0, None)]);
}

#[test]
fn a_late_host_attributes_seeds_on_its_needle() {
    let mut heard = ReceivedProcedure::default();
    let seeds = [seed(1, 0.05), seed(1, 0.04), seed(2, 0.05)];
    heard.hear(&plan(7, 2), &seeds);
    assert_eq!(heard.seeds_before(), 2);
    assert_eq!(placed(&heard), [(1, Some(2)), (1, None)]);
}

/// Guards against the debrief of a reopened window, whose time was that of the window.
#[test]
fn a_host_that_joins_later_says_so_until_the_next_procedure() {
    let heard = |seeds: &[SeedPose]| {
        let mut heard = ReceivedProcedure::default();
        heard.hear(&plan(1, 1), seeds);
        heard.begin(None);
        heard
    };
    assert!(!heard(&[]).trace().motion().is_from_middle);
    let mut late = heard(&[seed(1, 0.05)]);
    assert!(late.trace().motion().is_from_middle);
    late.begin_anew();
    late.begin(None);
    assert!(!late.trace().motion().is_from_middle);
}
