//! Serves the state of the core: needle, seeds, surface of the gland, a text and the probe's picture,
//! in RAS and mm. Moves the simulated hands for clients with permission.

use crate::codec::{Body, CodecError, Point, PolyData, Timestamp};
use crate::frame::{needle, place_mm};
use crate::hand::HandOptions;
use crate::image::{Beyond, ImageOptions, Pictures};
use crate::requests::Requests;
use crate::server::{Server, ServerError};
use clap::Args;
use std::collections::HashMap;
use std::net::SocketAddr;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_anatomy::PatientFrame;
use stylet_base::interrupt::{Interrupt, InterruptError};
use stylet_base::lines::Lines;
use stylet_host::link::{Link, LinkStatus, SceneModel, Snapshot};
use stylet_imaging::NoGpu;
use stylet_imaging::ultrasound::NoPicture;
use stylet_shm_schema::Instance;
use stylet_shm_schema::{HapticState, Phase, StructureInfo, role};

const MM_PER_M: f64 = 1000.0;
/// Longest time between two readings of clients' messages, however rarely something is sent to
/// them.
const PASS: Duration = Duration::from_millis(10);
/// Period of surface and text, which change slowly and cost Slicer more than the needle.
const SLOW_EVERY: Duration = Duration::from_millis(500);

/// Options of the service.
#[derive(Args, Debug)]
pub struct Options {
    /// Name under which rt-core was started
    #[arg(long, default_value = "main", value_parser = Instance::new)]
    pub instance: Instance,
    /// Address and port to listen on
    #[arg(long, default_value = "127.0.0.1:18944", value_name = "ADDRESS")]
    pub listen: SocketAddr,
    /// Transforms of the needle per second, 1 to 200
    #[arg(long, default_value_t = 60.0, value_name = "HZ")]
    pub hz: f64,
    /// Let transforms of this name move the simulated hand: a tracker or a stepper behind PLUS. Anyone who reaches
    /// the address can send them
    #[arg(long, value_name = "NAME")]
    pub hand: Option<String>,
    /// Let transforms of this name, such as ProbeToScene, move the simulated hand with the ultrasound probe
    /// (rt-core --device-2)
    #[arg(long, value_name = "NAME")]
    pub probe: Option<String>,
    /// Maximum speed of both hands, 0.1 to 1000 mm/s
    #[arg(long, default_value_t = 100.0, value_name = "MM/S")]
    pub hand_speed: f64,
    /// Picture of the probe
    #[command(flatten)]
    pub image: ImageOptions,
}

