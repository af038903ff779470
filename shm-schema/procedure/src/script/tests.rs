//! The state machine against a hand that follows each request, and against each way of failing to.

use super::*;
use bytemuck::Zeroable;
use stylet_shm_schema::flags;

/// Two drops along z, 30 and 20 mm from the entry.
fn way() -> NeedleWay {
    NeedleWay {
        entry_m: Vector3::new(0.01, 0.0, 0.0),
        direction: Vector3::z(),
        drops_m: [0.03, 0.02].map(|z| Vector3::new(0.01, 0.0, z)).to_vec(),
        retract_to_m: 0.0,
        strand_pitch_m: None,
    }
}

fn waited(waits_for: WaitsFor, limit_s: f64) -> Result<Next, StepFailure> {
    Err(StepFailure::Waited { waits_for, limit_s })
}

/// A hand that reaches its goal at once, and tissue at rest.
struct Obedient {
    state: HapticState,
    now_s: f64,
    sent: Vec<HandRequest>,
}

impl Obedient {
    fn new() -> Self {
        let mut state = HapticState::zeroed();
        state.flags = flags::AT_GOAL;
        Self {
            state,
            now_s: 0.0,
            sent: Vec::new(),
        }
    }

    /// Steps one millisecond; drops after `lost` are refused.
    fn step(&mut self, procedure: &mut Procedure, lost: &[usize]) -> Result<Next, StepFailure> {
        self.now_s += 1e-3;
        let drops = self
            .sent
            .iter()
            .filter(|r| matches!(r, HandRequest::DropSeed { .. }))
            .count();
        let is_lost =
            matches!(self.sent.last(), Some(HandRequest::DropSeed { .. })) && lost.contains(&(drops.saturating_sub(1)));
        let reply = if is_lost {
            Reply::TipOutsideTissue
        } else {
            Reply::InEffect
        };
        let observed = Observed {
            state: &self.state,
            displacement_m: Some(0.0),
        };
        let next = procedure.advance(self.now_s, Some(&observed), reply)?;
        if let Next::Send(request) = next {
            match request {
                HandRequest::MoveHand(goal) => self.state.tip_in_scene_m = goal.tip_m,
                HandRequest::LeaveNeedle => self.state.left_count += 1,
                HandRequest::DrawFirstLeft { .. } => self.state.left_count -= 1,
                HandRequest::DropSeed { .. } if !lost.contains(&drops) => self.state.seed_count += 1,
                _ => {}
            }
            self.sent.push(request);
        }
        Ok(next)
    }

    fn go_through(&mut self, procedure: &mut Procedure, lost: &[usize]) -> Vec<Step> {
        let mut steps = vec![procedure.step()];
        while self.step(procedure, lost).expect("obeys") != Next::Done {
            assert!(self.now_s < 60.0, "hangs in {:?}", procedure.step());
            if steps.last() != Some(&procedure.step()) {
                steps.push(procedure.step());
            }
        }
        steps
    }
}

/// Depth of each move from the entry, mm, and "drop" for each drop.
fn words(sent: &[HandRequest]) -> Vec<String> {
    let word = |request: &HandRequest| match request {
        HandRequest::MoveHand(goal) => format!("{:.0} mm at {:.0} mm/s", goal.tip_m[2] * 1e3, goal.speed_m_per_s * 1e3),
        HandRequest::PublishPlan { needle } => format!("plan {needle}"),
        other => other.name().to_owned(),
    };
    sent.iter().map(word).collect()
}

