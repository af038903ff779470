//! Every request survives the record, and no bytes are mistaken for another request.

use super::*;
use crate::{BUILTIN_SCENES, COMMAND_BYTES, MAX_SEEDS, PARAMETERS, Prescribed, Text};

fn needle(seeds: usize) -> PlannedNeedle {
    PlannedNeedle {
        entry_m: [0.01, -0.02, 0.03],
        direction: [0.0, 0.6, 0.8],
        seeds_m: (0..seeds).map(|i| [1e-3 * i as f64, 0.5, -0.25]).collect(),
        prescribed: Prescribed {
            needle: 3,
            last_needle: 18,
            strength_u: 0.5,
            dose_gy: 145.0,
            source: Text::new("6711"),
        },
    }
}

fn rehearsal(drops: usize) -> NeedleRehearsal {
    NeedleRehearsal {
        entry_m: [0.01, -0.02, 0.03],
        direction: [0.0, 0.6, 0.8],
        insert_m_per_s: 0.05,
        retract_m_per_s: 0.06,
        approach_m_per_s: 0.1,
        acceleration_m_per_s2: 2.0,
        retract_to_m: -0.01,
        strand_pitch_m: (drops > 1).then_some(0.01),
        stabilising: Vec::new(),
        earlier: Vec::new(),
        as_points: drops > 2,
        drops_m: needle(drops).seeds_m,
    }
}

fn other(depth_m: f64) -> StabilisingNeedle {
    StabilisingNeedle {
        entry_m: [0.01, 0.02, -0.01],
        direction: [0.0, 0.0, 1.0],
        depth_m,
    }
}

fn hand() -> HandMove {
    HandMove {
        tip_m: [0.1, 0.2, -0.3],
        direction: [1.0, 0.0, 0.0],
        speed_m_per_s: 1e-4,
        acceleration_m_per_s2: 100.0,
    }
}

fn all() -> Vec<Request> {
    let change = |p: &crate::ParameterSpec| ParameterChange {
        id: p.id,
        value: p.default,
    };
    vec![
        Request::SetParameters(PARAMETERS.iter().map(change).collect()),
        Request::SetPlan(None),
        Request::SetPlan(Some(needle(0))),
        Request::SetPlan(Some(needle(MAX_SEEDS))),
        Request::MoveHand(hand()),
        Request::DropSeed { strand_pitch_m: None },
        Request::DropSeed {
            strand_pitch_m: Some(0.01),
        },
        Request::Engage,
        Request::Disengage,
        Request::Reset,
        Request::LoadBuiltinScene(0),
        Request::LoadBuiltinScene(BUILTIN_SCENES.len() as u32 - 1),
        Request::UndoSeed,
        Request::Shutdown,
        Request::SaveFlight,
        Request::Rehearse(rehearsal(1)),
        Request::Rehearse(rehearsal(MAX_SEEDS)),
        Request::Rehearse(NeedleRehearsal {
            stabilising: vec![other(0.04); crate::MAX_LEFT_NEEDLES],
            ..rehearsal(MAX_SEEDS)
        }),
        Request::Rehearse(NeedleRehearsal {
            stabilising: vec![other(0.04)],
            earlier: (1..=crate::MAX_EARLIER_NEEDLES)
                .map(|n| other(1e-3 * n as f64))
                .collect(),
            ..rehearsal(10)
        }),
        Request::StopHand,
        Request::ExpectNeedle(NeedleAxis {
            entry_m: [0.01, 0.02, 0.03],
            direction: [0.0, 0.0, 1.0],
        }),
        Request::LeaveNeedle,
        Request::TakeNeedle(7),
        Request::DrawNeedle {
            number: 3,
            speed_m_per_s: 0.05,
        },
        Request::Mark(Mark {
            text: "é".repeat(crate::MARK_BYTES / 2),
            before_s: 3.5,
        }),
        Request::BeginExercise(Exercise::DeviceLost),
        Request::BeginExercise(Exercise::StiffTissue { factor: 2.5 }),
        Request::BeginExercise(Exercise::BodyMoved {
            by_m: [0.006, 0.0, -0.008],
        }),
        Request::EndExercises,
        Request::KeepMoving { valid_s: 0.02 },
        Request::MoveSecondHand(ProbeMove { hand: hand(), up: None }),
        Request::MoveSecondHand(ProbeMove {
            hand: hand(),
            up: Some([0.0, 0.6, -0.8]),
        }),
        Request::StopSecondHand,
    ]
}

