//! Motions ordered by this host, which continue while it renews them.
//!
//! Renewal is tied to the host's own calls of `poll`, not to the receiving thread, which would outlive a hung host.

use super::Answer;
use stylet_shm_schema::{Event, EventKind, Request, VALID_RANGE_S};
use web_time::{Duration, Instant};

/// Number of polls over which the host's pauses are measured.
const POLLS: usize = 16;
/// Rank of the pause that a promise covers, the third longest: a host that is slow each time keeps its motion, and one
/// that is slow once brakes and resumes.
const FORESEEN: usize = 2;
/// Length of a promise in pauses, and number of renewals within it.
const PAUSES: f64 = 1.5;
const RENEWALS: u32 = 3;
/// Greatest depth of a needle, m.
const LONGEST_DRAW_M: f64 = 0.5;

/// One motion, from its request on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ordered {
    command_id: u64,
    /// First tick that knows it, from the reply.
    from_tick: Option<u64>,
    /// Time at which it has certainly ended, if no state shows its end.
    until: Option<Instant>,
}

/// Motions ordered by this host, by the numbers of [`EventKind::MotionGivenUp`]: the needle's hand, the second
/// device's, and needles being drawn out.
#[derive(Default)]
pub struct Motions {
    ordered: [Option<Ordered>; 3],
    polled: Option<Instant>,
    pauses: [Duration; POLLS],
    next_pause: usize,
    renewed: Option<Instant>,
}

impl Motions {
    /// Records a request that was sent. True if it begins a motion.
    pub fn sent(&mut self, request: &Request, command_id: u64, now: Instant) -> bool {
        let begun = Ordered {
            command_id,
            from_tick: None,
            until: None,
        };
        match request {
            Request::MoveHand(_) => self.ordered[0] = Some(begun),
            Request::MoveSecondHand(_) => self.ordered[1] = Some(begun),
            Request::DrawNeedle { speed_m_per_s, .. } => {
                let lasts = Duration::try_from_secs_f64(LONGEST_DRAW_M / speed_m_per_s).unwrap_or(Duration::MAX);
                let until = now.checked_add(lasts);
                self.ordered[2] = Some(Ordered { until, ..begun });
            }
            Request::StopHand => {
                self.ordered[..2].fill(None);
                return false;
            }
            Request::StopSecondHand => {
                self.ordered[1] = None;
                return false;
            }
            _ => return false,
        }
        true
    }

    /// Records the core's answer to a request.
    pub fn answered(&mut self, command_id: u64, answer: &Answer) {
        for ordered in &mut self.ordered {
            if let Some(motion) = ordered.as_mut().filter(|motion| motion.command_id == command_id) {
                match answer {
                    Ok(tick) => motion.from_tick = Some(*tick),
                    Err(_) => *ordered = None,
                }
            }
        }
    }

    /// Records an event: a motion that was given up does not continue.
    pub fn take(&mut self, event: &Event) {
        if EventKind::from_number(event.kind) == Some(EventKind::MotionGivenUp)
            && let Some(ordered) = self.ordered.get_mut(event.code as usize)
        {
            ordered.take_if(|motion| motion.from_tick.is_some_and(|tick| event.tick >= tick));
        }
    }

    /// Records the newest states of the needle and the second device: tick, and whether the hand is in motion.
    pub fn seen(&mut self, states: [Option<(u64, bool)>; 2]) {
        for (ordered, state) in self.ordered.iter_mut().zip(states) {
            let has_ended = |motion: &mut Ordered| {
                let knows = |tick: u64| motion.from_tick.is_some_and(|from| tick > from);
                state.is_some_and(|(tick, is_moving)| !is_moving && knows(tick))
            };
            ordered.take_if(has_ended);
        }
    }

    /// Returns the longest pause between the host's recent polls.
    pub fn longest_pause(&self) -> Duration {
        self.pauses.iter().copied().max().unwrap_or_default()
    }

    /// Forgets all motions: another run of the core does not know them.
    pub fn forget(&mut self) {
        self.ordered = [None; 3];
    }

    /// Records a poll of the host. Returns the promise to make, if one is due.
    pub fn polled(&mut self, now: Instant) -> Option<f64> {
        if let Some(before) = self.polled.replace(now) {
            self.pauses[self.next_pause % POLLS] = now - before;
            self.next_pause += 1;
        }
        self.ordered[2].take_if(|motion| motion.until.is_none_or(|until| now >= until));
        let every = Duration::from_secs_f64(self.valid_s()) / RENEWALS;
        let is_time = self.renewed.is_none_or(|at| now - at >= every);
        (is_time && self.ordered.iter().any(Option::is_some)).then(|| self.renew(now))
    }

