//! A thread that panics ends its process, even if its message cannot be printed: the hand is stopped for a process that
//! ends (`lease.rs`).

use crate::fixture::until;
use crate::motion::full;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
#[ignore = "the other process of the next test, and nothing alone"]
fn a_thread_that_panics() {
    stylet_relay::say::end_on_panic();
    let thread = std::thread::spawn(|| panic!("as a bug would"));
    let _ = thread.join();
    std::thread::sleep(Duration::from_secs(20));
}

#[test]
fn a_panic_in_any_thread_ends_the_process() {
    let (reader, output) = full();
    let begun = Instant::now();
    let mut child = Command::new(std::env::current_exe().expect("a test knows its own file"))
        .args(["--exact", "panics::a_thread_that_panics", "--ignored", "--nocapture"])
        .stdout(Stdio::null())
        .stderr(output)
        .spawn()
        .expect("the test starts");
    let mut status = None;
    until(Duration::from_secs(10), || {
        status = child.try_wait().expect("ours");
        status.is_some()
    });
    let _ = child.kill();
    let _ = child.wait();
    assert_eq!(status.and_then(|status| status.code()), Some(101));
    println!("ended after {:?}", begun.elapsed());
    drop(reader);
}
