//! A simulated hand that a tracker or a stepper moves: the client in control, and the check of its
//! transforms.

use crate::codec::Status;
use crate::frame;
use crate::server::Received;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use stylet_anatomy::PatientFrame;
use stylet_shm_schema::{HandMove, ProbeMove, Request};

/// Silence of a client after which it loses control and the hand stops.
pub const SILENCE: Duration = Duration::from_millis(300);
const ACCELERATION_M_PER_S2: f64 = 2.0;

/// Options of clients that move the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct HandOptions {
    /// Device whose transforms move it.
    pub device: String,
    /// Largest speed, m/s.
    pub speed_m_per_s: f64,
}

/// Tool of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// The needle.
    Needle,
    /// Ultrasound probe, which a transform turns about its axis as well.
    Probe,
}

impl Held {
    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Needle => "needle",
            Self::Probe => "probe",
        }
    }

    /// Returns the request that moves the hand.
    pub fn moved(self, goal: ProbeMove) -> Request {
        match self {
            Self::Needle => Request::MoveHand(goal.hand),
            Self::Probe => Request::MoveSecondHand(goal),
        }
    }

    /// Returns the request that stops the hand.
    pub fn stopped(self) -> Request {
        match self {
            Self::Needle => Request::StopHand,
            Self::Probe => Request::StopSecondHand,
        }
    }
}

/// Hand under remote control.
pub struct Hand {
    held: Held,
    options: Option<HandOptions>,
    holder: Option<(SocketAddr, Instant)>,
    /// Last goal, which is not sent again while it is unchanged.
    goal: Option<ProbeMove>,
}

impl Hand {
    /// Creates a hand at rest; without options it cannot be moved.
    pub fn new(held: Held, options: Option<HandOptions>) -> Self {
        Self {
            held,
            options,
            holder: None,
            goal: None,
        }
    }

    /// Returns its tool.
    pub fn held(&self) -> Held {
        self.held
    }

    /// Returns whether the transforms of this name move it.
    pub fn is_moved_by(&self, device: &str) -> bool {
        self.options.as_ref().is_some_and(|options| options.device == device)
    }

    /// Returns how a transform of this name moves the hand, or why it may not.
    pub fn agreed(&self, device: &str) -> Result<&HandOptions, Status> {
        let options = self.options.as_ref().ok_or_else(|| {
            let words = "this server takes no transforms: start it with --hand NAME to let one move the needle, with \
                         --probe NAME to let one move the probe";
            Status::refused(5, "Access denied", words)
        })?;
        if options.device != device {
            let name = self.held.name();
            let words = format!("the {name} is moved by the transform \"{}\" alone", options.device);
            return Err(Status::refused(4, "Not found", words));
        }
        Ok(options)
    }

    /// Returns the request for a transform; `None` if the goal is unchanged.
    pub fn take(
        &mut self,
        received: &Received,
        patient: &PatientFrame,
        now: Instant,
    ) -> Result<Option<ProbeMove>, Status> {
        let options = self.agreed(&received.device)?;
        let name = self.held.name();
        let tool = frame::tool(patient, &received.columns).ok_or_else(|| {
            let words = "its axes are not those of a rigid body: three perpendicular, right-handed, of length 1";
            Status::refused(10, "Configuration error", words)
        })?;
        let goal = ProbeMove {
            hand: HandMove {
                tip_m: tool.tip_m,
                direction: tool.direction,
                speed_m_per_s: options.speed_m_per_s,
                acceleration_m_per_s2: ACCELERATION_M_PER_S2,
            },
            up: (self.held == Held::Probe).then_some(tool.up),
        };
        match self.holder {
            Some((holder, heard)) if holder != received.from && now - heard < SILENCE => {
                let words = format!("another client moves the {name}");
                Err(Status::refused(6, "Busy", words))
            }
            _ => {
                self.holder = Some((received.from, now));
                let is_new = self.goal.replace(goal) != Some(goal);
                Ok(is_new.then_some(goal))
            }
        }
    }

    /// Returns whether a client controls it.
    pub fn is_held(&self) -> bool {
        self.holder.is_some()
    }

