//! Truncated and corrupted files.

use super::super::plan::{PlanSeed, PlanSource, SeedPlan, bytes, of};
use super::super::walk::MAX_DEPTH;
use super::super::{Identity, new_uid};
use super::*;

fn good() -> Vec<u8> {
    let plan = SeedPlan {
        label: "a".to_owned(),
        identity: Identity::new(),
        uid: new_uid(),
        structure_set: None,
        prescription_gy: Some(145.0),
        planned_on: None,
        source: PlanSource {
            model: "6711".to_owned(),
            manufacturer: String::new(),
            isotope: "I-125".to_owned(),
            half_life_days: 59.4,
            active_length_m: 3e-3,
        },
        seeds: vec![PlanSeed {
            needle: Some(1),
            hole: "D4".to_owned(),
            position_m: [0.01, 0.02, 0.03],
            axis: None,
            strength_u: 0.5,
            strength_on: None,
        }],
        notes: Vec::new(),
    };
    bytes(&plan).unwrap()
}

fn why(bytes: &[u8]) -> String {
    read(bytes).map(|o| o.sop_class).expect_err("refused").to_string()
}

#[test]
fn truncated_files_never_panic_and_cut_elements_are_reported() {
    let good = good();
    assert!(read(&good).and_then(|o| of(&o)).is_ok());
    let refused = (0..good.len()).filter(|&n| read(&good[..n]).is_err()).count();
    // Only a cut between two elements of the outermost level goes unnoticed.
    assert!(refused > good.len() * 9 / 10, "{refused} of {}", good.len());
    assert!(why(&good[..good.len() - 3]).contains("truncated"));
    assert!(why(&good[..140]).contains("truncated"));
    assert!(why(b"no").contains("no DICM"));
}

/// Guards against an allocation of four gigabytes: the parser allocates the length that an element
/// claims before it reads.
#[test]
fn a_length_beyond_the_end_is_refused_before_it_is_parsed() {
    let good = good();
    let at = good.windows(6).position(|w| w == b"I-125 ").unwrap();
    let mut long = good.clone();
    long[at - 2..at].copy_from_slice(&0xfff0_u16.to_le_bytes());
    assert!(why(&long).contains("claims 65520 bytes"), "{}", why(&long));
    let sequence = good.windows(2).rposition(|w| w == b"SQ").unwrap();
    let mut nested = good.clone();
    nested[sequence + 4..sequence + 8].copy_from_slice(&0x7fff_fff0_u32.to_le_bytes());
    assert!(why(&nested).contains("claims 2147483632 bytes"), "{}", why(&nested));
}

#[test]
fn sequences_deeper_than_any_plan_has_are_refused() {
    let mut bytes = good();
    let mut deep = Vec::new();
    for _ in 0..MAX_DEPTH + 1 {
        // Private sequence of zero length, item of zero length.
        deep.extend([0xff, 0x7f, 0x10, 0x10, b'S', b'Q', 0, 0, 0xff, 0xff, 0xff, 0xff]);
        deep.extend([0xfe, 0xff, 0x00, 0xe0, 0xff, 0xff, 0xff, 0xff]);
    }
    bytes.extend(deep);
    assert!(why(&bytes).contains("more than 16 deep"), "{}", why(&bytes));
}

#[test]
fn an_old_file_that_begins_with_its_first_element_is_read_too() {
    let good = good();
    let (_, from) = transfer_syntax(&good).unwrap();
    assert_eq!(read(&good[from..]).and_then(|o| of(&o)).unwrap().seeds.len(), 1);
}

#[test]
fn unknown_value_types_and_syntaxes_are_reported() {
    let good = good();
    let mut bent = good.clone();
    let at = good.windows(2).rposition(|w| w == b"DS").unwrap();
    bent[at] = b'!';
    assert!(why(&bent).contains("of a kind that DICOM does not have"));
    let mut foreign = good;
    let uid = b"1.2.840.10008.1.2.1";
    let at = foreign.windows(uid.len()).position(|w| w == uid).unwrap();
    foreign[at + uid.len() - 1] = b'9';
    assert!(why(&foreign).contains("transfer syntax"), "{}", why(&foreign));
}