#[test]
fn a_procedure_goes_through_each_needle_step_by_step() {
    let (mut hand, mut procedure) = (
        Obedient::new(),
        Procedure::of_needles(vec![way(), way()], Pace::default()),
    );
    let steps = hand.go_through(&mut procedure, &[]);
    let of_needle = [
        Step::Plan,
        Step::Place,
        Step::Insert,
        Step::Drop,
        Step::Retract,
        Step::Settle,
    ];
    assert_eq!(steps, [of_needle, of_needle].concat());
    let in_and_out = [
        "0 mm at 100 mm/s",
        "30 mm at 50 mm/s",
        "DropSeed",
        "20 mm at 50 mm/s",
        "DropSeed",
        "0 mm at 50 mm/s",
    ];
    let expected = [
        &["Reset", "plan 0", "Engage"][..],
        &in_and_out,
        &["plan 1"],
        &in_and_out,
    ]
    .concat();
    assert_eq!(words(&hand.sent), expected);
    assert_eq!((procedure.step(), procedure.needle()), (Step::Done, 1));
}

#[test]
fn a_drawn_back_needle_is_taken_out_except_in_a_rehearsal() {
    let way = NeedleWay {
        retract_to_m: 0.01,
        strand_pitch_m: None,
        ..way()
    };
    let mut hand = Obedient::new();
    hand.go_through(&mut Procedure::of_needles(vec![way.clone()], Pace::default()), &[]);
    assert!(words(&hand.sent).ends_with(&["10 mm at 50 mm/s".to_owned(), "0 mm at 50 mm/s".to_owned()]));
    let mut hand = Obedient::new();
    hand.go_through(&mut Procedure::rehearsal(way, Pace::default(), Vec::new()), &[]);
    let sent = words(&hand.sent);
    assert_eq!(
        (sent[0].as_str(), sent.last().map(String::as_str)),
        ("Engage", Some("10 mm at 50 mm/s"))
    );
}

#[test]
fn a_drop_outside_the_tissue_is_lost_and_the_next_one_is_dropped() {
    let (mut hand, mut procedure) = (Obedient::new(), Procedure::of_needles(vec![way()], Pace::default()));
    hand.go_through(&mut procedure, &[0]);
    assert_eq!((procedure.lost(), hand.state.seed_count), (&[0][..], 1));
}

#[test]
fn a_tip_resting_short_arrives_late_and_a_distant_one_never() {
    let mut after_s = Vec::new();
    for short_m in [0.0, 1.5e-3] {
        let (mut hand, mut procedure) = (
            Obedient::new(),
            Procedure::rehearsal(way(), Pace::default(), Vec::new()),
        );
        while procedure.step() != Step::Insert {
            hand.step(&mut procedure, &[]).expect("obeys");
        }
        let begun_s = hand.now_s;
        while procedure.step() == Step::Insert {
            hand.step(&mut procedure, &[]).expect("obeys");
            hand.state.tip_in_scene_m[2] = 0.03 - short_m;
        }
        after_s.push(hand.now_s - begun_s);
    }
    assert!(
        (after_s[0] - 0.06).abs() < 5e-3 && (after_s[1] - 1.5).abs() < 5e-3,
        "{after_s:?}"
    );
    let (mut hand, mut procedure) = (
        Obedient::new(),
        Procedure::rehearsal(way(), Pace::default(), Vec::new()),
    );
    let failure = loop {
        match hand.step(&mut procedure, &[]) {
            Ok(_) => hand.state.tip_in_scene_m[2] = -0.05,
            Err(failure) => break failure,
        }
    };
    let failure = failure.to_string();
    assert!(
        failure.starts_with("waited 11.0 s for the tip, 50.0 mm from its target"),
        "{failure}"
    );
}