    /// Returns true once when the controlling client has fallen silent.
    pub fn falls_silent(&mut self, now: Instant) -> bool {
        let is_silent = self.holder.is_some_and(|(_, heard)| now - heard >= SILENCE);
        if is_silent {
            (self.holder, self.goal) = (None, None);
        }
        is_silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UPRIGHT: [[f32; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [10.0, -20.0, 30.0]];

    fn options() -> Option<HandOptions> {
        Some(HandOptions {
            device: "Stylus".to_owned(),
            speed_m_per_s: 0.1,
        })
    }

    fn sent(port: u16, device: &str, columns: [[f32; 3]; 4]) -> Received {
        Received {
            from: SocketAddr::from(([127, 0, 0, 1], port)),
            device: device.to_owned(),
            columns,
        }
    }

    fn hand(options: Option<HandOptions>) -> Hand {
        Hand::new(Held::Needle, options)
    }

    fn code(taken: Result<Option<ProbeMove>, Status>) -> u16 {
        taken.expect_err("refused").code
    }

    #[test]
    fn a_transform_moves_the_tip_along_its_third_axis() {
        let (mut hand, now, frame) = (hand(options()), Instant::now(), PatientFrame::default());
        let goal = hand.take(&sent(1, "Stylus", UPRIGHT), &frame, now).expect("possible");
        let goal = goal.expect("new");
        assert_eq!(goal.up, None, "a needle is round");
        let goal = goal.hand;
        assert!((0..3).all(|a| (goal.tip_m[a] - [0.01, -0.02, 0.03][a]).abs() < 1e-9));
        assert_eq!((goal.direction, goal.speed_m_per_s), ([0.0, 0.0, 1.0], 0.1));
        assert_eq!(hand.take(&sent(1, "Stylus", UPRIGHT), &frame, now), Ok(None));
    }

    #[test]
    fn a_probe_is_turned_about_its_axis_too() {
        let (mut hand, now, frame) = (
            Hand::new(Held::Probe, options()),
            Instant::now(),
            PatientFrame::default(),
        );
        let taken = hand.take(&sent(1, "Stylus", UPRIGHT), &frame, now);
        let goal = taken.expect("possible").expect("new");
        assert_eq!((goal.hand.direction, goal.up), ([0.0, 0.0, 1.0], Some([0.0, 1.0, 0.0])));
        let turned = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], UPRIGHT[3]];
        let taken = hand.take(&sent(1, "Stylus", turned), &frame, now);
        assert_eq!(taken.expect("possible").expect("new").up, Some([-1.0, 0.0, 0.0]));
        assert!(matches!(Held::Probe.moved(goal), Request::MoveSecondHand(_)));
        assert_eq!(Held::Probe.stopped(), Request::StopSecondHand);
    }

    #[test]
    fn unwanted_and_invalid_transforms_are_refused() {
        let (now, frame) = (Instant::now(), PatientFrame::default());
        assert_eq!(code(hand(None).take(&sent(1, "Stylus", UPRIGHT), &frame, now)), 5);
        let mut hand = hand(options());
        assert_eq!(code(hand.take(&sent(1, "Probe", UPRIGHT), &frame, now)), 4);
        let mut longer = UPRIGHT;
        longer[0][0] = 1.1;
        let mut skewed = UPRIGHT;
        skewed[1] = [0.6, 0.8, 0.0];
        let mut mirrored = UPRIGHT;
        mirrored[2][2] = -1.0;
        for columns in [longer, skewed, mirrored, [[0.0; 3]; 4]] {
            assert_eq!(code(hand.take(&sent(1, "Stylus", columns), &frame, now)), 10);
        }
        assert!(!hand.falls_silent(now + SILENCE), "nobody moved it");
    }

    #[test]
    fn one_client_holds_the_hand_until_it_is_silent() {
        let (mut hand, start, frame) = (hand(options()), Instant::now(), PatientFrame::default());
        assert!(hand.take(&sent(1, "Stylus", UPRIGHT), &frame, start).is_ok());
        let soon = start + SILENCE / 2;
        assert_eq!(code(hand.take(&sent(2, "Stylus", UPRIGHT), &frame, soon)), 6);
        assert!(!hand.falls_silent(soon));
        assert!(hand.falls_silent(start + SILENCE));
        assert!(!hand.falls_silent(start + SILENCE), "once");
        let goal = hand.take(&sent(2, "Stylus", UPRIGHT), &frame, start + SILENCE);
        assert!(goal.expect("nobody else").is_some(), "the hand was stopped");
    }
}
