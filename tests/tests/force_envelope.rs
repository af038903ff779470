//! Every hand of the envelope, every lateness of the link, three places: does the loop sing?

use rt_core::needle::LayerKind;
use stylet_hw::{Hand, LinkFaults};
use stylet_tests::rig::{Rig, Tick, hand_envelope};

/// Where the needle is brought to rest.
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

/// What one session was.
struct Case {
    name: String,
    /// Largest speed in the first and the second half of the time at rest.
    early_m_per_s: f64,
    late_m_per_s: f64,
    /// Largest excess of energy given over energy taken at any time, and what quantisation explains of it.
    excess_j: f64,
    bound_j: f64,
}

/// Brings the needle there with an operator who sees to it, hands over to `hand`, gives it a nudge, and waits.
fn session(hand: Hand, faults: LinkFaults, place: Place, controlled: bool) -> Case {
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
    let mut rig = Rig::new(Hand::steady(), faults, layers, 1e-3);
    if !controlled {
        rig = rig.without_passivity_control();
    }
    rig.go_to(rest_m, 0.05);
    let mut ticks = rig.run(2.0);
    rig.device.device.set_hand(hand);
    // A nudge: 2 mm back and forth, quicker than a hand means to move.
    rig.go_to(rest_m - 2e-3, 0.1);
    ticks.extend(rig.run(0.05));
    rig.go_to(rest_m, 0.1);
    ticks.extend(rig.run(0.45));
    let early = rig.run(1.0);
    let late = rig.run(1.0);
    let fastest = |ticks: &[Tick]| ticks.iter().map(|t| t.true_speed_m_per_s).fold(0.0, f64::max);
    let (early_m_per_s, late_m_per_s) = (fastest(&early), fastest(&late));
    ticks.extend(early);
    ticks.extend(late);
    let (excess_j, bound_j) = energy(&ticks, 3e-5);
    Case {
        name: format!(
            "{place:?}, {} kg, {} N s/m, {} N/m, {} late",
            hand.mass_kg, hand.damping_n_s_per_m, hand.stiffness_n_per_m, faults.late_ticks
        ),
        early_m_per_s,
        late_m_per_s,
        excess_j,
        bound_j,
    }
}

/// Largest work done on the hand, net of what was taken, at any time; and half a step of each encoder times the way
/// that the force went, which is what rounding the position can hide.
fn energy(ticks: &[Tick], step_m: f64) -> (f64, f64) {
    let (mut excess_j, mut bound_j, mut before) = (0.0f64, 0.0, nalgebra::Vector3::zeros());
    let mut most_j = 0.0f64;
    for tick in ticks {
        let force = tick.output.wrench.force_n;
        bound_j += 0.5 * step_m * (force - before).abs().sum();
        before = force;
        if tick.work_j - bound_j > excess_j - most_j {
            (excess_j, most_j) = (tick.work_j, bound_j);
        }
    }
    (excess_j, most_j)
}

fn late(late_ticks: usize) -> LinkFaults {
    LinkFaults {
        late_ticks,
        ..LinkFaults::default()
    }
}

#[test]
fn no_hand_of_the_envelope_makes_the_loop_sing_at_any_lateness_anywhere() {
    let (mut cases, mut uncontrolled) = (Vec::new(), Vec::new());
    for hand in hand_envelope() {
        for late_ticks in 0..=3 {
            for place in PLACES {
                cases.push(session(hand, late(late_ticks), place, true));
                uncontrolled.push(session(hand, late(late_ticks), place, false));
            }
        }
    }
    let worst = |cases: &[Case], of: fn(&Case) -> f64| {
        let case = cases.iter().max_by(|a, b| of(a).total_cmp(&of(b))).expect("cases");
        format!("{:.3e} ({})", of(case), case.name)
    };
    let sings = |c: &&Case| c.late_m_per_s > SINGING_M_PER_S;
    println!("{} sessions", cases.len());
    println!("with control: late speed {} m/s", worst(&cases, |c| c.late_m_per_s));
    println!("  energy over bound {} J", worst(&cases, |c| c.excess_j - c.bound_j));
    println!("  energy given {} J", worst(&cases, |c| c.excess_j));
    println!("  {} sing", cases.iter().filter(sings).count());
    println!("without: late speed {} m/s", worst(&uncontrolled, |c| c.late_m_per_s));
    println!(
        "  energy over bound {} J",
        worst(&uncontrolled, |c| c.excess_j - c.bound_j)
    );
    println!("  {} sing", uncontrolled.iter().filter(sings).count());
    for case in cases.iter().filter(sings) {
        println!(
            "  sings: {} {:.2e} then {:.2e} m/s",
            case.name, case.early_m_per_s, case.late_m_per_s
        );
    }
    for place in PLACES {
        let n = |late: usize, cases: &[Case]| {
            let tail = format!("{late} late");
            cases
                .iter()
                .filter(sings)
                .filter(|c| c.name.starts_with(&format!("{place:?}")) && c.name.ends_with(&tail))
                .count()
        };
        println!(
            "  {place:?}: without control {:?} of 27 sing",
            [0, 1, 2, 3].map(|l| n(l, &uncontrolled))
        );
    }
}

/// Faster than this after 2 s at rest is an oscillation: an encoder step a tick at 1 kHz is 30 mm/s, one in thirty is 1.
const SINGING_M_PER_S: f64 = 3e-3;
