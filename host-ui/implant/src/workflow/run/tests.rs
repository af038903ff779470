//! Continuation of a run, from the state of the tissue.

use super::*;

/// Creates two needles with two seeds each, along z.
fn tasks() -> Vec<NeedleTask> {
    let needle = |x: f64| PlannedNeedle {
        entry_m: [x, 0.0, 0.0],
        direction: [0.0, 0.0, 1.0],
        seeds_m: vec![[x, 0.0, 0.05], [x, 0.0, 0.04]],
        prescribed: Default::default(),
    };
    [0.0, 0.01].map(needle).map(NeedleTask::as_planned).to_vec()
}

#[test]
fn placed_seeds_determine_the_continuation() {
    let tasks = tasks();
    let found = |dropped: &[[f64; 3]], tip_m| Placed::find(&tasks, dropped, tip_m, &[]);
    let none = found(&[], Some([0.0, 0.0, -0.01]));
    assert!(!none.is_partial());
    let first = [[0.0, 0.0, 0.0502]];
    assert_eq!(found(&first, None).next_needle(), 0);
    let three = [[0.0, 0.0, 0.05], [0.0, 0.0, 0.04], [0.01, 0.0, 0.05]];
    let rest = found(&three, Some([0.01, 0.0, 0.05]));
    assert_eq!((rest.is_partial(), rest.next_needle()), (true, 1));
    assert_eq!([0, 1].map(|n| rest.seeds_of(n)), [2, 1]);
    assert!(rest.is_begun(1) && !found(&three[..2], None).is_begun(1));
    // All seeds of the first, and it is still in the tissue.
    assert_eq!(found(&three[..2], Some([0.0, 0.0, 0.03])).next_needle(), 0);
    let all = [&three[..], &[[0.01, 0.0, 0.04]]].concat();
    let whole = found(&all, Some([0.0, 0.0, -0.01]));
    assert!(!whole.is_partial(), "nothing is left");
    assert_eq!((whole.has_begun(), whole.next_needle()), (true, 2));
    assert!(found(&all, Some([0.01, 0.0, 0.03])).is_partial(), "but to take it out");
    // A drop that left no seed is not repeated.
    let lost = Placed::find(&tasks, &three[1..], None, &[0]);
    assert_eq!((lost.next_needle(), lost.done.lost.as_slice()), (1, &[0][..]));
}
