//! Every request survives the record, and no record of any bytes is taken for what it is not.

use super::*;
use crate::{MAX_COMMAND_VALUES, PARAMETERS, RefusalCode};

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
        Request::MoveHand(HandMove {
            tip_m: [0.1, 0.2, -0.3],
            direction: [1.0, 0.0, 0.0],
            speed_m_per_s: 1e-4,
            acceleration_m_per_s2: 100.0,
        }),
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
    ]
}

fn record(kind: CommandKind, values: &[f64]) -> Command {
    let mut command = Command::zeroed();
    (command.kind, command.value_count) = (kind as u32, values.len() as u32);
    command.values[..values.len()].copy_from_slice(values);
    command
}

fn refused(kind: CommandKind, values: &[f64]) -> Vec<RequestError> {
    Request::decode(&record(kind, values)).expect_err("malformed").0
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
    // The wire values of schema 5, one of schema 7, three of schema 9, three of schema 12, and one of schema 14.
    assert_eq!(numbers, (1..=21).collect::<Vec<u32>>());
}

#[test]
fn the_other_hand_turns_what_it_holds_or_does_not() {
    let hand = HandMove {
        tip_m: [0.1, 0.2, -0.3],
        direction: [1.0, 0.0, 0.0],
        speed_m_per_s: 0.05,
        acceleration_m_per_s2: 2.0,
    };
    for up in [None, Some([0.0, 0.6, -0.8])] {
        let request = Request::MoveSecondHand(ProbeMove { hand, up });
        let command = request.encode(3, 4).expect("fits");
        assert_eq!(command.value_count, if up.is_some() { 11 } else { 8 });
        assert_eq!(Request::decode(&command), Ok(request));
    }
    let long = Request::MoveSecondHand(ProbeMove {
        hand,
        up: Some([0.0, 0.6, 0.9]),
    });
    let refused = Request::decode(&long.encode(3, 4).expect("fits")).expect_err("not of length 1");
    assert!(matches!(refused.0[..], [RequestError::NotUnit { .. }]), "{refused:?}");
    assert!(matches!(
        refused_of_ten(hand)[..],
        [RequestError::Count {
            kind: CommandKind::MoveSecondHand,
            ..
        }]
    ));
}

fn refused_of_ten(hand: HandMove) -> Vec<RequestError> {
    let whole = Request::MoveSecondHand(ProbeMove { hand, up: None });
    let mut command = whole.encode(3, 4).expect("fits");
    command.value_count = 10;
    Request::decode(&command).expect_err("malformed").0
}

#[test]
fn a_payload_that_does_not_fit_is_not_sent() {
    let long = Request::SetPlan(Some(needle(MAX_SEEDS + 20)));
    assert!(long.encode(1, 1).is_err());
    // One that fits but is too long is refused by the reader.
    let command = Request::SetPlan(Some(needle(MAX_SEEDS + 1)))
        .encode(1, 1)
        .expect("fits");
    assert!(Request::decode(&command).is_err());
}

/// Needles that were there before and those that stay in are counted apart.
#[test]
fn too_many_needles_before_a_rehearsed_one_are_refused() {
    let of = |earlier: usize| NeedleRehearsal {
        stabilising: vec![other(0.04)],
        earlier: vec![other(0.03); earlier],
        ..rehearsal(3)
    };
    let decoded = |earlier: usize| Request::decode(&Request::Rehearse(of(earlier)).encode(1, 1).expect("fits"));
    assert_eq!(
        decoded(crate::MAX_EARLIER_NEEDLES),
        Ok(Request::Rehearse(of(crate::MAX_EARLIER_NEEDLES)))
    );
    assert!(decoded(crate::MAX_EARLIER_NEEDLES + 1).is_err());
}

