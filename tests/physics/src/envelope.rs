//! Every hand of the envelope, every delay of the link, three places: checks for sustained oscillation.

mod coupled;
mod on_line;

use crate::rig::{Rig, hand_envelope};
use stylet_benches::session::Tick;
use stylet_hw::{Hand, LinkFaults};
use stylet_sim::needle::LayerKind;

/// Place where the needle is brought to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// Pressed 4 mm into the whole capsule.
    Contact,
    /// 45 mm deep in the gland, stuck.
    InTissue,
    /// Behind the skin and some fat, half way to piercing the capsule.
    AtMembrane,
}

const PLACES: [Place; 3] = [Place::Contact, Place::InTissue, Place::AtMembrane];

/// Outcome of one session.
struct Case {
    name: String,
    /// Oscillation of the tip in the first and the second of two seconds at rest.
    early_m: f64,
    late_m: f64,
    /// Largest excess of returned over received energy at any time, and the part explained by rounding.
    excess_j: f64,
    bound_j: f64,
    /// The same from the hand-over on, minus the energy stored in the springs then.
    after_j: f64,
}

/// An oscillation that the encoders can resolve.
const SINGING_M: f64 = 2.0 * STEP_M;
const STEP_M: f64 = 3e-5;

impl Case {
    fn sings(&self) -> bool {
        self.late_m > SINGING_M
    }

    /// Checks that it comes to rest, and returns no more energy to the hand than it received.
    fn assert_rests(&self) {
        assert!(
            !self.sings(),
            "{} sings: {} m, before {} m",
            self.name,
            self.late_m,
            self.early_m
        );
        assert!(self.late_m <= self.early_m + STEP_M, "{} grows", self.name);
        // Threshold of a real oscillation; an uncontrolled one is some hundred times larger.
        assert!(
            self.after_j < 10e-3,
            "{} gives {} J after the change",
            self.name,
            self.after_j
        );
        assert!(
            self.excess_j <= self.bound_j,
            "{} gives {} J",
            self.name,
            self.excess_j - self.bound_j
        );
    }
}

/// Brings the needle there under an attentive operator, hands over to `hand`, nudges it, and waits.
fn session(hand: Hand, late_ticks: usize, place: Place, controlled: bool) -> Case {
    let layers: &[_] = match place {
        Place::Contact | Place::InTissue => &[(0.0, LayerKind::Gland)],
        Place::AtMembrane => &[
            (0.0, LayerKind::Perineum),
            (0.03, LayerKind::Surroundings),
            (0.04, LayerKind::Gland),
        ],
    };
    let rest_m = match place {
        Place::Contact => 4e-3,
        Place::InTissue => 45e-3,
        Place::AtMembrane => 44e-3,
    };
    let faults = LinkFaults {
        late_ticks,
        ..LinkFaults::default()
    };
    let mut rig = Rig::new(Hand::steady(), faults, layers, 1e-3);
    if !controlled {
        rig = rig.uncontrolled();
    }
    rig.go_to(rest_m, 0.05);
    let mut ticks = rig.run(2.0);
    let before = *ticks.last().expect("ticks");
    rig.device.device.set_hand(hand);
    // A nudge: 2 mm back and forth, faster than intended motion.
    rig.go_to(rest_m - 2e-3, 0.1);
    let mut after = rig.run(0.05);
    rig.go_to(rest_m, 0.1);
    after.extend(rig.run(0.95));
    let (early, late) = (rig.run(1.0), rig.run(1.0));
    let (early_m, late_m) = (to_and_fro(&early), to_and_fro(&late));
    after.extend(early);
    after.extend(late);
    let (given_j, hidden_j) = excess(&after, before.work_j);
    ticks.extend(after);
    let (excess_j, bound_j) = excess(&ticks, 0.0);
    Case {
        name: format!(
            "{place:?}, {} kg, {} N s/m, {} N/m, {late_ticks} late",
            hand.mass_kg, hand.damping_n_s_per_m, hand.stiffness_n_per_m
        ),
        early_m,
        late_m,
        excess_j,
        bound_j,
        after_j: given_j - hidden_j - 0.9 * before.output.terms.stored_j,
    }
}

