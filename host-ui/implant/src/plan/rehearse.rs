//! Rehearsal of one needle: the operator's actions, and the predicted places of the seeds.

use super::{Needle, SEED_LENGTH_M};
use serde::{Deserialize, Serialize};
use stylet_base::interrupt::Interrupt;
use stylet_host::link::{Link, LinkError, LinkStatus};
use stylet_procedure::{NeedleWay, Pace};
use stylet_shm_schema::{
    MAX_EARLIER_NEEDLES, NeedleRehearsal, Reason, Refusal, RefusalCode, Request, StabilisingNeedle,
};
use web_time::{Duration, Instant};

const POLL_EVERY: Duration = Duration::from_millis(2);
/// Time limit of a rehearsal; the largest scene takes a second for a second.
const LONGEST: Duration = Duration::from_secs(300);

/// Actions with one needle; the plan gives their aims.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drops {
    /// Start of the tip, outside the body, scene frame, m.
    pub entry_m: [f64; 3],
    /// Unit vector into the body.
    pub direction: [f64; 3],
    /// Distance from the entry at which the needle leaves the middle of each seed, deepest first; its tip is half a
    /// seed deeper.
    pub along_m: Vec<f64>,
    /// Distance from the entry to which the tip is drawn back after the last drop, m.
    pub retract_to_m: f64,
    /// Distance from centre to centre of two seeds, m, if they are one strand.
    #[serde(default)]
    pub strand_pitch_m: Option<f64>,
}

impl Drops {
    /// Returns drops of each seed at its planned place, as if tissue did not move.
    pub fn as_planned(needle: &Needle) -> Self {
        Self {
            entry_m: needle.entry_m,
            direction: needle.direction,
            along_m: needle.seeds.iter().map(|s| s.along_m).collect(),
            retract_to_m: needle.retract_to_m,
            strand_pitch_m: needle.loading.pitch_m(),
        }
    }

    /// Returns the place at a distance from the entry, m.
    pub fn at_m(&self, along_m: f64) -> [f64; 3] {
        [0, 1, 2].map(|a| self.entry_m[a] + self.direction[a] * along_m)
    }

    /// Returns the places at which the needle leaves the middles of the seeds, m, in the order of the drops.
    pub fn drops_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.along_m.iter().map(|&along| self.at_m(along))
    }

    /// Returns the needle as one that comes and goes, to its deepest drop.
    pub fn pass(&self) -> StabilisingNeedle {
        StabilisingNeedle {
            entry_m: self.entry_m,
            direction: self.direction,
            depth_m: self.along_m.iter().copied().fold(0.0, f64::max) + 0.5 * SEED_LENGTH_M,
        }
    }

    /// Returns the path of the tip.
    pub fn way(&self) -> NeedleWay {
        NeedleWay {
            entry_m: self.entry_m.into(),
            direction: self.direction.into(),
            drops_m: self
                .along_m
                .iter()
                .map(|along_m| self.at_m(along_m + 0.5 * SEED_LENGTH_M).into())
                .collect(),
            retract_to_m: self.retract_to_m,
            strand_pitch_m: self.strand_pitch_m,
        }
    }

    /// Requests a rehearsal with needles that were inserted before and stay, after others that came
    /// and went.
    pub fn rehearsal(
        &self,
        pace: &Pace,
        stabilising: &[StabilisingNeedle],
        earlier: &[StabilisingNeedle],
    ) -> NeedleRehearsal {
        // Earlier needles matter only to those that stay in; the last ones matter most.
        let first = match stabilising {
            [] => earlier.len(),
            _ => earlier.len().saturating_sub(MAX_EARLIER_NEEDLES),
        };
        NeedleRehearsal {
            entry_m: self.entry_m,
            direction: self.direction,
            insert_m_per_s: pace.insert_m_per_s,
            retract_m_per_s: pace.retract_m_per_s,
            approach_m_per_s: pace.approach_m_per_s,
            acceleration_m_per_s2: pace.acceleration_m_per_s2,
            retract_to_m: self.retract_to_m,
            strand_pitch_m: self.strand_pitch_m,
            stabilising: stabilising.to_vec(),
            earlier: earlier[first..].to_vec(),
            as_points: false,
            drops_m: self.drops_m().collect(),
        }
    }
}

