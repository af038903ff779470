//! Small control payloads of both sides of the relay: signs of life, missing records, members.

use bytemuck::{Pod, Zeroable};
use stylet_shm_schema::check::Invalid;
use stylet_shm_schema::{Class, ClassMember, MAX_CLASS};

/// A member's sign of life, twenty times a second.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Hello {
    /// Changes after each silence: the whole state is then sent again.
    pub epoch: u64,
    /// The scene that the member has: run of the core.
    pub scene_session: u64,
    /// The scene that the member has: its generation.
    pub scene_generation: u64,
    /// Round trip as measured by the member.
    pub round_trip_ns: u64,
    /// Records that the member lost for good.
    pub lost: u64,
}

/// Ticks of one run of the core, first to last inclusive.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Ticks {
    /// The run of the core.
    pub session_id: u64,
    /// First tick.
    pub from: u64,
    /// Last tick.
    pub to: u64,
}

/// Encodes the connected members, without the unused places of the list.
pub fn class_bytes(class: &Class) -> &[u8] {
    let unused = size_of::<ClassMember>() * (MAX_CLASS - class.members().len());
    let all = bytemuck::bytes_of(class);
    &all[..all.len() - unused]
}

/// Decodes the connected members.
pub fn class_of(body: &[u8]) -> Result<Class, Invalid> {
    let mut class = Class::zeroed();
    let filled = bytemuck::bytes_of_mut(&mut class).get_mut(..body.len());
    filled.ok_or(Invalid("list of members"))?.copy_from_slice(body);
    Ok(class)
}

/// Formats the connected members for a terminal, one line each.
pub fn class_words(class: &Class) -> String {
    let (operator, asked) = (class.operator.read(), class.asked.read());
    let or = |word: String, other: &str| if word.is_empty() { other.to_owned() } else { word };
    let mut lines = vec![format!("operates: {}", or(operator, "nobody"))];
    lines.extend((!asked.is_empty()).then(|| format!("asks to operate: {asked}")));
    lines.extend(class.members().iter().map(|member| {
        format!(
            "{} ({}): round trip {:.1} ms, {} records lost, heard {:.0} ms ago",
            member.name.read(),
            or(member.role.read(), "revoked"),
            member.round_trip_ns as f64 * 1e-6,
            member.records_lost,
            member.silent_ns as f64 * 1e-6
        )
    }));
    lines.extend((class.unlisted > 0).then(|| format!("and {} more", class.unlisted)));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::Text;

    #[test]
    fn a_class_survives_and_its_revoked_and_unlisted_members_are_named() {
        let mut class = Class::zeroed();
        (class.count, class.unlisted, class.operator) = (2, 8, Text::new("Otto"));
        (class.members[0].name, class.members[0].role) = (Text::new("Otto"), Text::new("operator"));
        (class.members[1].name, class.members[1].round_trip_ns) = (Text::new("Ina"), 1_500_000);
        let bytes = class_bytes(&class);
        assert!(bytes.len() < size_of::<Class>() / 2);
        let words = class_words(&class_of(bytes).expect("valid"));
        assert!(words.starts_with("operates: Otto\nOtto (operator): "), "{words}");
        assert!(
            words.contains("Ina (revoked): round trip 1.5 ms") && words.ends_with("and 8 more"),
            "{words}"
        );
        assert!(class_of(&[0; size_of::<Class>() + 1]).is_err());
    }
}
