//! Serialises types of the shared memory for a flight recording: as bytes, or as stable numbers.

/// Plain old data as its bytes, bit for bit.
pub mod pod {
    use bytemuck::Pod;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    /// The bytes of `value`.
    pub fn serialize<T: Pod, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(bytemuck::bytes_of(value))
    }

    /// Fails if the number of bytes differs.
    pub fn deserialize<'de, T: Pod, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
        let bytes = <&[u8]>::deserialize(from)?;
        bytemuck::try_pod_read_unaligned(bytes)
            .map_err(|_| D::Error::custom("a record of another size: written by another version"))
    }
}

/// A fault as its number.
pub mod fault_code {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use stylet_shm_schema::Fault;

    /// The number of `fault`.
    pub fn serialize<S: Serializer>(fault: &Fault, to: S) -> Result<S::Ok, S::Error> {
        (*fault as u32).serialize(to)
    }

    /// Fails for an unknown number.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Fault, D::Error> {
        let number = u32::deserialize(from)?;
        Fault::from_number(number).ok_or_else(|| D::Error::custom("a fault that is not known"))
    }
}