/// A small generator, so that every run sees the same records.
fn xorshift(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

#[test]
fn ten_thousand_random_records_never_panic_and_what_is_accepted_survives() {
    let mut seed = 0x9e37_79b9_7f4a_7c15;
    let (mut accepted, mut refused) = (0, 0);
    for round in 0..10_000 {
        let mut command = Command::zeroed();
        // Half of them of a known kind and a possible count, so that the payload is looked at.
        if round % 2 == 0 {
            command.kind = (xorshift(&mut seed) % 18) as u32;
            command.value_count = (xorshift(&mut seed) % 440) as u32;
        } else {
            (command.kind, command.value_count) = (xorshift(&mut seed) as u32, xorshift(&mut seed) as u32);
        }
        for value in &mut command.values {
            let bits = xorshift(&mut seed);
            *value = match round % 4 {
                0 => (bits % 50) as f64,
                2 => (bits as f64 / u64::MAX as f64) - 0.5,
                _ => f64::from_bits(bits),
            };
        }
        match Request::decode(&command) {
            Ok(request) => {
                accepted += 1;
                let again = request.encode(0, 0).expect("came out of a record");
                assert_eq!(Request::decode(&again), Ok(request));
            }
            Err(errors) => {
                refused += 1;
                assert!(!errors.0.is_empty() && !errors.to_string().is_empty());
                assert!(!crate::Refusal::from(errors).reasons.is_empty());
            }
        }
    }
    assert!(accepted > 100 && refused > 1000, "{accepted} {refused}");
}

#[test]
fn all_ones_and_counts_beyond_the_record_are_refused() {
    let ones: Command = bytemuck::pod_read_unaligned(&[0xff; size_of::<Command>()]);
    assert_eq!(
        Request::decode(&ones),
        Err(RequestError::UnknownCommand(u32::MAX).into())
    );
    let mut long = record(CommandKind::DropSeed, &[]);
    long.value_count = MAX_COMMAND_VALUES as u32 + 1;
    let reason = Request::decode(&long).expect_err("too long").0[0].reason();
    assert_eq!(reason, (RefusalCode::ValueCount, MAX_COMMAND_VALUES as u32 + 1));
}

#[test]
fn every_malformed_payload_is_refused_with_its_reason() {
    use CommandKind as K;
    use RefusalCode as C;
    for (kind, values, code) in [
        (K::SetParameters, &[1e9, 1.0][..], C::UnknownParameter),
        (K::SetParameters, &[0.5, 1.0], C::UnknownParameter),
        (K::SetParameters, &[-1.0, 1.0], C::UnknownParameter),
        (
            K::SetParameters,
            &[crate::PARAMETER_COUNT as f64, 1.0],
            C::UnknownParameter,
        ),
        (K::SetParameters, &[1.0], C::ValueCount),
        (K::SetParameters, &[], C::ValueCount),
        (K::SetParameters, &[0.0, f64::NAN], C::NotFinite),
        (K::SetParameters, &[0.0, f64::INFINITY], C::NotFinite),
        (
            K::SetPlan,
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0],
            C::NotUnitDirection,
        ),
        (
            K::SetPlan,
            &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -0.1, 0.0],
            C::ValueOutOfLimits,
        ),
        (K::SetPlan, &[0.0; 6], C::ValueCount),
        (K::ExpectNeedle, &[0.0; 5], C::ValueCount),
        (K::ExpectNeedle, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.5], C::NotUnitDirection),
        (K::SetPlan, &[0.0; 397], C::ValueCount),
        (
            K::SetPlan,
            &[21.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            C::PlaceTooFar,
        ),
        (K::MoveHand, &[0.0, 0.0, 1e30, 0.0, 0.0, 1.0, 0.1, 1.0], C::PlaceTooFar),
        (
            K::MoveHand,
            &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1e9, 1.0],
            C::ValueOutOfLimits,
        ),
        (K::MoveHand, &[], C::ValueCount),
        (K::DropSeed, &[0.5], C::ValueOutOfLimits),
        (K::DropSeed, &[0.0], C::ValueOutOfLimits),
        (K::DropSeed, &[0.01, 0.01], C::ValueCount),
        (K::Rehearse, &[0.0; 13], C::ValueCount),
        (K::Rehearse, &[0.0; 18], C::ValueCount),
        (K::Rehearse, &[0.0; 17], C::NotUnitDirection),
        (K::TakeNeedle, &[], C::ValueCount),
        (K::TakeNeedle, &[0.0], C::NoLeftNeedle),
        (K::TakeNeedle, &[1.5], C::NoLeftNeedle),
        (K::DrawNeedle, &[1.0, 9.0], C::ValueOutOfLimits),
        (K::DrawNeedle, &[1.0], C::ValueCount),
        (K::Mark, &[], C::ValueCount),
        (K::Mark, &[-1.0], C::ValueOutOfLimits),
        (K::Mark, &[0.0], C::InvalidText),
        (K::BeginExercise, &[], C::ValueCount),
        (K::BeginExercise, &[1.0, 2.0], C::ValueCount),
        (K::BeginExercise, &[1.5], C::ValueCount),
        (K::BeginExercise, &[2.0], C::ValueCount),
        (K::BeginExercise, &[2.0, 0.5], C::ValueOutOfLimits),
        (K::BeginExercise, &[2.0, 5.1], C::ValueOutOfLimits),
        (K::BeginExercise, &[4.0, 1.0], C::ValueOutOfLimits),
        (K::BeginExercise, &[3.0, 0.009, 0.0, 0.009], C::ValueOutOfLimits),
        (K::BeginExercise, &[3.0, 0.0, f64::NAN, 0.0], C::NotFinite),
        (K::LoadBuiltinScene, &[3.0], C::UnknownScene),
        (K::LoadBuiltinScene, &[0.5], C::UnknownScene),
        (K::LoadBuiltinScene, &[-1.0], C::UnknownScene),
        (K::LoadBuiltinScene, &[0.0, 1.0], C::ValueCount),
    ] {
        assert_eq!(refused(kind, values)[0].reason().0, code, "{kind:?} {values:?}");
    }
}

