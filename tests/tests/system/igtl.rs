//! `host-ui igtl`: clients of OpenIGTLink receive the core's positions, in RAS and mm; their messages move the hand or
//! are refused with a reason; and no client costs a frame or a tick.

use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use stylet_host::link::Link;
use stylet_igtl::codec::{Body, HEADER_BYTES, Header, Message, Status, Timestamp};
use stylet_shm_schema::{Exercise, Request};
use stylet_tests::hand::Insertion;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, program, until};

/// The process, its address, and its output.
pub struct Served {
    child: Child,
    pub address: String,
    log: Arc<Mutex<String>>,
}

impl Served {
    pub fn start(core: &Core, options: &[&str]) -> Self {
        let mut child = Command::new(program("host-ui"))
            .args(["igtl", "--instance", core.instance.name(), "--listen", "127.0.0.1:0"])
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .expect("host-ui runs");
        let mut out = BufReader::new(child.stdout.take().expect("piped"));
        let mut line = String::new();
        out.read_line(&mut line).expect("one line");
        let log = Arc::new(Mutex::new(String::new()));
        let lines = Arc::clone(&log);
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                *lines.lock().expect("whole") += &format!("{line}\n");
            }
        });
        let address = line.split_whitespace().find_map(|word| word.strip_suffix(';'));
        let address = address.unwrap_or_else(|| panic!("{line:?}")).to_owned();
        Self { child, address, log }
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("it listens");
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .expect("a timeout");
        stream
    }

    pub fn log(&self) -> String {
        self.log.lock().expect("whole").clone()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // As Ctrl-C: it leaves nothing in shared memory.
        // SAFETY: a signal to a child that was not waited for yet.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGINT) };
        let _ = self.child.wait();
    }
}

fn receive(stream: &mut TcpStream) -> Message {
    let mut head = [0; HEADER_BYTES];
    stream.read_exact(&mut head).expect("a header");
    let header = Header::decode(&head).expect("of the six");
    let mut body = vec![0; header.body_bytes];
    stream.read_exact(&mut body).expect("a body");
    Message::of(&header, &body).expect("a message")
}

/// Returns the next wanted message, within 600 messages.
pub fn receive_one<T>(stream: &mut TcpStream, wanted: impl Fn(Message) -> Option<T>) -> T {
    let mut messages = (0..600).map(|_| receive(stream));
    messages.find_map(wanted).expect("it comes")
}

pub fn needle_of(stream: &mut TcpStream) -> [[f32; 3]; 4] {
    receive_one(stream, |message| match (message.device.as_str(), message.body) {
        ("Needle", Body::Transform(columns)) => Some(columns),
        _ => None,
    })
}

fn refusal(stream: &mut TcpStream) -> Status {
    receive_one(stream, |message| match message.body {
        Body::Status(status) => Some(status),
        _ => None,
    })
}

pub fn send(stream: &mut TcpStream, device: &str, columns: [[f32; 3]; 4]) -> io::Result<()> {
    let message = Message {
        device: device.to_owned(),
        time: Timestamp::now(),
        body: Body::Transform(columns),
    };
    stream.write_all(&message.encode().expect("fits"))
}

/// Returns the needle's transform moved by `mm` along its own axis.
pub fn further(mut columns: [[f32; 3]; 4], mm: f32) -> [[f32; 3]; 4] {
    (0..3).for_each(|a| columns[3][a] += mm * columns[2][a]);
    columns
}

pub fn tip_m(link: &mut Link) -> [f64; 3] {
    link.poll();
    link.state().expect("live").tip_in_scene_m
}