/// Error that ended the service.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// A rate beyond its limits.
    #[error("--hz {0}: 1 to 200 Hz are possible")]
    Rate(f64),
    /// A speed beyond its limits.
    #[error("--hand-speed {0}: 0.1 to 1000 mm/s are possible")]
    Speed(f64),
    /// A value of the picture beyond its limits.
    #[error(transparent)]
    Image(#[from] Beyond),
    /// Pictures were asked for, and nothing computes them.
    #[error("--image: {0}")]
    NoGpu(#[from] NoGpu),
    /// The server could not start.
    #[error(transparent)]
    Server(#[from] ServerError),
    /// A message could not be encoded.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// Ctrl-C cannot be caught.
    #[error("signals cannot be taken: {0}")]
    Signals(#[from] InterruptError),
}

/// Serves until interrupted, including cores that start later or again.
pub fn run(options: &Options) -> Result<(), ServeError> {
    if !(1.0..=200.0).contains(&options.hz) {
        return Err(ServeError::Rate(options.hz));
    }
    if !(0.1..=1000.0).contains(&options.hand_speed) {
        return Err(ServeError::Speed(options.hand_speed));
    }
    options.image.check()?;
    let mut pictures = Pictures::begin(&options.image)?;
    let interrupted = Interrupt::on_signals()?;
    // A terminal that is stopped or closed must not block the loop that watches for silent clients.
    let lines = Arc::new(Lines::to_stdout());
    let log = Arc::clone(&lines);
    let server = Server::listen(options.listen, move |line| {
        log.say(line);
    })?;
    lines.say(format!("OpenIGTLink on {}; end with Ctrl-C", server.address()));
    let mut link = Link::new(options.instance.clone());
    let every = Duration::from_secs_f64(1.0 / options.hz);
    let moved_by = |device: &Option<String>| {
        device.clone().map(|device| HandOptions {
            device,
            speed_m_per_s: options.hand_speed * 1e-3,
        })
    };
    let mut requests = Requests::new(moved_by(&options.hand), moved_by(&options.probe));
    let mut slow: Option<Instant> = None;
    let mut next = Instant::now();
    while !interrupted.asked() {
        link.poll();
        link.take_records();
        requests.pass(&mut link, &server);
        if let Some(pictures) = &mut pictures {
            pictures.pass(&link, &server, &lines)?;
        }
        let now = Instant::now();
        if now < next {
            std::thread::sleep((next - now).min(PASS));
            continue;
        }
        next = (next + every).max(now);
        let is_slow = slow.is_none_or(|at| at.elapsed() >= SLOW_EVERY);
        if is_slow {
            slow = Some(Instant::now());
        }
        for (device, body) in devices(&link, is_slow, pictures.as_ref().and_then(|p| p.trouble)) {
            server.send(device, Timestamp::now(), body)?;
        }
    }
    requests.end(&mut link);
    Ok(())
}

fn devices(link: &Link, is_slow: bool, trouble: Option<NoPicture>) -> Vec<(&'static str, Body)> {
    let mut devices = Vec::new();
    let scene = link.scene();
    if is_slow {
        let mut words = words(&link.status(), link.state());
        if let Some(why) = trouble.filter(|_| matches!(link.status(), LinkStatus::Live)) {
            words += &format!("; no ultrasound: {why}");
        }
        devices.push(("State", Body::Text(words)));
    }
    let (Some(scene), LinkStatus::Live) = (scene, link.status()) else {
        return devices;
    };
    let patient = scene.header.patient();
    if let Some(state) = link.state() {
        let tip_m = [0, 1, 2].map(|a| state.tip_in_scene_m[a] + state.tip_deflection_m[a]);
        let needle = needle(&patient, tip_m, state.needle_direction);
        devices.push(("Needle", Body::Transform(needle)));
    }
    // A snapshot of another scene has other vertices.
    let snapshot = link.snapshot().filter(|s| s.header.scene_id() == scene.header.id());
    if let Some(snapshot) = snapshot.filter(|_| is_slow) {
        devices.push(("Seeds", Body::Points(seeds(&patient, snapshot))));
        devices.push(("Gland", Body::PolyData(surface(&patient, scene, snapshot))));
    }
    devices
}

fn seeds(patient: &PatientFrame, snapshot: &Snapshot) -> Vec<Point> {
    let header = &snapshot.header;
    let dropped = header.seeds.iter().take(header.seed_count as usize).enumerate();
    dropped
        .map(|(index, seed)| Point {
            name: format!("Seed {}", index + 1),
            group: "Seeds".to_owned(),
            rgba: [255, 200, 0, 255],
            place_mm: place_mm(patient, [0, 1, 2].map(|a| seed.position_m[a] + header.body_moved_m[a])),
            diameter_mm: 0.0,
            owner: String::new(),
        })
        .collect()
}

/// Returns the surface of the targets, with the vertices that they use; of the whole body if no
/// target has its own surface.
fn surface(patient: &PatientFrame, scene: &SceneModel, snapshot: &Snapshot) -> PolyData {
    let header = &scene.header;
    let own = |s: &&StructureInfo| s.role & role::TARGET != 0 && s.triangle_count > 0;
    let parts: Vec<Range<usize>> = match header.structures().iter().filter(own) {
        targets if targets.clone().next().is_some() => targets
            .map(|s| s.first_triangle as usize..(s.first_triangle as usize + s.triangle_count as usize))
            .collect(),
        _ => std::iter::once(0..header.body_triangle_count as usize).collect(),
    };
    let mut number_of: HashMap<u32, u32> = HashMap::new();
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for triangle in parts.into_iter().filter_map(|part| scene.triangles.get(part)).flatten() {
        let corners = triangle.map(|vertex| {
            *number_of.entry(vertex).or_insert_with(|| {
                let place_m = snapshot.positions_m.get(vertex as usize).copied().unwrap_or_default();
                points.push(place_mm(patient, place_m.map(f64::from)));
                (points.len() - 1) as u32
            })
        });
        triangles.push(corners);
    }
    PolyData { points, triangles }
}

/// Formats phase, depth, force and seeds; or the reason why there is nothing.
fn words(status: &LinkStatus, state: Option<&HapticState>) -> String {
    match (status, state) {
        (LinkStatus::Absent { why }, _) => why.clone(),
        (LinkStatus::Silent { since }, _) => format!("rt-core has been silent for {:.1} s", since.as_secs_f64()),
        (LinkStatus::Live, None) => "rt-core runs without a state yet".to_owned(),
        (LinkStatus::Live, Some(state)) => format!(
            "{}; depth {:.1} mm; force {:.2} N; {} seeds",
            Phase::from_number(state.phase).map_or("unknown phase", Phase::name),
            state.depth_m * MM_PER_M,
            state.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt(),
            state.seed_count
        ),
    }
}
