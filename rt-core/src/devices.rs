//! `rt-core devices`: every back end, its parts that are present, its report without a force, and missing parts.

use clap::Args;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;
use stylet_hw::backend::{BACKENDS, Backend, BackendKind, forms_of};
use stylet_hw::libhd::diagnose::{self as phantom, Surroundings};
use stylet_hw::{Device, Finding, Severity, SimulatedPhantom, SimulatedPhantomConfig, drd, haply};
use stylet_runtime::device::Libraries;

/// Printed below the list.
const BOTH_HANDS: &str = "--device-2 takes the same names, for the other hand, which holds the ultrasound probe. Both hands cannot hold one \
                          device, and two Phantoms through OpenHaptics are refused.";

/// Time after which a silent driver is abandoned.
const TRIAL_LIMIT: Duration = Duration::from_secs(15);
/// Most devices of one vendor that are queried.
const MAX_DEVICES: u8 = 4;

/// What the list is asked for.
#[derive(Args, Debug)]
pub struct DevicesArgs {
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Look at files and cables only: open no device
    #[arg(long)]
    look_only: bool,
    #[command(flatten)]
    libraries: Libraries,
}

/// One back end.
#[derive(Debug)]
struct Listed {
    /// Forms to write after `--device`.
    forms: Vec<String>,
    help: &'static str,
    /// The back end was never tested on a real device.
    untried: bool,
    /// A run can use it now.
    usable: bool,
    findings: Vec<Finding>,
}

/// Prints the list; returns 0.
pub fn run(args: &DevicesArgs) -> u8 {
    let libraries = args.libraries.clone().or_of_environment();
    let listed: Vec<_> = BACKENDS
        .iter()
        .map(|b| list(b, Path::new("/"), &libraries, !args.look_only))
        .collect();
    if args.json {
        println!(
            "{:#}",
            json!({ "devices": listed.iter().map(as_json).collect::<Vec<_>>() })
        );
    } else {
        listed.iter().for_each(|l| println!("{}", text(l)));
        println!("{BOTH_HANDS}");
    }
    0
}

fn list(backend: &Backend, root: &Path, libraries: &Libraries, try_it: bool) -> Listed {
    let findings = match backend.kind {
        BackendKind::Simulated => simulated(),
        BackendKind::Phantom => phantom(root, libraries.libhd.as_deref(), try_it),
        BackendKind::Replay => vec![finding(
            Severity::Note,
            "needs the file of a motion",
            "host-ui record --out S.mcap, then host-ui export S.mcap --motion FILE",
        )],
        BackendKind::ForceDimension => force_dimension(root, libraries.libdrd.as_deref(), try_it),
        BackendKind::Haply => inverse3(libraries, try_it),
    };
    // A note concerns another device of the vendor.
    let usable = findings.iter().all(|f| f.severity != Severity::Problem)
        && findings.iter().any(|f| f.severity == Severity::Good);
    Listed {
        forms: forms_of(backend),
        help: backend.help,
        untried: backend.untried,
        usable,
        findings,
    }
}

fn simulated() -> Vec<Finding> {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    let (severity, what) = match device.read(1e-3) {
        Ok(_) => (Severity::Good, "ready".to_owned()),
        Err(why) => (Severity::Problem, why.to_string()),
    };
    vec![finding(severity, what, "")]
}

fn phantom(root: &Path, library: Option<&Path>, try_it: bool) -> Vec<Finding> {
    let (here, api) = Surroundings::of_this_process(library);
    let mut findings = phantom::diagnose(root, &here);
    if let Some(api) = api.filter(|_| try_it) {
        findings.extend(within_limit(move || phantom::of_device(&api, None)));
    }
    findings
}

fn force_dimension(root: &Path, library: Option<&Path>, try_it: bool) -> Vec<Finding> {
    let api = drd::Api::load(library);
    let mut findings = drd::diagnose(root, &api);
    if let Some(api) = api.ok().filter(|_| try_it) {
        findings.extend(within_limit(move || {
            let count = drd::device_count(&api).clamp(1, MAX_DEVICES);
            (0..count).flat_map(|number| drd::of_device(&api, number)).collect()
        }));
    }
    findings
}

fn finding(severity: Severity, what: impl Into<String>, cure: &str) -> Finding {
    Finding {
        severity,
        what: what.into(),
        cure: cure.to_owned(),
    }
}

