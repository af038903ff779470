//! Every finding over a faked root.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

use super::*;
use crate::finding::Severity;
use crate::library::LoadFailure;

const MODES: &str = "proc/sys/dev/parport/parport0/modes";

struct Faked {
    root: tempfile::TempDir,
    here: Surroundings,
}

impl Faked {
    /// Creates a PC with everything that a Premium needs.
    fn fit() -> Self {
        let faked = Self {
            root: tempfile::tempdir().unwrap(),
            here: Surroundings {
                user: 1000,
                groups: vec![],
                home: Some(PathBuf::from("/home/someone")),
                gtdd_home: None,
                library: Ok(()),
            },
        };
        faked.write(MODES, "PCSPP,TRISTATE,EPP\n");
        faked.write(
            "proc/modules",
            "parport_pc 40960 0 - Live 0x0\nppdev 24576 0 - Live 0x0\n",
        );
        faked.write("dev/parport0", "");
        faked.mode("dev/parport0", 0o666);
        faked.link("dev/phnepp", "/dev/parport0");
        faked.link("dev/phnepp_modes", "/proc/sys/dev/parport/parport0/modes");
        faked
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.path().join(path)
    }

    fn write(&self, path: &str, text: &str) {
        fs::create_dir_all(self.path(path).parent().unwrap()).unwrap();
        fs::write(self.path(path), text).unwrap();
    }

    fn mode(&self, path: &str, mode: u32) {
        fs::set_permissions(self.path(path), fs::Permissions::from_mode(mode)).unwrap();
    }

    fn link(&self, path: &str, target: &str) {
        let _ = fs::remove_file(self.path(path));
        symlink(target, self.path(path)).unwrap();
    }

    fn remove(&self, path: &str) {
        fs::remove_file(self.path(path)).unwrap();
    }

    fn findings(&self) -> Vec<Finding> {
        diagnose(self.root.path(), &self.here)
    }

    /// Expects one finding worse than good that contains `word`.
    #[track_caller]
    fn bad(&self, severity: Severity, word: &str, cure: &str) {
        let all = self.findings();
        let about: Vec<_> = all
            .iter()
            .filter(|f| f.severity > Severity::Good && f.what.contains(word))
            .collect();
        assert_eq!(about.len(), 1, "{word}: {all:#?}");
        assert_eq!(about[0].severity, severity, "{about:?}");
        assert!(about[0].cure.contains(cure), "{about:?}");
    }
}

fn failed(why: LoadFailure) -> LoadError {
    LoadError {
        driver: "OpenHaptics",
        tried: vec![(PathBuf::from("libHD.so"), why)],
    }
}

fn load_error(why: &str) -> LoadError {
    failed(LoadFailure::Loader(why.to_owned()))
}

#[test]
fn a_complete_pc_has_no_findings() {
    for finding in Faked::fit().findings() {
        assert_eq!(
            (finding.severity, finding.cure.as_str()),
            (Severity::Good, ""),
            "{finding:?}"
        );
    }
    assert_eq!(Faked::fit().findings().len(), 5, "library, mode, port, two links");
}

#[test]
fn the_port_mode_must_be_plain_epp() {
    let faked = Faked::fit();
    faked.write(MODES, "PCSPP,TRISTATE,EPP,ECP\n");
    faked.bad(Severity::Warning, "mixed mode", "not ECP+EPP");
    faked.write(MODES, "PCSPP,TRISTATE\n");
    faked.bad(Severity::Problem, "without EPP", "BIOS");
}

#[test]
fn without_a_parallel_port_its_links_are_not_reported() {
    let faked = Faked::fit();
    faked.remove(MODES);
    faked.bad(Severity::Note, "no parallel port", "modprobe parport_pc");
    assert_eq!(faked.findings().len(), 2, "library and port");
}

#[test]
fn a_printer_driver_on_the_port_is_named() {
    let faked = Faked::fit();
    faked.write("proc/modules", "lp 20480 0 - Live 0x0\n");
    faked.bad(Severity::Warning, "printer driver lp", "rmmod lp");
    faked.write("proc/modules", "lpc_ich 28672 0 - Live 0x0\n");
    assert!(
        faked.findings().iter().all(|f| f.severity == Severity::Good),
        "another module"
    );
}

#[test]
fn missing_and_wrong_links_are_reported_with_the_command() {
    let faked = Faked::fit();
    faked.remove("dev/phnepp");
    faked.bad(
        Severity::Problem,
        "/dev/phnepp is missing",
        "ln -sfn /dev/parport0 /dev/phnepp;",
    );
    let faked = Faked::fit();
    faked.link("dev/phnepp_modes", "/proc/elsewhere");
    faked.bad(
        Severity::Problem,
        "points to /proc/elsewhere",
        "ln -sfn /proc/sys/dev/parport/parport0/modes",
    );
}