#[test]
fn what_is_not_answered_refused_or_without_effect_ends_the_procedure() {
    let state = HapticState::zeroed();
    let observed = Observed {
        state: &state,
        displacement_m: None,
    };
    let fails = |reply: Reply, now_s: f64| {
        let mut procedure = Procedure::of_needles(vec![way()], Pace::default());
        assert_eq!(
            procedure.advance(0.0, Some(&observed), Reply::Pending),
            Ok(Next::Send(HandRequest::Reset))
        );
        procedure.advance(now_s, Some(&observed), reply)
    };
    assert_eq!(fails(Reply::Pending, 2.9), Ok(Next::Wait));
    assert_eq!(fails(Reply::Accepted, 2.9), Ok(Next::Wait));
    assert_eq!(fails(Reply::Pending, 3.1), waited(WaitsFor::Reply("Reset"), 3.0));
    assert_eq!(fails(Reply::Accepted, 3.1), waited(WaitsFor::Effect("Reset"), 3.0));
    let refused = fails(Reply::Refused("no".to_owned()), 0.1).map_err(|e| e.to_string());
    assert_eq!(refused, Err("Reset was refused: no".to_owned()));
    let mut unseen = Procedure::of_needles(vec![way()], Pace::default());
    assert_eq!(unseen.advance(0.0, None, Reply::Pending), Ok(Next::Wait));
    assert_eq!(unseen.advance(3.1, None, Reply::Pending), waited(WaitsFor::State, 3.0));
}

#[test]
fn nothing_is_sent_while_a_fault_stands_unless_somebody_asked_to_rearm() {
    let (mut hand, mut procedure) = (Obedient::new(), Procedure::of_needles(vec![way()], Pace::default()));
    hand.state.fault = Fault::TissueStale as u32;
    let failure = hand.step(&mut procedure, &[]).expect_err("a person re-arms");
    assert_eq!(failure, StepFailure::FaultStands(Fault::TissueStale));
    assert!(hand.sent.is_empty(), "not even a reset");
    let mut procedure = Procedure::of_needles(vec![way()], Pace::default()).rearming();
    assert!(hand.step(&mut procedure, &[]).is_ok() && !hand.sent.is_empty());
}

#[test]
fn a_rearming_procedure_ends_on_a_fault_only_after_engaging() {
    let (mut hand, procedure) = (
        Obedient::new(),
        Procedure::rehearsal(way(), Pace::default(), Vec::new()),
    );
    let mut procedure = procedure.rearming();
    hand.state.fault = Fault::DeviceError as u32;
    assert!(hand.step(&mut procedure, &[]).is_ok() && hand.step(&mut procedure, &[]).is_ok());
    assert_eq!(
        hand.step(&mut procedure, &[]),
        Err(StepFailure::ForceOff(Fault::DeviceError))
    );
}

/// A drop that a busy machine answered after 3 s ended the implant.
#[test]
fn an_operator_decides_how_long_is_waited_and_sees_what_for() {
    let state = HapticState::zeroed();
    let observed = Observed {
        state: &state,
        displacement_m: None,
    };
    let begin = |patience| {
        let mut procedure = Procedure::of_needles(vec![way()], Pace::default()).with_patience(patience);
        let _sent = procedure.advance(0.0, Some(&observed), Reply::Pending);
        procedure
    };
    let mut procedure = begin(Patience::Operator);
    assert_eq!(
        procedure.advance(3_600.0, Some(&observed), Reply::Pending),
        Ok(Next::Wait)
    );
    let waiting = procedure.waiting();
    assert_eq!((waiting.waits_for, waiting.for_s), (WaitsFor::Reply("Reset"), 3_600.0));
    assert_eq!(waiting.waits_for.to_string(), "a reply to Reset");
    assert_eq!(
        procedure.advance(3_601.0, Some(&observed), Reply::InEffect),
        Ok(Next::Continue)
    );
    let mut unwatched = begin(Patience::AtLeast(60.0));
    assert_eq!(unwatched.advance(59.0, Some(&observed), Reply::Pending), Ok(Next::Wait));
    let failed = unwatched.advance(61.0, Some(&observed), Reply::Pending);
    assert_eq!(failed, waited(WaitsFor::Reply("Reset"), 60.0));
}

