//! Limits, and what is said of them.

use super::*;

#[test]
fn names_and_ids_are_unique() {
    for (i, a) in LIMITS.iter().enumerate() {
        assert!(
            LIMITS[i + 1..].iter().all(|b| b.name != a.name && b.id != a.id),
            "{}",
            a.name
        );
    }
}

#[test]
fn limits_scale_with_the_period_and_the_command_line_wins() {
    let given = ["wake_p50_us=7".to_owned()];
    let l = limits(500_000, &given).expect("all are known");
    assert_eq!((l["wake_p50_us"], l["wake_p99_us"]), (7.0, 100.0));
    assert_eq!((l["wake_max_us"], l["recording_p99_us"]), (500.0, 1.0));
}

#[test]
fn a_run_too_short_for_a_given_limit_is_refused() {
    let given = ["wake_p999_us=500", "tip_to_host_p99_us=9000", "wake_max_us=900"].map(str::to_owned);
    let check = |seconds: u64, given| check_duration(given, seconds * 1_000_000_000, 1_000_000);
    let why = check(4, &given).expect_err("two are too long").to_string();
    assert!(
        why.contains("wake_p999_us needs a run of 10 s") && why.contains("tip_to_host_p99_us"),
        "{why}"
    );
    assert!(!why.contains("--limit: wake_max_us"), "{why}");
    assert!(check(10, &given).is_ok() && check(1, &[]).is_ok());
}

#[test]
fn every_bad_limit_is_named() {
    let given = ["wake_p50=7", "wake_p99_us=-1", "faults", "wake_max_us=nan"].map(str::to_owned);
    let why = limits(1_000_000, &given).expect_err("all four are wrong").to_string();
    assert_eq!(why.lines().count(), 5);
    assert!(
        why.contains("\"wake_p50\"") && why.contains("wake_p99_us needs"),
        "{why}"
    );
}

#[test]
fn one_failure_fails_all_and_one_open_limit_leaves_it_open() {
    use Outcome::*;
    let of = |all: &[Outcome]| overall(all.iter().copied());
    assert_eq!(of(&[Pass, Pass]), Pass);
    assert_eq!(of(&[Pass, NotMeasurable]), NotMeasurable);
    assert_eq!(of(&[NotMeasurable, Undecided, Pass]), Undecided);
    assert_eq!(of(&[NotMeasurable, Fail, Undecided, Pass]), Fail);
    assert_eq!(of(&[]), NotMeasurable);
    assert_eq!(
        [Pass, Fail, NotMeasurable, Undecided].map(Outcome::exit_code),
        [0, 1, 2, 2]
    );
}

#[test]
fn percentile_without_ten_samples_beyond_is_not_reported() {
    let mut h = crate::sample::histogram();
    for ns in 1..=999_u64 {
        h.record(ns * 1_000).expect("in range");
    }
    let (none, why) = percentile(&h, 0.99, 0.999);
    assert!(none.is_none() && why.ends_with("needs 1000: a run of 1 s"), "{why}");
    h.record(1_000_000).expect("in range");
    assert!(percentile(&h, 0.99, 0.999).0.is_some());
    assert!(percentile(&h, MAX, 1.0).0.is_some_and(|us| (us - 1000.0).abs() < 1.0));
}
