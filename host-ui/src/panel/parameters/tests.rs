//! The dialog of the parameters, without a window.

use super::*;
use stylet_shm_schema::{ParameterId, Reason, RefusalCode};

fn refused(reasons: &[(RefusalCode, ParameterId)]) -> Answer {
    let reason = |&(code, id): &(RefusalCode, ParameterId)| Reason::new(code, id as u32);
    Err(Refusal {
        text: "force.cutting_gain = 3.000000; it must be 0.000000 to 1.000000".to_owned(),
        reasons: reasons.iter().map(reason).collect(),
    })
}

#[test]
fn a_search_matches_all_words_in_name_key_and_source() {
    assert_eq!(found("").len(), PARAMETER_COUNT);
    let keys = |search| found(search).iter().map(|&i| PARAMETERS[i].key).collect::<Vec<_>>();
    assert_eq!(keys("PUNCTURE depth u_cri"), ["needle.puncture_depth"]);
    assert_eq!(keys("podder capsule"), ["force.membrane_peak"]);
    assert!(keys("no such thing").is_empty());
}

#[test]
fn edits_made_during_a_change_are_sent_after_it() {
    let mut state = ParametersState::default();
    state.edit(0, 0.6);
    let pairs = state.request().expect("something to send");
    state.sent(7, pairs);
    state.edit(0, 0.7);
    assert_eq!(state.request(), None);
    state.answered(&Ok(100));
    assert_eq!(state.request(), Some(vec![(0, 0.7)]));
}

#[test]
fn a_refusal_is_shown_at_its_row() {
    let mut state = ParametersState::default();
    state.edit(6, 0.01);
    let pairs = state.request().expect("something to send");
    state.sent(7, pairs);
    state.answered(&refused(&[(
        RefusalCode::ParameterOutOfLimits,
        ParameterId::PunctureDepth,
    )]));
    let why = RefusalCode::ParameterOutOfLimits.message();
    assert_eq!(state.notes[6], RowNote::Refused(why));
    assert_eq!(state.drafts[6], None);
}

/// Guards against a search for reasons by key: `force.cutting` is a part of `force.cutting_gain`.
#[test]
fn a_refusal_of_the_cutting_gain_is_not_one_of_the_cutting_force() {
    let mut state = ParametersState::default();
    let (force, gain) = (ParameterId::CuttingForce as usize, ParameterId::CuttingGain as usize);
    state.edit(force, 2.0);
    state.edit(gain, 3.0);
    let pairs = state.request().expect("something to send");
    state.sent(7, pairs);
    state.answered(&refused(&[(
        RefusalCode::ParameterOutOfLimits,
        ParameterId::CuttingGain,
    )]));
    assert_eq!(state.notes[force], RowNote::Refused("refused with others, see below"));
    let why = RefusalCode::ParameterOutOfLimits.message();
    assert_eq!(state.notes[gain], RowNote::Refused(why));
}