/// Returns the widest swing of the tip about its mean path: slow creep is not an oscillation.
fn to_and_fro(ticks: &[Tick]) -> f64 {
    let window = |part: &[Tick]| {
        let (low, high) = part.iter().fold((f64::MAX, f64::MIN), |(low, high), t| {
            (low.min(t.true_tip_m), high.max(t.true_tip_m))
        });
        let (first, last) = (part[0].true_tip_m, part[part.len() - 1].true_tip_m);
        high - low - (last - first).abs()
    };
    ticks.chunks(250).map(window).fold(0.0, f64::max)
}

/// Returns the largest work done on the hand beyond `from_j` and beyond the rounding error at that time, which is half
/// a step of each encoder times the path of the force. Returns both.
fn excess(ticks: &[Tick], from_j: f64) -> (f64, f64) {
    let mut before = ticks[0].output.wrench.force_n;
    let (mut hidden_j, mut worst) = (0.5 * STEP_M * before.abs().sum(), (0.0, 0.0));
    for tick in ticks {
        let force_n = tick.output.wrench.force_n;
        hidden_j += 0.5 * STEP_M * (force_n - before).abs().sum();
        before = force_n;
        let given_j = tick.work_j - from_j;
        if given_j - hidden_j > worst.0 - worst.1 {
            worst = (given_j, hidden_j);
        }
    }
    worst
}

fn worst(cases: &[Case], of: fn(&Case) -> f64) -> (f64, &str) {
    let case = cases.iter().max_by(|a, b| of(a).total_cmp(&of(b))).expect("cases");
    (of(case), &case.name)
}

#[test]
fn no_hand_of_the_envelope_makes_the_loop_sing_at_any_lateness_anywhere() {
    for place in PLACES {
        let mut all = Vec::new();
        for late_ticks in 0..=3 {
            let cases: Vec<Case> = hand_envelope()
                .map(|hand| session(hand, late_ticks, place, true))
                .collect();
            let (after_j, _) = worst(&cases, |c| c.after_j);
            println!("{place:?}, {late_ticks} late: given {:.2} mJ", after_j * 1e3);
            all.extend(cases);
        }
        let (late_m, where_late) = worst(&all, |c| c.late_m);
        let (given_j, where_given) = worst(&all, |c| c.excess_j - c.bound_j);
        let (after_j, where_after) = worst(&all, |c| c.after_j);
        println!("{place:?}, {} sessions:", all.len());
        println!("  to and fro {:.3} mm ({where_late})", late_m * 1e3);
        println!(
            "  given beyond taken and rounding {:.3} mJ ({where_given})",
            given_j * 1e3
        );
        println!("  from the change of hands on {:.3} mJ ({where_after})", after_j * 1e3);
        all.iter().for_each(Case::assert_rests);
    }
}

/// Shows that the test above can fail: the same sessions without passivity control and softening.
#[test]
fn without_control_late_links_sing() {
    for place in [Place::InTissue, Place::AtMembrane] {
        let singing = [0, 1, 2, 3].map(|late_ticks| {
            let cases: Vec<Case> = hand_envelope()
                .map(|hand| session(hand, late_ticks, place, false))
                .collect();
            let (after_j, _) = worst(&cases, |c| c.after_j);
            println!(
                "{place:?}, {late_ticks} late, uncontrolled: given {:.0} mJ",
                after_j * 1e3
            );
            cases.iter().filter(|case| case.sings()).count()
        });
        println!("{place:?}, uncontrolled: of 27 hands sing, by lateness: {singing:?}");
        assert!(singing[3] > 0, "control has nothing to do at {place:?}");
    }
}
