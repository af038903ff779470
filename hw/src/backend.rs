//! Names of the back ends: the one table that command lines, scene files and help texts share.

/// A kind of device that can be chosen by name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BackendKind {
    /// A simulated Phantom in the grip of a simulated hand.
    #[default]
    Simulated,
    /// A Phantom through OpenHaptics.
    Phantom,
    /// A recorded motion.
    Replay,
    /// A device of Force Dimension, or a Novint Falcon.
    ForceDimension,
    /// An Inverse3 of Haply.
    Haply,
}

/// Argument that may follow the name, behind a colon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Argument {
    /// Nothing.
    None,
    /// A text, shown under this name in help texts, or nothing.
    Optional(&'static str),
    /// A text, shown under this name in help texts.
    Required(&'static str),
}

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Backend {
    /// Kind of device that the name selects.
    pub kind: BackendKind,
    /// Name in command lines and scene files. Stable, because scene files contain it.
    pub name: &'static str,
    /// Argument that may follow the name.
    pub argument: Argument,
    /// One line for help texts.
    pub help: &'static str,
    /// True if a program, not a device, gives the samples. Both hands can use such a back end at once.
    pub simulated: bool,
    /// True if the back end has run only against a fake of its driver, never on the device.
    pub untried: bool,
}

/// Every back end, the default first.
pub const BACKENDS: &[Backend] = &[
    Backend {
        kind: BackendKind::Simulated,
        name: "simulated",
        argument: Argument::None,
        help: "a simulated Phantom Premium 1.5 in the grip of a simulated hand",
        simulated: true,
        untried: false,
    },
    Backend {
        kind: BackendKind::Phantom,
        name: "phantom",
        argument: Argument::Optional("NAME"),
        help: "a Phantom through OpenHaptics: the driver's default device, or the one called NAME",
        simulated: false,
        untried: true,
    },
    Backend {
        kind: BackendKind::Replay,
        name: "replay",
        argument: Argument::Required("FILE"),
        help: "a recorded motion (from 'host-ui export --motion')",
        simulated: true,
        untried: false,
    },
    Backend {
        kind: BackendKind::ForceDimension,
        name: "force-dimension",
        argument: Argument::Optional("NUMBER"),
        help: "an omega, delta or sigma of Force Dimension, or a Falcon: the first one, or the one with this number, from 0",
        simulated: false,
        untried: true,
    },
    Backend {
        kind: BackendKind::Haply,
        name: "haply",
        argument: Argument::Optional("NUMBER"),
        help: "an Inverse3 of Haply through its Inverse service: the first one, the one with this number, from 0, or with this id",
        simulated: false,
        untried: true,
    },
];

/// A text that names no back end.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is not a device; give {forms}", forms = forms())]
pub struct UnknownBackend(pub String);

/// Returns the back end that `text` names, and the argument behind the colon.
///
/// ```
/// use stylet_hw::backend::{BackendKind, parse};
/// assert_eq!(parse("phantom:Left arm"), Ok((BackendKind::Phantom, Some("Left arm"))));
/// assert!(parse("replay").is_err(), "a file is missing");
/// ```
pub fn parse(text: &str) -> Result<(BackendKind, Option<&str>), UnknownBackend> {
    let (name, argument) = text
        .split_once(':')
        .map_or((text, None), |(name, argument)| (name, Some(argument)));
    let found = BACKENDS.iter().find(|b| b.name == name).filter(|b| match b.argument {
        Argument::None => argument.is_none(),
        Argument::Optional(_) => argument != Some(""),
        Argument::Required(_) => argument.is_some_and(|a| !a.is_empty()),
    });
    found
        .map(|b| (b.kind, argument))
        .ok_or_else(|| UnknownBackend(text.to_owned()))
}

/// Returns every accepted form, for messages.
pub fn forms() -> String {
    let mut forms: Vec<_> = BACKENDS.iter().flat_map(forms_of).collect();
    let last = forms.pop().unwrap_or_default();
    format!("{} or {last}", forms.join(", "))
}

/// Returns the forms of every back end with their help, one per line.
pub fn help() -> String {
    let line = |b: &Backend| format!("{}: {}{}", forms_of(b).join(" or "), b.help, b.untried_text());
    BACKENDS.iter().map(line).collect::<Vec<_>>().join("\n")
}

impl Backend {
    /// Returns the remark of help texts on a back end that is untried on the device; else nothing.
    pub fn untried_text(&self) -> &'static str {
        if self.untried { " (not tried on the device)" } else { "" }
    }
}

/// Returns every accepted form of one back end.
pub fn forms_of(b: &Backend) -> Vec<String> {
    match b.argument {
        Argument::None => vec![b.name.to_owned()],
        Argument::Optional(shown) => vec![b.name.to_owned(), format!("{}:{shown}", b.name)],
        Argument::Required(shown) => vec![format!("{}:{shown}", b.name)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_parse() {
        let mut names: Vec<_> = BACKENDS.iter().map(|b| b.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        for b in BACKENDS {
            let argument = (b.argument != Argument::None).then_some("something");
            let suffix = argument.map_or(String::new(), |a| format!(":{a}"));
            assert_eq!(parse(&format!("{}{suffix}", b.name)), Ok((b.kind, argument)));
        }
    }

    #[test]
    fn the_help_has_a_line_for_every_back_end() {
        let help = help();
        assert_eq!(help.lines().count(), BACKENDS.len());
        assert!(help.contains("phantom or phantom:NAME: a Phantom"), "{help}");
        for (line, b) in help.lines().zip(BACKENDS) {
            assert_eq!(line.ends_with("(not tried on the device)"), b.untried, "{line}");
        }
    }

    #[test]
    fn unknown_names_are_refused_with_every_accepted_form() {
        for wrong in [
            "",
            ":",
            "phantom:",
            "Phantom",
            "simulated:x",
            "replay",
            "replay:",
            "falcon",
        ] {
            assert_eq!(parse(wrong), Err(UnknownBackend(wrong.to_owned())));
        }
        let text = UnknownBackend("falcon".to_owned()).to_string();
        assert!(text.contains("simulated, phantom, phantom:NAME, replay:FILE"), "{text}");
    }
}