fn reasons(request: &Request) -> Vec<RefusalCode> {
    let command = request.encode(1, 1).expect("fits");
    let refusal = Request::decode(&command).expect_err("invalid");
    assert!(!refusal.text.is_empty());
    refusal.reasons.iter().filter_map(Reason::code).collect()
}

#[test]
fn every_request_survives_its_record() {
    let mut numbers: Vec<u32> = Vec::new();
    for request in all() {
        let command = request.encode(3, 4).expect("fits");
        assert_eq!((command.host_id, command.command_id), (3, 4));
        assert_eq!(Request::decode(&command).as_ref(), Ok(&request));
        numbers.push(command.kind);
    }
    numbers.dedup();
    // Numbers are never reused.
    assert_eq!(numbers, (1..=21).chain([30, 31]).collect::<Vec<u32>>());
}

#[test]
fn the_longest_rehearsal_fits_and_one_needle_more_is_refused() {
    let longest = |earlier| {
        Request::Rehearse(NeedleRehearsal {
            stabilising: vec![other(0.04); crate::MAX_LEFT_NEEDLES],
            earlier: vec![other(0.03); earlier],
            ..rehearsal(MAX_SEEDS)
        })
    };
    let command = longest(crate::MAX_EARLIER_NEEDLES).encode(1, 1).expect("fits");
    assert_eq!(Request::decode(&command), Ok(longest(crate::MAX_EARLIER_NEEDLES)));
    assert_eq!(
        reasons(&longest(crate::MAX_EARLIER_NEEDLES + 1)),
        [RefusalCode::WrongCount]
    );
    let error = longest(200).encode(1, 1).expect_err("does not fit");
    assert_eq!(error.reasons[0].code(), Some(RefusalCode::WrongCount));
}

#[test]
fn damaged_records_never_panic_and_what_is_accepted_survives() {
    let originals: Vec<Command> = all()
        .iter()
        .map(|request| request.encode(1, 1).expect("fits"))
        .collect();
    let mut random = stylet_random::Random(1);
    let (mut accepted, mut refused) = (0, 0);
    for round in 0..20_000 {
        let mut command = originals[round % originals.len()];
        for _ in 0..1 + random.draw() % 4 {
            let at = (random.draw() as usize) % (command.length as usize + 8).min(COMMAND_BYTES);
            command.payload[at] = random.draw() as u8;
        }
        match random.draw() % 4 {
            0 => command.length = random.draw() as u32,
            1 => command.length = (random.draw() % COMMAND_BYTES as u64) as u32,
            _ => {}
        }
        match Request::decode(&command) {
            Ok(request) => {
                accepted += 1;
                let again = request.encode(0, 0).expect("came out of a record");
                assert_eq!(Request::decode(&again), Ok(request));
            }
            Err(refusal) => {
                refused += 1;
                assert!(!refusal.reasons.is_empty());
            }
        }
    }
    assert!(accepted > 1000 && refused > 1000, "{accepted} {refused}");
}

#[test]
fn unknown_numbers_false_lengths_and_another_kind_are_refused() {
    let ones: Command = bytemuck::pod_read_unaligned(&[0xff; size_of::<Command>()]);
    let why = |command: &Command| Request::decode(command).expect_err("refused").reasons;
    assert_eq!(why(&ones), [Reason::new(RefusalCode::UnknownCommand, u32::MAX)]);
    let malformed = [Reason::new(RefusalCode::Malformed, Reason::NO_SUBJECT)];
    let good = Request::TakeNeedle(7).encode(1, 1).expect("fits");
    for length in [0, good.length - 1, good.length + 1, COMMAND_BYTES as u32 + 1, u32::MAX] {
        let bad = Command { length, ..good };
        assert_eq!(why(&bad), malformed, "{length}");
    }
    let kind = CommandKind::Engage as u32;
    assert_eq!(why(&Command { kind, ..good }), malformed);
}

