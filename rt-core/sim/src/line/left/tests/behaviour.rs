//! Claims that hold for every needle, and the limit on their number.

use super::*;
use stylet_heap as heap;
use stylet_random::Random;

fn stored_j(line: &HandLine, left: &LeftNeedles) -> f64 {
    line.elastic_j() + left.elastic_j()
}

/// The hand's work in each tick, by the force after it, is at least what is stored more: from an energy `E` on, no
/// motion gets more than `E` out. Tissue is new after each round, for the membranes' sake.
#[test]
fn no_cycle_beside_a_left_needle_gains_energy() {
    let mut random = Random(1);
    let (mut worst_j, mut cycles, mut most_n) = (0.0_f64, 0, 0.0_f64);
    for _ in 0..60 {
        let (mut left, mut needle) = one_left(3e-3 + 9e-3 * random.unit(), WHOLE);
        let mut tip_m = -1e-3;
        left.step_beside(&mut needle, tip_m, DT_S);
        let mut spent_j = 0.0;
        let mut least_j = spent_j - stored_j(&needle, &left);
        for _ in 0..25 {
            for goal_m in [30e-3 * random.unit(), -1e-3 + 24e-3 * random.unit()] {
                while (goal_m - tip_m).abs() > 1e-9 {
                    let by_m = (goal_m - tip_m)
                        .clamp(-1.0, 1.0_f64)
                        .abs()
                        .min(1e-3 * random.unit() + 1e-6);
                    let by_m = by_m.copysign(goal_m - tip_m);
                    tip_m += by_m;
                    let output = left.step_beside(&mut needle, tip_m, DT_S);
                    spent_j -= output.force_on_hand_n * by_m;
                    // What was spent and is not stored is lost: that only grows.
                    let lost_j = spent_j - stored_j(&needle, &left);
                    worst_j = worst_j.max(least_j - lost_j);
                    least_j = least_j.max(lost_j);
                    most_n = most_n.max(output.force_on_hand_n.abs());
                }
            }
            cycles += 1;
        }
    }
    println!(
        "{cycles} cycles beside a needle that is left: {:.3} uJ beyond what was stored; up to {most_n:.1} N",
        worst_j * 1e6
    );
    assert!(most_n > 1.0);
    assert!(worst_j < 1e-6, "{worst_j} J");
}

#[test]
fn a_drawn_needle_leaves_tissue_at_rest_and_its_track() {
    let (mut left, mut second) = one_left(6e-3, WHOLE);
    go(&mut second, Some(&mut left), -1e-3, 20e-3, 1e-4);
    let beside_n = go(&mut second, Some(&mut left), 20e-3, 20e-3, 1e-4);
    assert!(left.draw_out(1, 0.05));
    assert!(!left.draw_out(7, 0.05));
    let mut ticks = 0;
    let out = loop {
        left.step_beside(&mut second, 20e-3, DT_S);
        ticks += 1;
        if let Some(out) = left.drawn_out() {
            break out;
        }
        assert!(ticks < 1000);
    };
    assert!(left.is_empty());
    assert!((300..600).contains(&ticks), "{ticks}");
    assert!(out.track().is_some());
    assert!(left.beside(Some(&second)));
    let alone_n = second.step(20e-3, DT_S).force_on_hand_n;
    assert!((alone_n - beside_n).abs() > 1e-3, "the drawn needle was felt");
    // Once it is out, the other continues as one that was never beside any.
    let deeper_n = go(&mut second, None, 20e-3, 26e-3, 1e-4);
    let twin_n = go(&mut line(3, [6e-3, 0.0, 0.0], &[], WHOLE), None, -1e-3, 26e-3, 1e-4);
    assert!((deeper_n - twin_n).abs() < 0.02 * twin_n.abs(), "{deeper_n} {twin_n}");
}

/// A later needle within the radius of a track meets it, on another line.
#[test]
fn a_track_is_met_within_the_radius_of_a_needle() {
    let mut first = line(1, [0.0; 3], &[], WHOLE);
    let first_n = go(&mut first, None, -1e-3, 20e-3, 1e-4);
    let track = first.track().expect("cut");
    let force_n = |beside_m: f64| {
        let mut again = line(2, [beside_m, 0.0, 0.0], &[], WHOLE);
        again.open_track(&track);
        go(&mut again, None, -1e-3, 15e-3, 1e-4)
    };
    let fresh_n = go(&mut line(2, [0.0; 3], &[], WHOLE), None, -1e-3, 15e-3, 1e-4);
    assert!(
        force_n(0.5e-3).abs() + 0.1 < fresh_n.abs(),
        "{} {fresh_n} {first_n}",
        force_n(0.5e-3)
    );
    assert_eq!(force_n(0.8e-3), fresh_n);
    assert!(line(3, [0.0; 3], &[], WHOLE).track().is_none());
    // A reset of the line keeps what earlier needles cut; new tissue does not.
    let mut again = line(4, [0.0; 3], &[], WHOLE);
    again.open_track(&track);
    again.reset();
    assert!(again.track().is_some());
    again.forget();
    assert!(again.track().is_none());
}

