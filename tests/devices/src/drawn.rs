//! Device faults drawn at random, one after another, while the needle presses into a membrane.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::fmt::Debug;
use stylet_shm_schema::Fault;
use stylet_sim::force::gate::GateParameters;

use crate::rig::{FakeDevice, Rig};

/// Fault of a fake device.
pub trait RandomFault: Copy + Debug {
    /// The fake.
    type Fake: FakeDevice;
    /// Draws one of the faults.
    fn draw(random: &mut ChaCha8Rng) -> Self;
    /// Begins the fault.
    fn begin(self, fake: &Self::Fake);
    /// Advances the fault while it lasts.
    fn advance(self, tick: usize, fake: &Self::Fake);
    /// Ends the fault.
    fn end(self, fake: &Self::Fake);
    /// Returns the names that the screen may show, and the most ticks until the motors are without
    /// force.
    fn bound(self) -> (Vec<Fault>, usize);
    /// Returns the ticks for which it lasts, at least until it is named.
    fn lasts(self) -> usize;
}

/// Draws a number below `count`.
pub fn below(random: &mut ChaCha8Rng, count: usize) -> usize {
    (random.next_u64() % count as u64) as usize
}

/// Longest delay for one kind of fault, in ticks: until the motors were without force, and until
/// the fault was named.
#[derive(Default)]
struct Worst {
    count: usize,
    force_ticks: usize,
    named_ticks: usize,
}

fn one<W: RandomFault>(rig: &mut Rig<W::Fake>, random: &mut ChaCha8Rng, number: usize) -> (W, usize, usize) {
    let wrong = W::draw(random);
    assert!(rig.press(), "{number}: before {wrong:?} the membrane resists");
    for _ in 0..below(random, 50) {
        rig.tick();
    }
    let limit_n = GateParameters::default().max_force_n * (1.0 + 1e-9);
    let before_n = rig.tick().motors_n;
    wrong.begin(&rig.fake);
    let (names, bound) = wrong.bound();
    let (mut last_force, mut named) = (0, None);
    for tick in 1..=wrong.lasts() {
        wrong.advance(tick, &rig.fake);
        let seen = rig.tick();
        assert!(
            seen.motors_n <= limit_n.min(before_n + 0.05),
            "{number} {wrong:?}: {} N in tick {tick}",
            seen.motors_n
        );
        if seen.motors_n > 0.0 {
            last_force = tick;
        }
        if seen.fault() != Fault::None && named.is_none() {
            assert!(
                names.contains(&seen.fault()),
                "{number} {wrong:?} is called {:?}",
                seen.fault()
            );
            named = Some(tick);
        }
    }
    assert!(
        last_force <= bound,
        "{number} {wrong:?}: force until tick {last_force}, allowed are {bound}"
    );
    let named = named.unwrap_or_else(|| panic!("{number} {wrong:?} is not named"));
    wrong.end(&rig.fake);
    (wrong, last_force, named)
}

/// Draws `count` of them; all `kinds` must come up.
pub fn campaign<W: RandomFault>(mut rig: Rig<W::Fake>, seed: u64, count: usize, kinds: usize) -> Rig<W::Fake> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut table = BTreeMap::<String, Worst>::new();
    for number in 0..count {
        let (wrong, force_ticks, named_ticks) = one::<W>(&mut rig, &mut random, number);
        let worst = table.entry(kind(wrong)).or_default();
        worst.count += 1;
        worst.force_ticks = worst.force_ticks.max(force_ticks);
        worst.named_ticks = worst.named_ticks.max(named_ticks);
    }
    println!(
        "{:12} {:>5} {:>22} {:>14}",
        "fault", "count", "ms until no force", "ms until named"
    );
    for (kind, worst) in &table {
        println!(
            "{kind:12} {:>5} {:>22} {:>14}",
            worst.count, worst.force_ticks, worst.named_ticks
        );
    }
    assert_eq!(table.len(), kinds, "every kind was drawn");
    rig
}

fn kind(wrong: impl Debug) -> String {
    let text = format!("{wrong:?}");
    text.split(['(', ' ']).next().unwrap_or_default().to_owned()
}
