use super::*;

fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-relay-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

#[test]
fn seats_have_one_name_each_and_no_other_name_is_a_seat() {
    for seat in [1, 42, SEATS] {
        assert_eq!(seat_of(&seat_name(seat)), Some(seat));
    }
    for name in ["seat-000", "seat-257", "seat-1", "seat-0001", "relay", "seat-+01", ""] {
        assert_eq!(seat_of(name), None, "{name}");
    }
}

#[test]
fn a_lab_is_made_once_and_its_seats_are_never_given_twice() {
    let folder = scratch("lab");
    let lab = Lab::new(&folder);
    lab.make(&["127.0.0.1".to_owned()]).expect("made");
    assert!(lab.make(&[]).is_err(), "a second authority would shut everybody out");
    let invite = |name| lab.invite(name, Role::Observer, "127.0.0.1", Validity::days(1));
    let (first, code) = invite("Anna").expect("invited");
    assert!(invite("Anna").is_err(), "the name is in use");
    assert_eq!(lab.revoke("Anna").expect("revoked"), 1);
    assert!(lab.revoke("Anna").is_err());
    let (second, other) = invite("Anna").expect("invited again");
    assert!(first.identity(&code).is_ok() && first.identity(&other).is_err());
    assert_eq!((first.seat, second.seat), (1, 2));
    lab.invite("Ede", Role::Observer, "127.0.0.1", Validity::ended())
        .expect("invited");
    let members = lab.members().expect("kept");
    let open: Vec<bool> = members
        .members
        .iter()
        .map(|m| m.why_closed(now_s()).is_none())
        .collect();
    assert_eq!(open, [false, true, false], "revoked, valid, expired");
    let file = folder.join("anna.invitation");
    write_invitation(&file, &second).expect("written");
    assert_eq!(Invitation::read(&file).expect("read").seat, 2);
    assert!(!fs::read_to_string(&file).expect("written").contains("PRIVATE KEY"));
    use std::os::unix::fs::PermissionsExt;
    for name in ["anna.invitation", "authority.key", "relay.key"] {
        let mode = fs::metadata(folder.join(name)).expect("there").permissions().mode();
        assert_eq!(mode & 0o077, 0, "{name} is readable for others");
    }
    fs::remove_dir_all(folder).expect("ours");
}