/// Stops after `sent` requests and continues from the state of the tissue; returns the requests after that.
fn continued(ways: &[NeedleWay], sent: usize) -> (Obedient, Vec<HandRequest>) {
    let mut hand = Obedient::new();
    let mut procedure = Procedure::of_needles(ways.to_vec(), Pace::default());
    while hand.sent.len() < sent {
        assert_ne!(hand.step(&mut procedure, &[]), Ok(Next::Done));
    }
    let done = Done {
        drops: (0..hand.state.seed_count as usize).collect(),
        lost: Vec::new(),
        inside: needle_inside(ways, hand.state.tip_in_scene_m),
    };
    let before = std::mem::take(&mut hand.sent);
    let mut procedure = Procedure::continuing(ways.to_vec(), Pace::default(), &done);
    hand.go_through(&mut procedure, &[]);
    (hand, before)
}

/// A run that was stopped restarted at its first needle, ignoring the seeds already there.
#[test]
fn a_stopped_procedure_continues_with_every_seed_exactly_once() {
    let beside = |x: f64| NeedleWay {
        entry_m: Vector3::new(x, 0.0, 0.0),
        drops_m: [0.03, 0.02].map(|z| Vector3::new(x, 0.0, z)).to_vec(),
        ..way()
    };
    let ways = [beside(0.01), beside(0.02), beside(0.03)];
    let mut whole = Obedient::new();
    whole.go_through(&mut Procedure::of_needles(ways.to_vec(), Pace::default()), &[]);
    for stopped in 3..=whole.sent.len() {
        let (hand, before) = continued(&ways, stopped);
        assert_eq!(hand.state.seed_count, 6, "stopped after {:?}", words(&before));
        assert!(!hand.sent.contains(&HandRequest::Reset), "{:?}", words(&hand.sent));
        let drops = [before, hand.sent].concat();
        let drops = drops
            .iter()
            .filter(|r| matches!(r, HandRequest::DropSeed { .. }))
            .count();
        assert_eq!(drops, 6, "stopped after {stopped}");
    }
    // In the second needle, with its first seed dropped: continues at its second.
    let (hand, _) = continued(&ways, 13);
    assert_eq!(
        words(&hand.sent)[..4],
        ["plan 1", "Engage", "20 mm at 50 mm/s", "DropSeed"]
    );
}

#[test]
fn stabilising_needles_go_in_first_stay_and_are_drawn_out_at_the_end() {
    let beside = |x: f64| NeedleWay {
        entry_m: Vector3::new(x, 0.0, 0.0),
        drops_m: vec![Vector3::new(x, 0.0, 0.03)],
        ..way()
    };
    let ways = vec![way()];
    let mut procedure = Procedure::of_needles(ways, Pace::default()).stabilised(vec![beside(0.0), beside(0.02)]);
    let (mut hand, mut most, mut left_at_drops) = (Obedient::new(), 0, Vec::new());
    let mut which = vec![procedure.stabilising()];
    while hand.step(&mut procedure, &[]).expect("goes on") != Next::Done {
        most = most.max(hand.state.left_count);
        left_at_drops.resize(hand.state.seed_count as usize, hand.state.left_count);
        if which.last() != Some(&procedure.stabilising()) {
            which.push(procedure.stabilising());
        }
        assert_eq!(procedure.needle(), 0);
    }
    assert_eq!((most, hand.state.left_count, hand.state.seed_count), (2, 0, 2));
    assert_eq!(left_at_drops, [2, 2], "both stay in while seeds are dropped");
    // The reset precedes the first; the last two are drawn out.
    assert_eq!(which, [None, Some(0), Some(1), None, Some(0), Some(1)]);
    let names: Vec<_> = hand.sent.iter().map(HandRequest::name).collect();
    assert_eq!(names.iter().filter(|name| **name == "LeaveNeedle").count(), 2);
    assert_eq!(names.iter().filter(|name| **name == "Engage").count(), 1);
    assert_eq!(names.first(), Some(&"Reset"));
    // A rehearsal with them ends with both in.
    let mut rehearsal = Procedure::rehearsal(way(), Pace::default(), vec![beside(0.0), beside(0.02)]);
    let mut hand = Obedient::new();
    while hand.step(&mut rehearsal, &[]).expect("goes on") != Next::Done {}
    assert_eq!((hand.state.left_count, hand.state.seed_count), (2, 2));
}