/// Examines the service, which owns the device: files and cables alone show nothing.
fn inverse3(libraries: &Libraries, try_it: bool) -> Vec<Finding> {
    match libraries.inverse_service() {
        Ok(service) if try_it => within_limit(move || haply::diagnose(&service)),
        Ok(service) => vec![finding(
            Severity::Note,
            format!("the Inverse service at {service} was not asked"),
            "rt-core devices without --look-only asks it",
        )],
        Err(why) => vec![finding(
            Severity::Problem,
            why.to_string(),
            "correct --haply-url, or the variable STYLET_HAPLY_URL",
        )],
    }
}

/// Returns the findings of the trial, or that the driver does not answer; its thread is then abandoned.
fn within_limit(trial: impl FnOnce() -> Vec<Finding> + Send + 'static) -> Vec<Finding> {
    let (found, findings) = mpsc::channel();
    std::thread::spawn(move || {
        // The receiver may have given up.
        let _ = found.send(trial());
    });
    findings.recv_timeout(TRIAL_LIMIT).unwrap_or_else(|_| {
        vec![finding(
            Severity::Problem,
            "the driver does not answer",
            "check the device's power and cable, then try again",
        )]
    })
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Good => "good",
        Severity::Note => "note",
        Severity::Warning => "warning",
        Severity::Problem => "missing",
    }
}

fn as_json(l: &Listed) -> Value {
    let finding = |f: &Finding| json!({ "severity": word(f.severity), "what": f.what, "cure": f.cure });
    let findings: Vec<Value> = l.findings.iter().map(finding).collect();
    json!({ "forms": l.forms, "help": l.help, "untried": l.untried, "usable": l.usable, "findings": findings })
}

fn text(listed: &Listed) -> String {
    let state = if listed.usable {
        "can be used"
    } else {
        "cannot be used now"
    };
    let mut out = format!("--device {}: {state}\n  {}\n", listed.forms.join(" or "), listed.help);
    if listed.untried {
        out += "  Not tried on the device: Stylet's tests have only a fake of its driver.\n";
    }
    for f in &listed.findings {
        out += &format!("  {:<8} {}\n", word(f.severity), f.what);
        if !f.cure.is_empty() {
            out += &format!("  {:<8} -> {}\n", "", f.cure);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_hw::backend::Argument;

    fn nowhere() -> Libraries {
        Libraries {
            libhd: Some("/nonexistent/libHD.so".into()),
            libdrd: Some("/nonexistent/libdrd.so".into()),
            haply_url: Some("ws://127.0.0.1:1".into()),
        }
    }

    #[test]
    fn every_back_end_is_listed_with_its_forms_and_test_status() {
        let root = Path::new("/nonexistent");
        for backend in BACKENDS {
            let listed = list(backend, root, &nowhere(), true);
            let text = text(&listed);
            println!("{text}");
            assert!(listed.forms.iter().all(|form| text.contains(form.as_str())), "{text}");
            assert_eq!(text.contains("Not tried on the device"), backend.untried, "{text}");
            assert!(!listed.findings.is_empty());
            let needs_nothing = backend.simulated && !matches!(backend.argument, Argument::Required(_));
            assert_eq!(listed.usable, needs_nothing, "{text}");
        }
    }

    #[test]
    fn a_missing_library_is_said_with_what_to_do() {
        let root = Path::new("/nonexistent");
        let backend = BACKENDS.iter().find(|b| b.kind == BackendKind::ForceDimension);
        let text = text(&list(backend.expect("listed"), root, &nowhere(), true));
        assert!(text.contains("missing  /nonexistent/libdrd.so: "), "{text}");
        assert!(
            text.contains("--libdrd") && text.contains("cannot be used now"),
            "{text}"
        );
    }

    #[test]
    fn a_missing_service_is_reported_with_a_remedy_unless_only_looking() {
        let backend = BACKENDS.iter().find(|b| b.kind == BackendKind::Haply).expect("listed");
        let listed = |libraries: &Libraries, try_it| text(&list(backend, Path::new("/nonexistent"), libraries, try_it));
        let asked = listed(&nowhere(), true);
        assert!(
            asked.contains("missing  no Inverse service answers at ws://127.0.0.1:1"),
            "{asked}"
        );
        assert!(asked.contains("systemctl start haply-inverse-service"), "{asked}");
        assert!(listed(&nowhere(), false).contains("was not asked"));
        let misspelt = Libraries {
            haply_url: Some("localhost".into()),
            ..nowhere()
        };
        assert!(listed(&misspelt, true).contains("STYLET_HAPLY_URL"));
    }
}
