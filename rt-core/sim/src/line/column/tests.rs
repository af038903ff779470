//! Seeds in a track against cases worked out by hand, and in a large random population.

use super::*;
use stylet_random::Random;

const L: f64 = SEED_LENGTH_M;
const HOLD: SeedHold = SeedHold {
    slides_m: 2e-3,
    cuts_m: 3e-3,
    track_m: 50e-3,
};

fn close(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (a, b) in found.iter().zip(wanted) {
        assert!((a - b).abs() < 1e-12, "{found:?} {wanted:?}");
    }
}

#[test]
fn a_seed_with_room_lies_where_it_is_left() {
    let mut ahead_m = [40e-3];
    assert_eq!(push(&mut ahead_m, 35e-3, &HOLD), 35e-3);
    assert_eq!(push(&mut [], 35e-3, &HOLD), 35e-3);
    assert_eq!(ahead_m, [40e-3]);
}

/// Up to the friction the tissue gives way and comes back: the new seed rests behind the other, which has not slid.
#[test]
fn a_seed_rests_behind_the_one_that_it_meets() {
    let mut ahead_m = [40e-3];
    assert_eq!(push(&mut ahead_m, 37e-3, &HOLD), 40e-3 - L);
    assert_eq!(ahead_m, [40e-3]);
}

#[test]
fn a_stylet_slides_seeds_where_the_tissue_does_not_give_enough() {
    // 4.5 mm too far, of which the tissue gives 2.
    let mut ahead_m = [40e-3];
    let front_m = push(&mut ahead_m, 40e-3, &HOLD);
    close(&ahead_m, &[42.5e-3]);
    close(&[front_m], &[42.5e-3 - L]);
    // At the end of the track the seed must cut: the tissue gives 5 mm.
    let mut ahead_m = [50e-3];
    push(&mut ahead_m, 50e-3, &HOLD);
    close(&ahead_m, &[50e-3]);
    push(&mut ahead_m, 51e-3, &HOLD);
    close(&ahead_m, &[50.5e-3]);
    // The first slides against a second, 1 mm on, which is at the end: together they give 2 + 3 / 2 mm.
    let mut ahead_m = [50e-3 - L - 1e-3, 50e-3];
    let front_m = push(&mut ahead_m, 45e-3, &HOLD);
    let slid_m = 45e-3 + L - (50e-3 - L - 1e-3) - 3.5e-3;
    close(&ahead_m, &[50e-3 - L - 1e-3 + slid_m, 50e-3 + slid_m - 1e-3]);
    close(&[front_m], &[ahead_m[0] - L]);
}

/// 10,000 needles with up to twelve seeds, left at random from the deepest on, in tissue of any hold.
#[test]
fn no_two_seeds_of_a_track_are_nearer_than_touching() {
    let mut random = Random(46);
    let mut touching = 0;
    for _ in 0..10_000 {
        let hold = SeedHold {
            slides_m: 5e-3 * random.unit(),
            cuts_m: 5e-3 * random.unit(),
            track_m: 80e-3,
        };
        // The nearest first.
        let mut fronts_m: Vec<f64> = Vec::new();
        let mut front_m = 80e-3;
        for _ in 0..1 + random.below(12) {
            let placed_m = push(&mut fronts_m, front_m, &hold);
            assert!(placed_m <= front_m);
            fronts_m.insert(0, placed_m);
            front_m -= 10e-3 * random.unit();
        }
        for pair in fronts_m.windows(2) {
            assert!(pair[1] - pair[0] >= L - 1e-8, "{fronts_m:?}");
            touching += u32::from(pair[1] - pair[0] < L + 1e-8);
        }
    }
    println!("{touching} touch");
    assert!(touching > 10_000);
}
