//! Checks that no loop's priority can starve another loop on the same core.

use super::{Asked, OptionsError, OptionsProblem};
use crate::process::Options;
use stylet_shm_schema::ProblemList;

/// Refuses priorities that let a loop starve another on a shared core. Order: force loop, second device, tissue.
/// Without real-time scheduling every priority passes.
pub(super) fn check(options: &Options) -> Result<(), OptionsError> {
    if options.no_rt {
        return Ok(());
    }
    let force = Asked {
        name: "the force loop",
        core: options.haptic_core,
        priority: options.haptic_priority,
        option: "--haptic-priority",
    };
    let second = options.second.as_ref().map(|second| Asked {
        name: "the loop of the second device",
        core: second.core,
        priority: second.priority,
        option: "--device-2-priority",
    });
    let tissue = Asked {
        name: "the tissue step",
        core: options.tissue_core,
        priority: options.tissue_priority,
        option: "--tissue-priority",
    };
    let pairs = [
        Some((force, tissue)),
        second.map(|second| (force, second)),
        second.map(|second| (second, tissue)),
    ];
    let problems = pairs.into_iter().flatten();
    ProblemList::check(problems.filter_map(|(first, other)| problem(first, other)).collect())
}

/// Returns the problem if `other` can keep `first` from their shared core.
fn problem(first: Asked, other: Asked) -> Option<OptionsProblem> {
    let core = first.core.filter(|core| other.core == Some(*core))?;
    (other.priority >= first.priority).then_some(OptionsProblem::Starves { core, first, other })
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
        let problems = check(&options).err().map_or(Vec::new(), |problems| problems.0);
        problems.iter().map(ToString::to_string).collect()
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
