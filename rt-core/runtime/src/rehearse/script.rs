//! What the operator does, step by step, in the rehearsal's own time; the same rules as the host's run.

use super::rig::Rig;
use super::{NeedleRun, RehearseError, TISSUE_REST_FOR, TISSUE_REST_LIMIT, TISSUE_REST_M};
use nalgebra::Vector3;
use std::collections::VecDeque;
use stylet_shm_schema::script::{arrived_after, move_limit};

#[derive(Clone, Copy, Debug)]
enum Action {
    Engage,
    Go { to_m: Vector3<f64>, speed_m_per_s: f64 },
    Drop { count: u32 },
    TissueRest,
}

pub struct Script {
    direction: Vector3<f64>,
    entry_m: Vector3<f64>,
    acceleration_m_per_s2: f64,
    actions: VecDeque<Action>,
    begun_s: f64,
    ordered: bool,
    since_s: Option<f64>,
}

impl Script {
    pub fn new(run: &NeedleRun) -> Self {
        let mut actions = VecDeque::from([
            Action::Engage,
            Action::Go {
                to_m: run.entry_m,
                speed_m_per_s: run.approach_m_per_s,
            },
        ]);
        for (index, &to_m) in run.drops_m.iter().enumerate() {
            let speed_m_per_s = if index == 0 {
                run.insert_m_per_s
            } else {
                run.retract_m_per_s
            };
            actions.push_back(Action::Go { to_m, speed_m_per_s });
            actions.push_back(Action::Drop {
                count: index as u32 + 1,
            });
        }
        actions.push_back(Action::Go {
            to_m: run.entry_m + run.direction * run.retract_to_m,
            speed_m_per_s: run.retract_m_per_s,
        });
        actions.push_back(Action::TissueRest);
        Self {
            direction: run.direction,
            entry_m: run.entry_m,
            acceleration_m_per_s2: run.acceleration_m_per_s2,
            actions,
            begun_s: 0.0,
            ordered: false,
            since_s: None,
        }
    }

    /// After each tick of the force; true when all is done.
    pub fn advance(&mut self, rig: &mut Rig) -> Result<bool, RehearseError> {
        if let Some(why) = rig.refusal() {
            let drop = rig.state().seed_count;
            return Err(RehearseError::Refused { why, drop });
        }
        let Some(&action) = self.actions.front() else {
            return Ok(true);
        };
        if !self.ordered {
            self.order(rig, action);
            return Ok(false);
        }
        if self.is_done(rig, action)? {
            self.actions.pop_front();
            (self.ordered, self.since_s, self.begun_s) = (false, None, rig.seconds());
        }
        Ok(self.actions.is_empty())
    }

    fn order(&mut self, rig: &mut Rig, action: Action) {
        match action {
            Action::Engage => rig.engage(),
            Action::Go { to_m, speed_m_per_s } => {
                rig.go(to_m, self.direction, speed_m_per_s, self.acceleration_m_per_s2)
            }
            Action::Drop { .. } => rig.drop_seed(),
            Action::TissueRest => {}
        }
        self.ordered = true;
    }

    fn is_done(&mut self, rig: &Rig, action: Action) -> Result<bool, String> {
        let now_s = rig.seconds();
        match action {
            Action::Engage => Ok(true),
            Action::Go { to_m, speed_m_per_s } => {
                let state = rig.state();
                let along = |p: Vector3<f64>| (p - self.entry_m).dot(&self.direction);
                let off_m = along(Vector3::from(state.tip_in_scene_m)) - along(to_m);
                let limit_s = move_limit(speed_m_per_s).as_secs_f64();
                if now_s - self.begun_s > limit_s {
                    return Err(format!(
                        "the tip did not arrive; it is {:.2} mm from its target",
                        off_m * 1e3
                    ));
                }
                let long = arrived_after(state, off_m);
                Ok(self.held_for(long.is_some(), long.map_or(0.0, |d| d.as_secs_f64()), now_s))
            }
            Action::Drop { count } => Ok(rig.state().seed_count >= count),
            Action::TissueRest => {
                let at_rest = rig.displacement_m() < TISSUE_REST_M;
                let waited = now_s - self.begun_s > TISSUE_REST_LIMIT.as_secs_f64();
                Ok(self.held_for(at_rest, TISSUE_REST_FOR.as_secs_f64(), now_s) || waited)
            }
        }
    }

    fn held_for(&mut self, holds: bool, long_s: f64, now_s: f64) -> bool {
        if !holds {
            self.since_s = None;
            return false;
        }
        now_s - *self.since_s.get_or_insert(now_s) >= long_s
    }
}
