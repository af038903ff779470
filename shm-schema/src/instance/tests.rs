//! Owners of an instance, hosts that find it, and its remains.

use super::files::secure_folder;
use super::*;
use std::fs::Permissions;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::PathBuf;

struct Swept(Instance);

impl Drop for Swept {
    fn drop(&mut self) {
        self.0.sweep();
    }
}

fn fresh(name: &str) -> Swept {
    Swept(Instance::new(&format!("{name}-{}", std::process::id())).expect("a name"))
}

#[test]
fn instance_names_are_file_names() {
    assert!(Instance::new("lab-2").is_ok());
    for bad in ["", "../x", "a b", "a_b", "0123456789012345678901234"] {
        assert!(Instance::new(bad).is_err(), "{bad}");
    }
}

#[test]
fn an_instance_has_one_owner() {
    let instance = fresh("owned");
    let owned = instance.0.own().expect("free");
    let Err(InstanceError::Owned { process, .. }) = instance.0.own() else {
        panic!("owned twice")
    };
    assert_eq!(process, std::process::id().to_string());
    drop(owned);
    assert!(instance.0.own().is_ok());
}

#[test]
fn hosts_find_the_announced_epoch_alone() {
    let instance = fresh("epoch");
    let owned = instance.0.own().expect("free");
    let (first, second) = (owned.begin().expect("room"), owned.begin().expect("room"));
    assert_ne!(first, second);
    assert_eq!(instance.0.epoch(), None);
    owned.announce(&first).expect("room");
    second.complain();
    assert!(!owned.hears_complaint(&first) && owned.hears_complaint(&second));
    assert_eq!(instance.0.epoch(), Some(first));
    owned.clear();
    assert_eq!(instance.0.epoch(), None);
    assert!(!second.root().exists());
}

/// A core that was killed used to leave files that kept the next one from starting.
#[test]
fn an_owner_removes_what_a_killed_one_left_and_keeps_other_files() {
    let instance = fresh("killed");
    let folder = instance.0.make_folder().expect("room");
    let token = "0123456789abcdef";
    let object = PathBuf::from(format!("/dev/shm/{}{token}_x", instance.0.prefix()));
    std::fs::create_dir(folder.join(token)).expect("room");
    for file in [&object, &folder.join("current"), &folder.join("plan.toml")] {
        std::fs::write(file, token).expect("room");
    }
    let owned = instance.0.own().expect("free");
    assert!(!object.exists() && !folder.join(token).exists() && instance.0.epoch().is_none());
    assert!(folder.join("plan.toml").exists());
    drop(owned);
    assert!(!folder.exists(), "nobody uses it");
}

#[test]
fn what_a_host_uses_is_not_swept() {
    let instance = fresh("attended");
    let attendance = instance.0.attend().expect("room");
    instance.0.sweep();
    assert!(instance.0.folder().exists());
    drop(attendance);
    Instance::default().sweep_dead();
    assert!(!instance.0.folder().exists());
}

#[test]
fn an_open_folder_is_closed_and_a_file_in_its_place_is_named() {
    let path = std::env::temp_dir().join(format!("stylet-folder-{}", std::process::id()));
    std::fs::create_dir(&path).expect("room");
    std::fs::set_permissions(&path, Permissions::from_mode(0o755)).expect("ours");
    secure_folder(&path).expect("ours");
    assert_eq!(std::fs::metadata(&path).expect("there").mode() & 0o777, 0o700);
    std::fs::remove_dir(&path).expect("ours");
    std::fs::write(&path, "").expect("room");
    let why = secure_folder(&path).expect_err("a file").to_string();
    std::fs::remove_file(&path).expect("ours");
    assert!(why.starts_with(&path.display().to_string()), "{why}");
}
