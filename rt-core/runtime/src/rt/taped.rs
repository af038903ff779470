//! Serialises arrays of mostly zeros for a flight recording: the other values, each with its place.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Every value but zeros, bit for bit.
pub fn serialize<const N: usize, S: Serializer>(values: &[f64; N], to: S) -> Result<S::Ok, S::Error> {
    let placed = (0_u16..).zip(values.iter().copied());
    let others: Vec<_> = placed.filter(|(_, value)| value.to_bits() != 0).collect();
    others.serialize(to)
}

/// Values outside the array are dropped.
pub fn deserialize<'de, const N: usize, D: Deserializer<'de>>(from: D) -> Result<[f64; N], D::Error> {
    let mut values = [0.0; N];
    for (place, value) in Vec::<(u16, f64)>::deserialize(from)? {
        if let Some(slot) = values.get_mut(usize::from(place)) {
            *slot = value;
        }
    }
    Ok(values)
}
