//! `host-ui igtl`: what a client of OpenIGTLink gets is where the core has it, in RAS and mm.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_igtl::codec::{Body, HEADER_BYTES, Header, Message};
use stylet_tests::{Core, program, until};

struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        // As Ctrl-C: it leaves nothing in shared memory.
        // SAFETY: a signal to a child that was not waited for yet.
        unsafe { libc::kill(self.0.id() as libc::pid_t, libc::SIGINT) };
        let _ = self.0.wait();
    }
}

/// The process, and the address that it prints.
fn serve(instance: &str) -> (Served, String) {
    let mut child = Command::new(program("host-ui"))
        .args(["igtl", "--instance", instance, "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("host-ui runs");
    let mut line = String::new();
    let out = child.stdout.as_mut().expect("piped");
    BufReader::new(out).read_line(&mut line).expect("one line");
    let served = Served(child);
    let address = line.split_whitespace().find_map(|word| word.strip_suffix(';'));
    (served, address.unwrap_or_else(|| panic!("{line:?}")).to_owned())
}

fn receive(stream: &mut TcpStream) -> Message {
    let mut head = [0; HEADER_BYTES];
    stream.read_exact(&mut head).expect("a header");
    let header = Header::decode(&head).expect("of the six");
    let mut body = vec![0; header.body_bytes];
    stream.read_exact(&mut body).expect("a body");
    Message::of(&header, &body).expect("a message")
}

#[test]
fn a_client_gets_needle_gland_and_state_where_the_core_has_them() {
    let mut core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let mut link = core.host();
    let (served, address) = serve(core.instance.name());
    let mut stream = TcpStream::connect(&address).expect("it listens");
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .expect("a timeout");
    let (mut needle, mut gland, mut words) = (None, None, None);
    while needle.is_none() || gland.is_none() || words.is_none() {
        let message = receive(&mut stream);
        match (message.device.as_str(), message.body) {
            ("Needle", Body::Transform(columns)) => needle = Some(columns),
            ("Gland", Body::PolyData(surface)) => gland = Some(surface),
            ("State", Body::Text(text)) if text.contains("mm") => words = Some(text),
            _ => {}
        }
    }
    until(Duration::from_secs(5), || {
        link.poll();
        link.state().is_some() && link.scene().is_some()
    });
    let scene = link.scene().expect("announced").header;
    let patient = scene.patient();
    let tip_m = link.state().expect("live").tip_in_scene_m;
    let tip_mm = patient.patient_from_scene(tip_m).map(|c| c * 1e3);
    let shown = needle.expect("received")[3];
    let off_mm = (0..3)
        .map(|a| (f64::from(shown[a]) - tip_mm[a]).abs())
        .fold(0.0, f64::max);
    assert!(off_mm < 0.5, "the tip is shown {off_mm} mm from where the hand rests");

    let gland = gland.expect("received");
    assert!(gland.triangles.len() > 1000 && gland.points.len() > 500);
    let corners = [scene.target_lower_m, scene.target_upper_m].map(|c| patient.patient_from_scene(c));
    for a in 0..3 {
        let ends = [corners[0][a], corners[1][a]].map(|c| c * 1e3);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let all = gland.points.iter().map(|p| f64::from(p[a]));
        let (least, most) = all.fold((f64::MAX, f64::MIN), |(l, m), c| (l.min(c), m.max(c)));
        // The box is that of whole elements.
        assert!(
            (least - low).abs() < 2.0 && (most - high).abs() < 2.0,
            "{least} to {most}, {low} to {high}"
        );
    }
    let words = words.expect("received");
    assert!(words.contains("0 seeds") && words.contains("N"), "{words}");
    drop((served, stream, link));
    core.finish();
}