    /// Returns a promise to make now.
    pub fn renew(&mut self, now: Instant) -> f64 {
        self.renewed = Some(now);
        self.valid_s()
    }

    fn valid_s(&self) -> f64 {
        let mut pauses = self.pauses;
        pauses.sort_unstable();
        let foreseen = pauses[POLLS - 1 - FORESEEN];
        let [shortest_s, longest_s] = VALID_RANGE_S;
        (PAUSES * foreseen.as_secs_f64()).clamp(shortest_s, longest_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::{HandMove, RefusalCode};

    fn move_hand() -> Request {
        Request::MoveHand(HandMove {
            tip_m: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            speed_m_per_s: 0.1,
            acceleration_m_per_s2: 1.0,
        })
    }

    /// A host that polls with these pauses.
    struct Host {
        motions: Motions,
        now: Instant,
    }

    impl Host {
        fn new() -> Self {
            Self {
                motions: Motions::default(),
                now: Instant::now(),
            }
        }

        fn moves() -> Self {
            let mut host = Self::new();
            assert!(host.motions.sent(&move_hand(), 5, host.now));
            host
        }

        /// Returns its promises, each with the number of the poll.
        fn polls(&mut self, pauses_ms: &[u64]) -> Vec<(usize, f64)> {
            let mut promises = Vec::new();
            for (poll, &pause_ms) in pauses_ms.iter().enumerate() {
                self.now += Duration::from_millis(pause_ms);
                promises.extend(self.motions.polled(self.now).map(|valid_s| (poll, valid_s)));
            }
            promises
        }

        fn renews(&mut self) -> bool {
            !self.polls(&[2; 20]).is_empty()
        }
    }

    #[test]
    fn a_promise_covers_one_and_a_half_usual_pauses_but_no_single_long_one() {
        for (pause_ms, valid_s, every) in [(2, 0.02, 4), (16, 0.024, 1), (60, 0.09, 1), (900, 0.3, 1)] {
            let mut host = Host::moves();
            host.polls(&[pause_ms; 40]);
            let promised = host.polls(&[&[400], &[pause_ms; 10][..]].concat());
            let last = &promised[promised.len() - 2..];
            assert!((last[1].1 - valid_s).abs() < 1e-9, "{pause_ms} ms: {last:?}");
            assert_eq!(last[1].0 - last[0].0, every, "{pause_ms} ms");
        }
    }

    #[test]
    fn a_motion_is_renewed_until_the_hand_is_there_and_no_longer() {
        assert!(!Host::new().renews(), "nothing moves");
        let mut host = Host::moves();
        host.motions.seen([Some((99, false)), None]);
        assert!(host.renews(), "that was before it");
        host.motions.answered(4, &Ok(50));
        host.motions.answered(5, &Ok(100));
        for state in [(100, false), (200, true)] {
            host.motions.seen([Some(state), Some((200, false))]);
            assert!(host.renews());
        }
        host.motions.seen([Some((201, false)), None]);
        assert!(!host.renews());
    }

    #[test]
    fn a_needle_that_is_drawn_out_is_renewed_for_as_long_as_that_can_take() {
        let mut host = Host::new();
        let speed_m_per_s = 0.5;
        let draw = Request::DrawNeedle {
            number: 1,
            speed_m_per_s,
        };
        assert!(host.motions.sent(&draw, 5, host.now));
        host.polls(&[10; 90]);
        assert!(host.renews());
        host.polls(&[10; 20]);
        assert!(!host.renews());
    }

    #[test]
    fn a_motion_that_was_stopped_refused_or_given_up_is_not_renewed() {
        let refused = Err(RefusalCode::TooManyRequests.into());
        let mut event = Event::zeroed();
        (event.kind, event.tick) = (EventKind::MotionGivenUp as u32, 300);
        let ends: [&dyn Fn(&mut Motions); 4] = [
            &|motions| motions.answered(5, &refused),
            &|motions| assert!(!motions.sent(&Request::StopHand, 6, Instant::now())),
            &|motions| {
                motions.answered(5, &Ok(100));
                motions.take(&event);
            },
            &|motions| motions.forget(),
        ];
        for end in ends {
            let mut host = Host::moves();
            end(&mut host.motions);
            assert!(!host.renews());
        }
    }
}