#[test]
fn a_port_without_access_names_its_group() {
    let mut faked = Faked::fit();
    let group = fs::metadata(faked.path("dev/parport0")).unwrap().gid();
    faked.write("etc/group", &format!("other:x:{}:\nlp:x:{group}:\n", group + 1));
    faked.mode("dev/parport0", 0o660);
    // The user who runs the test owns the file, so the faked user must be another.
    faked.here.user = fs::metadata(faked.path("dev/parport0")).unwrap().uid() + 1;
    faked.bad(Severity::Problem, "cannot be read and written", "usermod -aG lp");
    faked.mode("dev/parport0", 0o640);
    faked.bad(Severity::Problem, "cannot be read and written", "chmod g+rw");
    faked.mode("dev/parport0", 0o660);
    faked.here.groups = vec![group];
    assert!(faked.findings().iter().all(|f| f.severity == Severity::Good));
    faked.remove("dev/parport0");
    faked.bad(Severity::Problem, "/dev/parport0 is missing", "modprobe ppdev");
}

#[test]
fn usb_and_firewire_ports_are_checked_if_present() {
    let mut faked = Faked::fit();
    for name in ["raw1394", "fw0", "ttyACM0"] {
        faked.write(&format!("dev/{name}"), "");
        faked.mode(&format!("dev/{name}"), 0o600);
        faked.here.user = fs::metadata(faked.path("dev/parport0")).unwrap().uid() + 1;
        faked.bad(Severity::Problem, &format!("/dev/{name} "), "chmod g+rw");
    }
    faked.write("dev/fwsomething", "");
    assert!(faked.findings().iter().all(|f| !f.what.contains("fwsomething")));
}

#[test]
fn a_touch_on_hidraw_must_be_usable() {
    let faked = Faked::fit();
    let id = |id: &str| {
        let event = format!("DRIVER=hid-generic\nHID_ID={id}\n");
        faked.write("sys/class/hidraw/hidraw3/device/uevent", &event);
    };
    id("0003:0000046D:0000C31C");
    assert!(faked.findings().iter().all(|f| !f.what.contains("hidraw3")));
    id("0003:00002988:00000302");
    faked.bad(Severity::Problem, "/dev/hidraw3 ", "ATTRS{idVendor}==\"2988\"");
    faked.write("dev/hidraw3", "");
    assert!(faked.findings().iter().all(|f| f.severity == Severity::Good));
    assert!(faked.findings().iter().any(|f| f.what.contains("/dev/hidraw3 can be")));
}

#[test]
fn each_missing_library_is_named_with_its_remedy() {
    let missing = |name: &str| format!("{name}: cannot open shared object file: No such file or directory");
    for (why, cure) in [
        (missing("libHD.so"), "install OpenHaptics"),
        (missing("libPHANToMIO.so.4"), "PHANTOM Device Drivers"),
        (missing("libPhantomIOLib42.so"), "Touch Device Driver"),
        (missing("libncurses.so.5"), "libncurses5"),
        (missing("libtinfo.so.5"), "libtinfo5"),
        (missing("libraw1394.so.8"), "libraw1394-11"),
        (missing("libblkid.so.1"), "libblkid1"),
        (missing("libuuid.so.1"), "libuuid1"),
        (missing("libsomething.so.9"), "install what the message names"),
        ("libHD.so: wrong ELF class: ELFCLASS32".to_owned(), "64 bit"),
        (
            "libHD.so: cannot open shared object file: Permission denied".to_owned(),
            "chmod",
        ),
    ] {
        let mut faked = Faked::fit();
        faked.here.library = Err(load_error(&why));
        faked.bad(Severity::Problem, &why, cure);
    }
}

#[test]
fn a_library_without_a_function_is_not_openhaptics() {
    let mut faked = Faked::fit();
    let failure = LoadFailure::Incomplete(vec!["hdInitDevice", "hdGetError"]);
    faked.here.library = Err(failed(failure));
    faked.bad(
        Severity::Problem,
        "libHD.so: another version, or another library: it lacks hdInitDevice, hdGetError",
        "again",
    );
}

#[test]
fn the_touch_driver_needs_its_folder_and_a_paired_device() {
    let mut faked = Faked::fit();
    faked.write("usr/lib/libPhantomIOLib42.so", "");
    faked.bad(Severity::Problem, "GTDD_HOME is not set", "/etc/environment");
    faked.here.gtdd_home = Some(PathBuf::from("/usr/share/3DSystems"));
    faked.bad(Severity::Warning, "/usr/share/3DSystems/config holds no", "Touch_Setup");
    faked.write("usr/share/3DSystems/config/Default Device.config", "");
    assert!(faked.findings().iter().all(|f| f.severity == Severity::Good));
    faked.here.gtdd_home = None;
    faked.write("home/someone/.3dsystems/config/readme", "");
    faked.bad(
        Severity::Warning,
        "/home/someone/.3dsystems/config holds no",
        "Touch_Setup",
    );
}

#[test]
fn a_missing_library_is_reported_with_the_loader_s_message() {
    let (here, api) = Surroundings::of_this_process(Some(Path::new("/nonexistent/libHD.so")));
    assert!(api.is_none());
    let text = here.library.unwrap_err().to_string();
    assert!(
        text.contains("/nonexistent/libHD.so: cannot open shared object file"),
        "{text}"
    );
}