/// Result of a rehearsal.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Places of the seeds at rest, in the order of the drops.
    pub seeds_m: Vec<[f64; 3]>,
    /// Middle of each seed when the needle left it: the hand stops near its goal.
    pub dropped_at_m: Vec<[f64; 3]>,
    /// Time of each drop after the tip's first contact with tissue.
    pub dropped_after_s: Vec<f64>,
    /// Largest force on the hand, N.
    pub peak_force_n: f64,
    /// Largest displacement of tissue before the first puncture, m.
    pub displacement_before_puncture_m: f64,
}

/// Reason why a needle could not be rehearsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RehearsalError {
    /// The user cancelled it.
    #[error("interrupted")]
    Interrupted,
    /// There is no core, or the request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The core refused, or the rehearsal did not finish; the text says why.
    #[error("the rehearsal failed: {text}")]
    Refused {
        /// Reason, for display.
        text: String,
        /// Number of the refused drop, from 0, if there is one.
        drop: Option<usize>,
    },
    /// A reply came without its result.
    #[error("the core sent no result of the rehearsal")]
    NoResult,
    /// The scene changed during the rehearsal.
    #[error("another scene was loaded during the rehearsal; rehearse again")]
    OtherScene,
    /// It took too long.
    #[error("the rehearsal was not done after {} s", LONGEST.as_secs())]
    TooLong,
}

/// Simulator of a needle ahead of time.
pub trait Rehearser {
    /// Returns the predicted places of the seeds of these drops, which take no room if they are `as_points`.
    fn rehearse(&mut self, drops: &Drops, pace: &Pace, as_points: bool) -> Result<Rest, RehearsalError>;
}

/// Rehearser on the running core, with the parameters in force.
pub struct LinkRehearser<'a> {
    /// The link to the core.
    pub link: &'a mut Link,
    /// Flag that ends a rehearsal early.
    pub interrupted: &'a Interrupt,
    /// Needles that were inserted before and stay.
    pub stabilising: &'a [StabilisingNeedle],
    /// Needles that come and go with those in place, before this one.
    pub earlier: &'a [StabilisingNeedle],
}

impl Rehearser for LinkRehearser<'_> {
    fn rehearse(&mut self, drops: &Drops, pace: &Pace, as_points: bool) -> Result<Rest, RehearsalError> {
        let link = &mut *self.link;
        let scene = link.scene().map(|s| s.header.id());
        let request = Request::Rehearse(NeedleRehearsal {
            as_points,
            ..drops.rehearsal(pace, self.stabilising, self.earlier)
        });
        let id = link.send(&request)?;
        let begun = Instant::now();
        while begun.elapsed() < LONGEST {
            if self.interrupted.asked() {
                return Err(RehearsalError::Interrupted);
            }
            link.poll();
            if let LinkStatus::Absent { why } = link.status() {
                return Err(LinkError::Absent(why).into());
            }
            match link.reply(id) {
                Some(Err(Refusal { reasons, text })) => {
                    let drop = reasons.first().and_then(|reason| refused_drop(reason, drops));
                    return Err(RehearsalError::Refused { text, drop });
                }
                Some(Ok(_)) => {
                    let rehearsal = link.rehearsal(id).ok_or(RehearsalError::NoResult)?;
                    if Some(rehearsal.scene_id()) != scene || rehearsal.seed_count as usize != drops.along_m.len() {
                        return Err(RehearsalError::OtherScene);
                    }
                    let count = rehearsal.seed_count as usize;
                    let after_ns = &rehearsal.dropped_after_ns[..count];
                    return Ok(Rest {
                        seeds_m: rehearsal.seeds[..count].iter().map(|s| s.position_m).collect(),
                        dropped_at_m: rehearsal.seeds[..count].iter().map(|s| s.dropped_at_m).collect(),
                        dropped_after_s: after_ns.iter().map(|&ns| ns as f64 * 1e-9).collect(),
                        peak_force_n: rehearsal.peak_force_n,
                        displacement_before_puncture_m: rehearsal.displacement_before_puncture_m,
                    });
                }
                None => std::thread::sleep(POLL_EVERY),
            }
        }
        Err(RehearsalError::TooLong)
    }
}

/// Returns the drop to which a reason refers.
fn refused_drop(reason: &Reason, drops: &Drops) -> Option<usize> {
    let is_of_loop = reason.code() != Some(RefusalCode::RehearsalFailed);
    (is_of_loop && (reason.subject as usize) < drops.along_m.len()).then_some(reason.subject as usize)
}