#[test]
fn as_many_as_there_is_room_for_move_together_without_the_heap() {
    let mut lines: Vec<Box<HandLine>> = Vec::new();
    let mut left = LeftNeedles::with_room();
    for n in 0..=MAX_LEFT {
        let others: Vec<&HandLine> = lines.iter().map(|line| &**line).collect();
        let angle = n as f64 * std::f64::consts::TAU / MAX_LEFT as f64;
        let at_m = if n == MAX_LEFT {
            [0.0; 3]
        } else {
            [8e-3 * angle.cos(), 8e-3 * angle.sin(), 0.0]
        };
        lines.push(line(n as u64 + 1, at_m, &others, WHOLE));
    }
    let mut last = lines.pop().expect("one more");
    for mut needle in lines {
        let known = left.beside(Some(&needle));
        assert!(known);
        go(&mut needle, Some(&mut left), -1e-3, 25e-3, 1e-4);
        left.leave(needle).expect("room");
    }
    assert_eq!(left.len(), MAX_LEFT);
    assert!(left.beside(Some(&last)));
    let mut record = LeftRecord::with_room();
    let before = heap::calls_of_this_thread();
    go(&mut last, Some(&mut left), -1e-3, 25e-3, 1e-4);
    record.copy_from(&left);
    let calls = heap::calls_of_this_thread() - before;
    assert_eq!(calls, 0);
    // From its record it continues with the same bits.
    let mut again = LeftNeedles::with_room();
    let named: Vec<u64> = record.line_numbers().collect();
    assert_eq!(named, [1, 2, 3, 4][..MAX_LEFT]);
    let blank = |generation: u64| {
        left.needles()
            .iter()
            .find(|n| n.generation() == generation)
            .map(|n| n.line.clone())
    };
    let mut twin = last.clone();
    assert!(again.take_record(&record, blank, Some(&twin)));
    let a_n = go(&mut last, Some(&mut left), 25e-3, 27e-3, 1e-4);
    let b_n = go(&mut twin, Some(&mut again), 25e-3, 27e-3, 1e-4);
    assert_eq!(a_n.to_bits(), b_n.to_bits());
    assert_eq!(left.forces_n(), again.forces_n());
    // No room for another.
    assert!(left.leave(last).is_err());
    let mut given_up = 0;
    while left.give_up().is_some() {
        given_up += 1;
    }
    assert_eq!(given_up, MAX_LEFT);
}

/// Time of a tick by how many needles are left, stations as in the paper's gland; the least of some rounds, each tick
/// by itself: `cargo test --profile quick -p stylet-sim --lib times_beside -- --ignored --nocapture`.
#[test]
#[ignore = "times"]
fn times_beside() {
    const ROUNDS: usize = 8;
    let mut lines: Vec<Box<HandLine>> = Vec::new();
    let mut left = LeftNeedles::with_room();
    println!("room for {MAX_LEFT}: {:.1} MB", left.bytes() as f64 / 1e6);
    for n in 0..=MAX_LEFT {
        let others: Vec<&HandLine> = lines.iter().map(|line| &**line).collect();
        let at_m = [6e-3 * (n % 3) as f64, 6e-3 * (n / 3) as f64, 0.0];
        lines.push(line(n as u64 + 1, at_m, &others, WHOLE));
    }
    for needle in lines {
        left.beside(Some(&needle));
        let mut ticks = [true, false].map(|_| vec![(f64::INFINITY, 0); 700]);
        let mut last = None;
        for round in 0..2 * ROUNDS {
            let (mut left, mut needle) = (left.clone(), needle.clone());
            let without = round % 2;
            if without == 1 {
                left.inverse.begin(0);
            }
            for (n, tick) in ticks[without].iter_mut().enumerate() {
                let tip_m = -1e-3 + 5e-5 * f64::from(if n < 620 { n as u32 } else { 1240 - n as u32 });
                let begun = std::time::Instant::now();
                let output = left.step_beside(&mut needle, tip_m, DT_S);
                let us = begun.elapsed().as_nanos() as f64 / 1e3;
                *tick = (us.min(tick.0), output.sweeps);
            }
            if without == 0 {
                last = Some((left, needle));
            }
        }
        println!("{} left, {} elements", left.len(), left.count);
        for (words, ticks) in ["with the inverse", "without"].iter().zip(&ticks) {
            let mut products: Vec<u32> = ticks.iter().map(|t| t.1).collect();
            let mut times_us: Vec<f64> = ticks.iter().map(|t| t.0).collect();
            times_us.sort_by(f64::total_cmp);
            products.sort_unstable();
            let at = |part: f64| (part * (times_us.len() - 1) as f64) as usize;
            println!(
                "    {words}: p50 {:.1}, p99 {:.1}, max {:.1} us; products p50 {}, p99 {}",
                times_us[at(0.5)],
                times_us[at(0.99)],
                times_us[at(1.0)],
                products[at(0.5)],
                products[at(0.99)]
            );
        }
        let (after, needle) = last.expect("rounds");
        left = after;
        if left.len() < MAX_LEFT {
            left.leave(needle).expect("room");
        }
    }
}
