//! One needle gone through ahead of time: what the operator would do, and where the seeds would rest.

use super::Needle;
use crate::workflow::Pace;
use std::time::{Duration, Instant};
use stylet_base::interrupt::Interrupt;
use stylet_host::link::{Link, LinkStatus};
use stylet_shm_schema::{NeedleRehearsal, Request};

const POLL_EVERY: Duration = Duration::from_millis(2);
/// The largest scene takes a second for a second.
const LONGEST: Duration = Duration::from_secs(300);

/// What is done with one needle; the plan says what for.
#[derive(Clone, Debug, PartialEq)]
pub struct Drops {
    pub entry_m: [f64; 3],
    pub direction: [f64; 3],
    /// How far from the entry the tip is when each seed leaves it, deepest first.
    pub along_m: Vec<f64>,
    pub retract_to_m: f64,
}

impl Drops {
    /// Each seed where it is planned, as if tissue did not move.
    pub fn as_planned(needle: &Needle) -> Self {
        Self {
            entry_m: needle.entry_m,
            direction: needle.direction,
            along_m: needle.seeds.iter().map(|s| s.along_m).collect(),
            retract_to_m: needle.retract_to_m,
        }
    }

    pub fn at_m(&self, along_m: f64) -> [f64; 3] {
        [0, 1, 2].map(|a| self.entry_m[a] + self.direction[a] * along_m)
    }

    pub fn drops_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.along_m.iter().map(|&along| self.at_m(along))
    }

    /// Has the core rehearse them.
    pub fn rehearsal(&self, pace: &Pace) -> NeedleRehearsal {
        NeedleRehearsal {
            entry_m: self.entry_m,
            direction: self.direction,
            insert_m_per_s: pace.insert_m_per_s,
            retract_m_per_s: pace.retract_m_per_s,
            approach_m_per_s: pace.approach_m_per_s,
            acceleration_m_per_s2: pace.acceleration_m_per_s2,
            retract_to_m: self.retract_to_m,
            drops_m: self.drops_m().collect(),
        }
    }
}

/// Where seeds come to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// In the order of the drops.
    pub seeds_m: Vec<[f64; 3]>,
    /// When each was dropped, after the tip's first contact with tissue.
    pub dropped_after_s: Vec<f64>,
    pub peak_force_n: f64,
    pub displacement_before_puncture_m: f64,
}

/// Whoever can go through a needle ahead of time.
pub trait Rehearser {
    /// Errors are for people.
    fn rehearse(&mut self, drops: &Drops, pace: &Pace) -> Result<Rest, String>;
}

/// The core that runs, under the parameters in force.
pub struct LinkRehearser<'a> {
    pub link: &'a mut Link,
    pub interrupted: &'a Interrupt,
}

impl Rehearser for LinkRehearser<'_> {
    fn rehearse(&mut self, drops: &Drops, pace: &Pace) -> Result<Rest, String> {
        let link = &mut *self.link;
        let generation = link.scene().map(|s| s.header.generation);
        let request = Request::Rehearse(drops.rehearsal(pace));
        let id = link.send(&request).map_err(|e| e.0)?;
        let begun = Instant::now();
        while begun.elapsed() < LONGEST {
            if self.interrupted.asked() {
                return Err("interrupted".to_owned());
            }
            link.poll();
            if let LinkStatus::Absent { why } = link.status() {
                return Err(why);
            }
            match link.reply(id) {
                Some(answer) if !answer.accepted => return Err(format!("the rehearsal failed: {}", answer.text)),
                Some(_) => {
                    let rehearsal = link.rehearsal(id).ok_or("the core sent no result of the rehearsal")?;
                    if Some(rehearsal.scene_generation) != generation
                        || rehearsal.seed_count as usize != drops.along_m.len()
                    {
                        return Err("another scene was loaded during the rehearsal; rehearse again".to_owned());
                    }
                    let count = rehearsal.seed_count as usize;
                    let after_ns = &rehearsal.dropped_after_ns[..count];
                    return Ok(Rest {
                        seeds_m: rehearsal.seeds[..count].iter().map(|s| s.position_m).collect(),
                        dropped_after_s: after_ns.iter().map(|&ns| ns as f64 * 1e-9).collect(),
                        peak_force_n: rehearsal.peak_force_n,
                        displacement_before_puncture_m: rehearsal.displacement_before_puncture_m,
                    });
                }
                None => std::thread::sleep(POLL_EVERY),
            }
        }
        Err(format!("the rehearsal was not done after {} s", LONGEST.as_secs()))
    }
}