#[test]
fn every_value_outside_its_limits_is_refused_with_its_reason() {
    use RefusalCode as C;
    let change = |value| ParameterChange {
        id: ParameterId::MinStretch,
        value,
    };
    let moves = |change: &dyn Fn(&mut HandMove)| {
        let mut hand = hand();
        change(&mut hand);
        hand
    };
    let planned = |change: &dyn Fn(&mut PlannedNeedle)| {
        let mut needle = needle(2);
        change(&mut needle);
        Request::SetPlan(Some(needle))
    };
    let mark = |text: &str, before_s| {
        Request::Mark(Mark {
            text: text.to_owned(),
            before_s,
        })
    };
    let too_long = "x".repeat(crate::MARK_BYTES + 1);
    for (request, code) in [
        (Request::SetParameters(Vec::new()), C::WrongCount),
        (Request::SetParameters(vec![change(f64::NAN)]), C::ValueOutOfLimits),
        (Request::SetParameters(vec![change(f64::INFINITY)]), C::ValueOutOfLimits),
        (planned(&|n| n.direction = [0.0, 0.0, 0.5]), C::NotUnitDirection),
        (planned(&|n| n.entry_m[0] = 21.0), C::PlaceTooFar),
        (planned(&|n| n.seeds_m[1][2] = f64::NAN), C::PlaceTooFar),
        (planned(&|n| n.seeds_m = vec![[0.0; 3]; MAX_SEEDS + 1]), C::WrongCount),
        (planned(&|n| n.prescribed.strength_u = -0.1), C::ValueOutOfLimits),
        (planned(&|n| n.prescribed.dose_gy = f64::NAN), C::ValueOutOfLimits),
        (planned(&|n| n.prescribed.needle = 1001), C::ValueOutOfLimits),
        (planned(&|n| n.prescribed.source = Text::new("67\n11")), C::InvalidText),
        (Request::MoveHand(moves(&|h| h.tip_m[2] = 1e30)), C::PlaceTooFar),
        (
            Request::MoveHand(moves(&|h| h.direction[0] = f64::NAN)),
            C::NotUnitDirection,
        ),
        (
            Request::MoveHand(moves(&|h| h.speed_m_per_s = 1e9)),
            C::ValueOutOfLimits,
        ),
        (
            Request::MoveHand(moves(&|h| h.acceleration_m_per_s2 = 0.0)),
            C::ValueOutOfLimits,
        ),
        (
            Request::MoveSecondHand(ProbeMove {
                hand: hand(),
                up: Some([0.0, 0.6, 0.9]),
            }),
            C::NotUnitDirection,
        ),
        (
            Request::DropSeed {
                strand_pitch_m: Some(0.5),
            },
            C::ValueOutOfLimits,
        ),
        (
            Request::DropSeed {
                strand_pitch_m: Some(0.0),
            },
            C::ValueOutOfLimits,
        ),
        (Request::Rehearse(rehearsal(0)), C::WrongCount),
        (Request::TakeNeedle(0), C::NoLeftNeedle),
        (
            Request::DrawNeedle {
                number: 1,
                speed_m_per_s: 9.0,
            },
            C::ValueOutOfLimits,
        ),
        (mark("left lobe", -1.0), C::ValueOutOfLimits),
        (mark("", 0.0), C::InvalidText),
        (mark("  ", 0.0), C::InvalidText),
        (mark("a\nb", 0.0), C::InvalidText),
        (mark("a\0b", 0.0), C::InvalidText),
        (mark("\x1b[m", 0.0), C::InvalidText),
        (mark(&too_long, 0.0), C::InvalidText),
        (
            Request::BeginExercise(Exercise::StiffTissue { factor: 0.5 }),
            C::ValueOutOfLimits,
        ),
        (
            Request::BeginExercise(Exercise::StiffTissue { factor: 5.1 }),
            C::ValueOutOfLimits,
        ),
        (
            Request::BeginExercise(Exercise::BodyMoved {
                by_m: [0.009, 0.0, 0.009],
            }),
            C::ValueOutOfLimits,
        ),
        (
            Request::BeginExercise(Exercise::BodyMoved {
                by_m: [0.0, f64::NAN, 0.0],
            }),
            C::ValueOutOfLimits,
        ),
        (Request::LoadBuiltinScene(BUILTIN_SCENES.len() as u32), C::UnknownScene),
        (Request::KeepMoving { valid_s: 0.4 }, C::ValueOutOfLimits),
    ] {
        assert_eq!(reasons(&request), [code], "{request:?}");
    }
}

#[test]
fn a_rehearsal_lists_every_bad_value() {
    let mut bad = rehearsal(2);
    bad.direction[2] = 0.9;
    (bad.insert_m_per_s, bad.acceleration_m_per_s2) = (0.0, 1e9);
    bad.strand_pitch_m = Some(-0.01);
    bad.drops_m[1][2] = 30.0;
    let limits = RefusalCode::ValueOutOfLimits;
    let expected = [
        RefusalCode::NotUnitDirection,
        limits,
        limits,
        limits,
        RefusalCode::PlaceTooFar,
    ];
    assert_eq!(reasons(&Request::Rehearse(bad)), expected);
}
