//! A core for successive trials, with the needle at a known place before each.

use crate::{Core, ask, until};
use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::{default_plan, move_request};
use stylet_random::Random;
use stylet_shm_schema::{Request, flags};

/// Distance from the goal, on each axis, within which the needle has arrived, m.
const NEAR_M: f64 = 2e-3;

/// A core with an observing host that takes the hand back between trials.
pub struct Stage {
    pub core: Core,
    pub observer: Link,
    pub random: Random,
    home: ([f64; 3], [f64; 3]),
}

impl Stage {
    /// Opens a core with the needle in the air.
    pub fn open() -> Self {
        let mut core = Core::start();
        let observer = core.host();
        let state = observer.state().expect("live");
        let home = (state.tip_in_scene_m, state.needle_direction);
        let random = Random(crate::now_ns());
        println!("seed of the moments: {:#x}", random.0);
        Self {
            core,
            observer,
            random,
            home,
        }
    }

    fn go(&mut self, to: [f64; 3], direction: [f64; 3]) {
        ask(&mut self.observer, &move_request(to, direction, 0.2, 2.0)).expect("moved");
        let is_there = until(Duration::from_secs(20), || {
            self.observer.poll();
            self.observer.take_records();
            // A state from before the request is at the goal of the motion before.
            self.observer.state().is_some_and(|s| {
                let away_m = (0..3)
                    .map(|axis| (s.tip_in_scene_m[axis] - to[axis]).abs())
                    .fold(0.0, f64::max);
                s.flags & flags::AT_GOAL != 0 && away_m < NEAR_M
            })
        });
        assert!(is_there, "the hand does not arrive: {:?}", self.observer.state());
    }

    /// Takes the needle back to its first place.
    pub fn draw_out(&mut self) {
        let (tip_m, direction) = self.home;
        self.go(tip_m, direction);
    }

    /// Plans a needle, turns the force on and takes the needle to the entry.
    pub fn go_to_entry(&mut self) {
        let plan = default_plan(&self.observer.scene().expect("live").header);
        ask(&mut self.observer, &Request::SetPlan(Some(plan.clone()))).expect("planned");
        ask(&mut self.observer, &Request::Engage).expect("engaged");
        self.go(plan.entry_m, plan.direction);
    }

    /// Ends the core, which must end in order.
    pub fn close(self) {
        drop(self.observer);
        self.core.finish();
    }
}