#[test]
fn words_that_cannot_be_shown_are_neither_sent_nor_taken() {
    let mark = |text: &str| Mark {
        text: text.to_owned(),
        before_s: 0.0,
    };
    for text in ["x".repeat(crate::MARK_BYTES + 1), "a\nb".to_owned(), "a\0b".to_owned()] {
        assert!(Request::Mark(mark(&text)).encode(1, 1).is_err(), "{text:?}");
    }
    let good = Request::Mark(mark("left lobe")).encode(1, 1).expect("fits");
    for bytes in [&[0xff_u8; 3][..], &[b'a', 0, b'b'], b"  ", b"", b"\x1b[m"] {
        let mut bad = good;
        bad.text = Text::new("");
        bytemuck::bytes_of_mut(&mut bad.text)[..bytes.len()].copy_from_slice(bytes);
        let errors = Request::decode(&bad);
        assert_eq!(errors, Err(RequestError::InvalidText.into()), "{bytes:?}");
    }
}

#[test]
fn a_rehearsal_lists_every_bad_value() {
    let mut bad = rehearsal(2);
    bad.direction[2] = 0.9;
    (bad.insert_m_per_s, bad.acceleration_m_per_s2) = (0.0, 1e9);
    bad.strand_pitch_m = Some(-0.01);
    bad.drops_m[1][2] = 30.0;
    let command = Request::Rehearse(bad).encode(1, 1).expect("fits");
    let reasons: Vec<_> = Request::decode(&command)
        .expect_err("bad")
        .0
        .iter()
        .map(RequestError::reason)
        .collect();
    let expected = [
        (RefusalCode::NotUnitDirection, 3),
        (RefusalCode::ValueOutOfLimits, 6),
        (RefusalCode::ValueOutOfLimits, 9),
        (RefusalCode::ValueOutOfLimits, 11),
        (RefusalCode::PlaceTooFar, 17),
    ];
    assert_eq!(reasons, expected);
}

#[test]
fn a_built_in_scene_without_a_number_is_the_first() {
    let command = record(CommandKind::LoadBuiltinScene, &[]);
    assert_eq!(Request::decode(&command), Ok(Request::LoadBuiltinScene(0)));
}
