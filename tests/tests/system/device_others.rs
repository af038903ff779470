//! The core with devices of other vendors, as whole processes: each over its fake, whose hand the test moves.

use fake_drd::control::{VARIABLE, put};
use fake_drd::{Block, Control};
use fake_haply::{Server, Service, Wrong};
use nalgebra::Vector3;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::default_plan;
use stylet_shm_schema::{EventKind, Fault, Request, flags};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, scratch, until};

const LONG: Duration = Duration::from_secs(20);
const STEP_M: f64 = 5e-5;

/// A fake device.
trait Led {
    /// Moves the hand to this offset to the right, up and away from the origin, m.
    fn hold(&self, place_m: [f64; 3]);
    /// Returns the driver's force for the motors, N.
    fn commanded_n(&self) -> f64;
    /// Unplugs the cable, or plugs it in.
    fn plug(&self, plugged: bool);
}

impl Led for Service {
    fn hold(&self, [right, up, away]: [f64; 3]) {
        self.state().tip_m = [right, away, up];
    }

    fn commanded_n(&self) -> f64 {
        Vector3::from(self.state().force_n).norm()
    }

    fn plug(&self, plugged: bool) {
        self.state().wrong = if plugged { Wrong::Nothing } else { Wrong::Unplugged };
    }
}

impl Led for &'static Control {
    fn hold(&self, [right, up, away]: [f64; 3]) {
        for (cell, m) in self.tip_m.iter().zip([-away, right, up]) {
            put(cell, m);
        }
    }

    fn commanded_n(&self) -> f64 {
        Vector3::from(Control::commanded_n(self)).norm()
    }

    fn plug(&self, plugged: bool) {
        self.unplugged.store(u32::from(!plugged), Relaxed);
    }
}

/// The host is dropped before its core.
struct Rig<L: Led> {
    link: Link,
    core: Core,
    device: L,
    /// Origin of the device in the scene.
    origin_m: Vector3<f64>,
    /// Position of the hand from there.
    hand_m: Vector3<f64>,
}

impl<L: Led> Rig<L> {
    fn start(options: &[&str], variables: &[(&str, &str)], device: L) -> Self {
        let mut core = Core::start_in(&[&["--rt-if-allowed"], options].concat(), variables);
        let mut link = core.host();
        assert!(until(LONG, || {
            link.poll();
            link.state().is_some_and(|s| s.tick > 10)
        }));
        let state = *link.state().expect("live");
        // While the core locks its memory a servo thread may stall for longer than its driver's watchdog: the operator
        // arms.
        println!("at the start: {:?}", Fault::from_number(state.fault));
        assert_eq!(state.flags & flags::SIMULATED_DEVICE, 0);
        let origin_m = Vector3::from(state.tip_in_scene_m);
        Self {
            link,
            core,
            device,
            origin_m,
            hand_m: Vector3::zeros(),
        }
    }

    fn hold(&mut self, place_m: Vector3<f64>) {
        self.hand_m = place_m;
        self.device.hold([-place_m.x, place_m.y, place_m.z]);
    }

    /// Moves the hand there and waits until the core has seen it: scene z is away from the operator, scene x to the
    /// left.
    fn lead(&mut self, to_m: [f64; 3]) {
        let goal = Vector3::from(to_m) - self.origin_m;
        while (goal - self.hand_m).norm() > 0.0 {
            let left = goal - self.hand_m;
            let step = left * (STEP_M / left.norm()).min(1.0);
            self.hold(if left.norm() <= STEP_M {
                goal
            } else {
                self.hand_m + step
            });
            std::thread::sleep(Duration::from_millis(1));
            self.link.poll();
        }
        assert!(
            until(LONG, || {
                self.link.poll();
                let tip = Vector3::from(self.link.state().expect("live").tip_in_scene_m);
                (tip - Vector3::from(to_m)).norm() < 1e-6
            }),
            "the core sees the hand"
        );
    }

    fn waits_for(&mut self, ready: impl Fn(&Self) -> bool) -> bool {
        until(LONG, || {
            self.link.poll();
            ready(self)
        })
    }

    fn fault(&self) -> Fault {
        Fault::from_number(self.link.state().expect("live").fault).expect("a known fault")
    }

    fn engage(&mut self) {
        let mut armed = false;
        let engaged = until(LONG, || {
            armed |= ask(&mut self.link, &Request::Engage).is_ok();
            self.link.poll();
            self.link
                .state()
                .is_some_and(|s| s.fault == 0 && s.flags & flags::ENGAGED != 0)
        });
        assert!(engaged, "{armed} {:?}", self.fault());
    }

