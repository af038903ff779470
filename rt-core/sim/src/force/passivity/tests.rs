//! A wall past its stable stiffness is the oracle: without the controller it must sing, with it not.

use super::*;

const DT_S: f64 = 1e-3;

/// Samples a wall of `stiffness` against a mass in a weak hand at 1 kHz, its force late by `late` ticks. Returns the
/// largest speed of the last second.
fn wall(stiffness: f64, late: usize, parameters: &PassivityParameters) -> f64 {
    let mut state = PassivityState::default();
    let (mut x, mut v, mut queue, mut fastest) = (0.0f64, 0.02f64, [0.0; DELAYS], 0.0f64);
    for tick in 0..5000 {
        let before = x;
        let applied = queue[late];
        for _ in 0..20 {
            let hand = 0.5 - 0.2 * v;
            v += 5e-5 * (applied + hand) / 0.175;
            x += 5e-5 * v;
        }
        let motion = Motion {
            moved_m: Vector3::x() * (x - before),
            velocity_m_per_s: Vector3::x() * v,
            position_step_m: 0.0,
            dt_s: DT_S,
        };
        let pressed = x.max(0.0);
        let wanted = Vector3::x() * (-stiffness * pressed);
        let asked = step(
            parameters,
            &mut state,
            &motion,
            0.5 * stiffness * pressed * pressed,
            &wanted,
        );
        state.book(&asked);
        queue.rotate_right(1);
        queue[0] = asked.x;
        if tick > 4000 {
            fastest = fastest.max(v.abs());
        }
    }
    fastest
}

#[test]
fn a_wall_beyond_its_stable_stiffness_is_quietened() {
    // b < K (T / 2 + delay): 0.2 against at least 0.4.
    for (stiffness, late) in [(800.0, 0), (4000.0, 0), (800.0, 1), (800.0, 3)] {
        let free = wall(stiffness, late, &PassivityParameters::OFF);
        let held = wall(stiffness, late, &PassivityParameters::default());
        println!("{stiffness} N/m, {late} late: {free:.4} m/s without, {held:.4} m/s with control");
        assert!(
            free > 0.05,
            "the wall of {stiffness} N/m, {late} late, should sing: {free}"
        );
        assert!(held < 0.2 * free, "{stiffness} N/m, {late} late: {held} against {free}");
    }
}

#[test]
fn a_passive_force_is_left_alone() {
    let parameters = PassivityParameters::default();
    let mut state = PassivityState::default();
    for i in 0..1000 {
        let velocity_m_per_s = Vector3::x() * (1e-2 * (0.01 * f64::from(i)).cos());
        let motion = Motion {
            moved_m: velocity_m_per_s * DT_S,
            velocity_m_per_s,
            position_step_m: 0.0,
            dt_s: DT_S,
        };
        let drag = -velocity_m_per_s * 5.0;
        assert_eq!(step(&parameters, &mut state, &motion, 0.0, &drag), drag);
        state.book(&drag);
        assert!(!state.in_debt());
    }
    assert!(state.energy_j() <= parameters.margin_j);
}

#[test]
fn credit_is_no_more_than_springs_hold_and_nonsense_books_nothing() {
    let parameters = PassivityParameters::default();
    let mut state = PassivityState::default();
    state.book(&(Vector3::x() * -5.0));
    let motion = |metres: f64| Motion {
        moved_m: Vector3::x() * metres,
        velocity_m_per_s: Vector3::x() * 0.1,
        position_step_m: 0.0,
        dt_s: DT_S,
    };
    step(&parameters, &mut state, &motion(0.1), 0.01, &Vector3::zeros());
    assert_eq!(state.accounts_j[0], 0.015, "half a joule was taken");
    step(&parameters, &mut state, &motion(f64::NAN), f64::NAN, &Vector3::zeros());
    assert_eq!(state.accounts_j[0], 0.015);
    step(&parameters, &mut state, &motion(0.0), 0.0, &Vector3::zeros());
    assert_eq!(state.accounts_j[0], parameters.margin_j, "the springs hold nothing");
}

#[test]
fn flicker_of_an_encoder_is_no_debt() {
    let parameters = PassivityParameters::default();
    let mut state = PassivityState::default();
    let (step_m, stiffness) = (3e-5, 6000.0);
    // What one step hides of the force at the very start and end is not in the sum: begin in credit.
    state.accounts_j = [1e-5; DELAYS];
    for tick in 0..10_000u32 {
        // The true position does not move.
        let at = |tick: u32| f64::from(tick.wrapping_mul(2_654_435_761) >> 31) * step_m;
        let motion = Motion {
            moved_m: Vector3::x() * (at(tick + 1) - at(tick)),
            velocity_m_per_s: Vector3::x() * 1e-3,
            position_step_m: step_m,
            dt_s: DT_S,
        };
        let wanted = Vector3::x() * (-stiffness * at(tick + 1));
        let asked = self::step(&parameters, &mut state, &motion, 0.0, &wanted);
        state.book(&asked);
        assert!(!state.in_debt(), "tick {tick}: {} J", state.energy_j());
    }
}
