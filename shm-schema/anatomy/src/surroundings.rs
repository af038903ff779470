//! Support of a body, face by face.

use serde::{Deserialize, Serialize};

/// Medium beyond an outer face of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Beyond {
    /// Soft tissue that the scene omits: its layers, of which the outermost is fixed.
    #[default]
    Fat,
    /// Air: skin, or the inside of an empty rectum.
    Free,
    /// Bone, or a table: the face does not move.
    Fixed,
}

impl Beyond {
    /// All media in the order of their numbers on the wire.
    pub const ALL: [Self; 3] = [Self::Fat, Self::Free, Self::Fixed];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fat => "fat",
            Self::Free => "free",
            Self::Fixed => "fixed",
        }
    }

    /// Returns the medium of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|beyond| beyond.name() == name)
    }
}

/// Layer of soft tissue around a body, on the faces that lie on fat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// Thickness, m.
    pub thickness_m: f64,
    /// Young's modulus, Pa.
    pub young_pa: f64,
}

impl Layer {
    /// Most layers around a body.
    pub const MOST: usize = 4;
    /// Least and largest thickness, m.
    pub const THICKNESS_M: [f64; 2] = [1e-3, 0.1];
    /// Least and largest Young's modulus, Pa.
    pub const YOUNG_PA: [f64; 2] = [100.0, 1e8];
    /// Fat between the gland and the pelvis, which does not move (assumed).
    pub const FAT: Self = Self {
        thickness_m: 20e-3,
        young_pa: 5e3,
    };

    /// Returns whether both values are within their limits.
    pub fn is_valid(&self) -> bool {
        let within = |value: f64, [least, most]: [f64; 2]| (least..=most).contains(&value);
        within(self.thickness_m, Self::THICKNESS_M) && within(self.young_pa, Self::YOUNG_PA)
    }
}

/// Media beyond the faces of a structure towards -x, +x, -y, +y, -z and +z, where these are outer faces of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Surroundings(pub [Beyond; 6]);

impl Surroundings {
    /// Fat on all sides.
    pub const FAT: Self = Self([Beyond::Fat; 6]);

    /// The same medium on all sides.
    pub const fn all(beyond: Beyond) -> Self {
        Self([beyond; 6])
    }

    /// Encodes two bits for each face, the first lowest.
    pub fn to_wire(self) -> u32 {
        let bits = |(face, beyond): (usize, Beyond)| (beyond as u32) << (2 * face);
        self.0.into_iter().enumerate().map(bits).sum()
    }

    /// Decodes; `None` for an unknown number.
    pub fn of_wire(bits: u32) -> Option<Self> {
        let mut faces = [Beyond::Fat; 6];
        for (face, slot) in faces.iter_mut().enumerate() {
            *slot = *Beyond::ALL.get((bits >> (2 * face) & 3) as usize)?;
        }
        (bits >> 12 == 0).then_some(Self(faces))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_face_survives_the_wire_and_what_is_unknown_does_not() {
        for n in 0..3_usize.pow(6) {
            let surroundings = Surroundings(std::array::from_fn(|face| {
                Beyond::ALL[n / 3_usize.pow(face as u32) % 3]
            }));
            assert_eq!(Surroundings::of_wire(surroundings.to_wire()), Some(surroundings));
        }
        assert_eq!(
            Surroundings::of_wire(0),
            Some(Surroundings::FAT),
            "what hosts sent before"
        );
        assert_eq!((Surroundings::of_wire(3), Surroundings::of_wire(1 << 12)), (None, None));
    }
}
