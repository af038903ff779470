//! Parts of a state one after the other as bytes: for flight recordings.

/// Returns the size of all of them, in bytes.
pub(super) fn len(parts: &[&[u8]]) -> usize {
    parts.iter().map(|part| part.len()).sum()
}

/// Writes them; nothing where `to` has another length.
pub(super) fn save(parts: &[&[u8]], to: &mut [u8]) {
    if to.len() != len(parts) {
        return;
    }
    let mut rest = to;
    for part in parts {
        let (here, after) = rest.split_at_mut(part.len());
        here.copy_from_slice(part);
        rest = after;
    }
}

/// Takes them up; nothing where `from` has another length, and then false.
pub(super) fn load(parts: &mut [&mut [u8]], from: &[u8]) -> bool {
    if from.len() != parts.iter().map(|part| part.len()).sum::<usize>() {
        return false;
    }
    let mut rest = from;
    for part in parts {
        let (here, after) = rest.split_at(part.len());
        part.copy_from_slice(here);
        rest = after;
    }
    true
}