pub fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_client_gets_needle_gland_and_state_where_the_core_has_them() {
    let mut core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let mut link = core.host();
    let served = Served::start(&core, &[]);
    let mut stream = served.connect();
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
        // The bounding box covers whole elements.
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

/// The seeds used to stay in place when an exercise moved the gland.
#[test]
fn seeds_go_with_a_gland_that_moves() {
    let mut core = Core::start_with(&["--rt-if-allowed", "--tissue", "fem"]);
    let mut hand = Insertion::begin(&mut core, 0.015);
    hand.watch(Duration::from_secs(4));
    ask(&mut hand.link, &Request::DropSeed { strand_pitch_m: None }).expect("dropped");
    hand.go(-0.005, 0.05);
    hand.watch(Duration::from_secs(2));
    let served = Served::start(&core, &[]);
    let mut stream = served.connect();
    let shown = |stream: &mut TcpStream| {
        let seeds = receive_one(stream, |message| match message.body {
            Body::Points(seeds) if !seeds.is_empty() => Some(seeds[0].place_mm),
            _ => None,
        });
        let gland = receive_one(stream, |message| match message.body {
            Body::PolyData(surface) => Some(surface.points),
            _ => None,
        });
        let middle = [0, 1, 2].map(|a| gland.iter().map(|p| f64::from(p[a])).sum::<f64>() / gland.len() as f64);
        [seeds.map(f64::from), middle]
    };
    let before = shown(&mut stream);
    let by_m = [0.003, 0.0, -0.004];
    ask(&mut hand.link, &Request::BeginExercise(Exercise::BodyMoved { by_m })).expect("taken");
    let is_there = hand.watch_until(Duration::from_secs(5), |link| {
        link.snapshot().is_some_and(|s| s.header.body_moved_m == by_m)
    });
    assert!(is_there, "the body rests");
    // Messages on their way, and those sent twice a second.
    std::thread::sleep(Duration::from_secs(1));
    drop(stream);
    let mut stream = served.connect();
    let after = shown(&mut stream);
    let patient = hand.link.scene().expect("live").header.patient();
    let way_mm = patient.patient_from_scene_direction(by_m).map(|c| c * 1e3);
    for (what, before, after) in [("seed", before[0], after[0]), ("gland", before[1], after[1])] {
        let off_mm = (0..3)
            .map(|a| (after[a] - before[a] - way_mm[a]).abs())
            .fold(0.0, f64::max);
        println!("{what} moved {off_mm:.3} mm from where the exercise moves it");
        assert!(off_mm < 0.2, "{what}: {before:?} to {after:?}");
    }
    drop((served, stream, hand));
    core.finish();
}

#[test]
fn a_tracker_moves_the_needle_and_its_silence_stops_it() {
    let mut core = Core::start_with(&["--no-rt"]);
    let mut link = core.host();
    let served = Served::start(&core, &["--hand", "Stylus", "--hand-speed", "20"]);
    let mut stream = served.connect();
    let (rest_m, shown) = (tip_m(&mut link), needle_of(&mut stream));
    // 5 mm in its own frame, sent repeatedly like a tracker.
    let is_there = until(Duration::from_secs(20), || {
        send(&mut stream, "Stylus", further(shown, 5.0)).expect("sent");
        std::thread::sleep(Duration::from_millis(15));
        (distance_m(tip_m(&mut link), rest_m) - 5e-3).abs() < 1e-4
    });
    assert!(
        is_there,
        "{:.4} m; {}",
        distance_m(tip_m(&mut link), rest_m),
        served.log()
    );
    let back = needle_of(&mut stream);
    assert_eq!(back[2], shown[2], "it points where it pointed");

    // 200 mm take 10 s: the sender falls silent after 6 mm.
    let there_m = tip_m(&mut link);
    send(&mut stream, "Stylus", further(shown, -200.0)).expect("sent");
    let moves = until(Duration::from_secs(10), || distance_m(tip_m(&mut link), there_m) > 1e-3);
    assert!(moves, "{}", served.log());
    let mut before = tip_m(&mut link);
    let rests = until(Duration::from_secs(5), || {
        std::thread::sleep(Duration::from_millis(200));
        let now = tip_m(&mut link);
        distance_m(now, std::mem::replace(&mut before, now)) < 1e-6
    });
    let went_m = distance_m(tip_m(&mut link), there_m);
    assert!(rests && went_m < 0.1, "the hand goes on: {went_m} m");
    drop((stream, served, link));
    core.finish();
}

#[test]
fn an_unexpected_transform_is_refused_with_a_reason_and_moves_nothing() {
    let mut core = Core::start_with(&["--no-rt"]);
    let mut link = core.host();
    let (closed, open) = (Served::start(&core, &[]), Served::start(&core, &["--hand", "Stylus"]));
    let rest_m = tip_m(&mut link);
    let mut streams = [closed.connect(), open.connect()];
    let shown = needle_of(&mut streams[0]);
    send(&mut streams[0], "Stylus", further(shown, 5.0)).expect("sent");
    let status = refusal(&mut streams[0]);
    assert_eq!(
        (status.code, status.text.contains("--hand NAME")),
        (5, true),
        "{status:?}"
    );
    send(&mut streams[1], "Probe", further(shown, 5.0)).expect("sent");
    assert!(refusal(&mut streams[1]).text.contains("\"Stylus\" alone"));
    // The core refuses an unreachable goal with its own text.
    std::thread::sleep(Duration::from_millis(60));
    send(&mut streams[1], "Stylus", further(shown, 1e7)).expect("sent");
    let status = refusal(&mut streams[1]);
    assert_eq!(status.code, 13, "{status:?}");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(tip_m(&mut link), rest_m, "the hand has moved");
    assert!(open.log().contains("refused, ") && closed.log().contains("refused, "));
    drop((streams, closed, open, link));
    core.finish();
}

/// Duration of each measurement; `STYLET_IGTL_S` makes it longer for a figure.
pub fn watched() -> Duration {
    let asked = std::env::var("STYLET_IGTL_S").ok().and_then(|s| s.parse().ok());
    Duration::from_secs_f64(asked.unwrap_or(4.0))
}

/// Counts messages of the needle, each decoded with its checksum and later than the one before; also returns the
/// longest interval.
fn watch(stream: &mut TcpStream, end: Instant) -> (usize, Duration) {
    let (mut count, mut longest, mut last, mut time) = (0, Duration::ZERO, Instant::now(), (0, 0));
    while Instant::now() < end {
        let message = receive(stream);
        if message.device == "Needle" {
            let its = (message.time.seconds, message.time.fraction);
            assert!(its > time, "a message before the one before");
            (count, longest, last, time) = (count + 1, longest.max(last.elapsed()), Instant::now(), its);
        }
    }
    (count, longest)
}

/// One does not read, one stops within a message, one sends an invalid message, and one sends without end.
#[test]
fn clients_that_hang_cost_no_frame_and_no_tick() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let served = Served::start(&core, &["--hand", "Stylus"]);
        let mut good = served.connect();
        let shown = needle_of(&mut good);
        let _deaf = served.connect();
        let mut half = served.connect();
        half.write_all(&[0, 1, b'T', b'R']).expect("sent");
        let mut noise = served.connect();
        noise.write_all(&[0x5a; 4096]).expect("sent");
        let address = served.address.clone();
        let connect_to = |address: &str| {
            let stream = TcpStream::connect(address).expect("it listens");
            stream.set_nonblocking(true).expect("a socket");
            stream
        };
        let mut flood = connect_to(&address);
        let end = Instant::now() + watched();
        let flooding = std::thread::spawn(move || {
            let message = Message {
                device: "Flood".to_owned(),
                time: Timestamp::default(),
                body: Body::Transform(shown),
            };
            let bytes = message.encode().expect("fits");
            let (mut sent, mut at) = (0_usize, 0);
            while Instant::now() < end {
                match flood.write(&bytes[at..]) {
                    Ok(length) => (sent, at) = (sent + length, (at + length) % bytes.len()),
                    Err(why) if why.kind() == ErrorKind::WouldBlock => {}
                    // It does not read either, is disconnected for that, and reconnects.
                    Err(_) => (flood, at) = (connect_to(&address), 0),
                }
                // More than any tracker, and no more of the machine than one client may use.
                std::thread::sleep(Duration::from_micros(200));
            }
            sent / bytes.len()
        });
        link.poll();
        link.take_records();
        let mut ticks: Vec<u64> = Vec::new();
        let (count, longest) = std::thread::scope(|scope| {
            let watching = scope.spawn(|| watch(&mut good, end));
            while Instant::now() < end {
                link.poll();
                ticks.extend(link.take_records().iter().map(|record| record.tick));
                std::thread::sleep(Duration::from_millis(5));
            }
            watching.join().expect("watched")
        });
        let flooded = flooding.join().expect("sent");
        let missing: u64 = ticks.windows(2).map(|pair| pair[1] - pair[0] - 1).sum();
        println!(
            "{count} transforms in {:.0} s, at most {longest:?} apart, beside {flooded} of a flood; {} ticks, {missing} missing",
            watched().as_secs_f64(),
            ticks.len()
        );
        assert!(count as f64 > 30.0 * watched().as_secs_f64(), "{count} transforms");
        assert!(flooded > 1000, "{flooded} messages");
        assert!(ticks.len() > 1000 && missing == 0, "{missing} of {} ticks", ticks.len());
        assert!(
            served.log().contains("disconnected, what it sent is no message"),
            "{}",
            served.log()
        );
        drop((good, served, link));
        core.finish();
    });
}
