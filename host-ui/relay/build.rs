//! Refuses a build that would contain zenoh's TLS link, which is unsound (zenoh issue 2557).

fn main() {
    println!("cargo::rerun-if-changed=Cargo.lock");
    println!("cargo::rerun-if-changed=build.rs");
    let lock =
        std::fs::read_to_string("Cargo.lock").expect("Cargo.lock beside Cargo.toml: the relay is built by itself");
    assert!(
        lock.contains("name = \"zenoh-link-quic\""),
        "the relay carries everything over QUIC"
    );
    assert!(
        !lock.contains("name = \"zenoh-link-tls\""),
        "zenoh is built with transport_tls, whose link is unsound: leave the feature out"
    );
}