    /// Inserts into the membrane, unplugs there, plugs in again and lets the operator arm.
    fn run(mut self, name: &str, peak_n: f64) -> L {
        assert!(self.link.session().expect("live").device.read().contains(name));
        let plan = default_plan(&self.link.scene().expect("live").header);
        let deepest_m = plan.seeds_m[0];
        let inside_m = Vector3::from(plan.entry_m).lerp(&Vector3::from(deepest_m), 0.3).into();
        self.engage();
        self.lead(plan.entry_m);
        self.lead(inside_m);
        assert!(
            self.waits_for(|rig| rig.device.commanded_n() > 0.3),
            "the tissue resists"
        );
        assert!(self.device.commanded_n() <= peak_n * (1.0 + 1e-9));

        self.device.plug(false);
        assert!(
            self.waits_for(|rig| rig.fault() == Fault::DeviceLost),
            "{:?}",
            self.fault()
        );
        assert!(self.waits_for(|rig| {
            let state = rig.link.state().expect("live");
            state.force_on_hand_n == [0.0; 3] && state.flags & flags::ENGAGED == 0
        }));
        let said = |rig: &Self| {
            rig.link
                .events()
                .iter()
                .any(|e| e.kind == EventKind::FaultRaised as u32)
        };
        assert!(self.waits_for(said), "the screen says why");

        self.device.plug(true);
        let entry_m = Vector3::from(plan.entry_m) - self.origin_m;
        self.hold(entry_m);
        assert!(self.waits_for(|rig| {
            let tip = Vector3::from(rig.link.state().expect("live").tip_in_scene_m);
            (tip - rig.origin_m - entry_m).norm() < 1e-6
        }));
        assert_eq!(self.device.commanded_n(), 0.0, "no force before it is armed again");
        self.engage();
        self.lead(inside_m);
        assert!(self.waits_for(|rig| rig.device.commanded_n() > 0.3), "felt again");
        drop(self.link);
        self.core.finish();
        self.device
    }
}

#[test]
fn a_run_with_an_inverse3_is_felt_is_lost_and_comes_back() {
    where_the_machine_runs(|| {
        let service = Service::default();
        let server = Server::start(&service);
        let options = ["--device", "haply:049D", "--haply-url", &server.url()];
        let rig = Rig::start(&options, &[], service);
        let state = rig.run("Haply Inverse3", 2.0);
        let state = state.state();
        assert_eq!(state.force_at_close_n, [0.0; 3]);
        assert_eq!((state.wrong_messages, state.out_of_turn), (0, 0));
        assert!(state.peak_n <= 2.0 * (1.0 + 1e-9), "{} N", state.peak_n);
    });
}

#[test]
fn a_run_with_an_omega_is_felt_is_lost_and_comes_back() {
    where_the_machine_runs(|| {
        let file = scratch("omega").join("control");
        let control = Control::in_file(&file);
        let library = fake_control::library("libfake_drd.so");
        let variables = [
            (VARIABLE, file.to_str().expect("a path in UTF-8")),
            ("STYLET_LIBDRD", library.to_str().expect("a path in UTF-8")),
        ];
        let rig = Rig::start(&["--device", "force-dimension"], &variables, control);
        let control = rig.run("Force Dimension omega.7", 12.0);
        assert_eq!(control.non_finite_forces.load(Relaxed), 0);
        assert_eq!(fake_drd::control::get(&control.force_at_stop_n), 0.0);
        assert_eq!(control.commanded_n(), [0.0; 3]);
    });
}

#[test]
fn the_list_names_the_service_that_the_variable_gives_with_its_device() {
    let service = Service::default();
    let server = Server::start(&service);
    let output = std::process::Command::new(stylet_tests::program("rt-core"))
        .arg("devices")
        .env("STYLET_HAPLY_URL", server.url())
        .output()
        .expect("rt-core starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let haply = text
        .split("--device ")
        .find(|part| part.starts_with("haply"))
        .expect("listed");
    assert!(
        haply.contains("can be used") && haply.contains("service 3.5.0.0 answers"),
        "{text}"
    );
    assert!(haply.contains("Haply Inverse3 049D: ready"), "{text}");
    drop(server);
    assert_eq!(service.state().messages, 0, "nothing was sent to the device");
}
