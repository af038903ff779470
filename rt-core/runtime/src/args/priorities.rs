//! Checks that no loop's priority can starve another loop on the same core.

use super::OptionsError;
use crate::process::Options;

/// A loop as requested: its name, core and priority, and the option that sets the priority.
type Asked = (&'static str, Option<usize>, u32, &'static str);

/// Refuses priorities that let a loop starve another on a shared core. Order: force loop, second device, tissue.
/// Without real-time scheduling every priority passes.
pub(super) fn check(options: &Options) -> Result<(), OptionsError> {
    if options.no_rt {
        return Ok(());
    }
    let force = (
        "the force loop",
        options.haptic_core,
        options.haptic_priority,
        "--haptic-priority",
    );
    let second = options.second.as_ref().map(|second| {
        (
            "the loop of the second device",
            second.core,
            second.priority,
            "--device-2-priority",
        )
    });
    let tissue = (
        "the tissue step",
        options.tissue_core,
        options.tissue_priority,
        "--tissue-priority",
    );
    let pairs = [
        Some((force, tissue)),
        second.map(|second| (force, second)),
        second.map(|second| (second, tissue)),
    ];
    let problems: Vec<String> = pairs
        .into_iter()
        .flatten()
        .filter_map(|(first, other)| problem(first, other))
        .collect();
    match problems.is_empty() {
        true => Ok(()),
        false => Err(OptionsError(problems)),
    }
}

/// Returns the problem if `other` can keep `first` from their shared core.
fn problem(first: Asked, other: Asked) -> Option<String> {
    let (name, core, priority, option) = first;
    let (other_name, other_core, other_priority, other_option) = other;
    let core = core.filter(|core| other_core == Some(*core))?;
    (other_priority >= priority).then(|| {
        format!(
            "{other_option} {other_priority}: {other_name} shares core {core} with {name}, which would wait for it; give it less than \
             {option} {priority}, or another core"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::RealTimeArgs;
    use crate::device::DeviceChoice;
    use crate::process::SecondOptions;

    /// Returns the refusal for three loops on one core, with the priorities of force, second device and tissue.
    fn refused([force, second, tissue]: [u32; 3], no_rt: bool) -> Vec<String> {
        let mut args = RealTimeArgs::for_measurement(super::super::cores()[0]);
        args.rt_if_allowed = false;
        let mut options = args.options("t").expect("defaults");
        (options.haptic_priority, options.tissue_priority, options.no_rt) = (force, tissue, no_rt);
        options.tissue_core = options.haptic_core;
        options.second = Some(SecondOptions {
            device: DeviceChoice::default(),
            period_ns: 1_000_000,
            core: options.haptic_core,
            priority: second,
        });
        check(&options).err().map_or(Vec::new(), |problems| problems.0)
    }

    #[test]
    fn no_loop_waits_on_its_core_for_one_that_can_wait() {
        assert!(refused([80, 75, 70], false).is_empty());
        assert_eq!(refused([10, 75, 98], false).len(), 3);
        let same = refused([80, 75, 75], false);
        assert!(same.len() == 1 && same[0].starts_with("--tissue-priority 75: the tissue step shares core"));
        assert!(refused([80, 81, 70], false)[0].starts_with("--device-2-priority 81"));
        assert!(
            refused([10, 75, 98], true).is_empty(),
            "without real time there are none"
        );
    }
}
