//! Devices that open, devices that are refused, and the report of `rt-core devices`.

use fake_haply::{Server, Service, Wrong};
use stylet_hw::Severity;
use stylet_hw::haply::{Wanted, diagnose};

use super::threads::{config, open, refused};
use crate::driven::{LONG, drive, until};
use stylet_hw::{Device, Wrench};

#[test]
fn only_the_first_message_sets_axes_and_origin() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(drive(&mut device, &Wrench::zero(), Result::is_ok));
    let state = service.state();
    assert_eq!(state.session["basis"]["permutation"], "XYZ");
    assert_eq!(state.session["profile"]["required_version"], ">=3.5");
    assert_eq!(state.preset, "arm_front_centered");
    assert_eq!(state.wrong_messages, 0);
    drop(state);
    let text = device.description().to_string();
    assert!(
        text.contains("Haply Inverse3 049D") && text.contains("service 3.5.0.0"),
        "{text}"
    );
    assert!(text.contains("held straight"), "{text}");
}

#[test]
fn unusable_devices_are_refused_with_a_remedy() {
    let service = Service::default();
    let server = Server::start(&service);
    let why = |set: &dyn Fn(&mut fake_haply::State)| {
        set(&mut service.state());
        let text = refused(config(&server));
        service.state().heal();
        text
    };
    let text = why(&|s| s.version = Some("3.4.9".to_owned()));
    assert!(text.contains("version 3.4.9") && text.contains("update it"), "{text}");
    let text = why(&|s| s.version = Some("4.0.0".to_owned()));
    assert!(text.contains("version 4.0.0"), "{text}");
    let text = why(&|s| s.wrong = Wrong::Unplugged);
    assert!(text.contains("none at all") && text.contains("switch it on"), "{text}");
    let text = why(&|s| s.kind = "minverse".to_owned());
    assert!(text.contains("\"minverse\"") && text.contains("inverse3x"), "{text}");
    let text = why(&|s| s.id = "04\"9D".to_owned());
    assert!(text.contains("no limits are known"), "{text}");
    let text = why(&|s| s.in_use = true);
    assert!(text.contains("in use by another program"), "{text}");
    let text = why(&|s| s.axes = Some("X-YZ".to_owned()));
    assert!(text.contains("another frame (X-YZ)"), "{text}");
    let text = why(&|s| s.wrong = Wrong::Scaled);
    assert!(text.contains("another frame"), "{text}");
    let text = why(&|s| s.wrong = Wrong::Hangs);
    assert!(text.contains("does not send a list of devices"), "{text}");
    let elsewhere = stylet_hw::HaplyConfig {
        service: "ws://192.0.2.1:9".parse().unwrap(),
        ..config(&server)
    };
    assert!(refused(elsewhere).contains("is not on this PC"));
    let text = why(&|s| s.wrong = Wrong::Broken(2));
    assert!(text.contains("does not send a state"), "{text}");
    let other = Wanted::Id("A14".to_owned());
    let text = refused(stylet_hw::HaplyConfig {
        wanted: other,
        ..config(&server)
    });
    assert!(text.contains("no Inverse3 \"A14\", only 049D"), "{text}");
    assert_eq!(service.state().peak_n, 0.0);
    let stopped = config(&server);
    drop(server);
    let text = refused(stopped);
    assert!(
        text.contains("no Inverse service answers") && text.contains("--haply-url"),
        "{text}"
    );
}

#[test]
fn listing_devices_sends_nothing() {
    let service = Service::default();
    let server = Server::start(&service);
    let listed = || diagnose(&config(&server).service);
    let findings = listed();
    assert!(findings.iter().all(|f| f.severity <= Severity::Note), "{findings:#?}");
    let says = |text: &str, severity| listed().iter().any(|f| f.severity == severity && f.what.contains(text));
    assert!(says("service 3.5.0.0 answers", Severity::Good));
    assert!(says("Haply Inverse3 049D: ready", Severity::Good));
    assert!(says("no VerseGrip", Severity::Note));
    service.state().grip = Some([1.0, 0.0, 0.0, 0.0]);
    assert!(!says("no VerseGrip", Severity::Note));
    service.state().version = None;
    assert!(says("does not say its version", Severity::Warning));
    service.state().version = Some("3.1.1".to_owned());
    assert!(says("version 3.1.1", Severity::Problem));
    for (wrong, text, severity) in [
        (Wrong::NotCalibrated, "not calibrated", Severity::Warning),
        (Wrong::NotReady, "not ready", Severity::Warning),
        (Wrong::NoPower, "no power", Severity::Problem),
        (Wrong::Unplugged, "has no Inverse3", Severity::Problem),
    ] {
        service.state().wrong = wrong;
        assert!(says(text, severity), "{wrong:?}: {:#?}", listed());
    }
    assert_eq!(service.state().messages, 0);
}

#[test]
fn a_service_of_an_unknown_version_is_used_with_a_note() {
    let service = Service::default();
    service.state().version = None;
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(device.description().to_string().contains("of an unknown version"));
    assert!(drive(&mut device, &Wrench::zero(), Result::is_ok));
    assert_eq!(device.info().peak_torque_nm, 0.0);
    drop(device);
    assert!(until(LONG, || service.state().force_at_close_n == [0.0; 3]));
}
