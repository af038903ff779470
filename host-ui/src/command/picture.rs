//! The command `host-ui picture`: image of a probe or a C-arm in the scene of a running core, as a
//! PNG file.

use super::CommandError;
use crate::picture::png_of;
use clap::{Args, ValueEnum};
use nalgebra::{Vector2, Vector3};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stylet_base::write_whole;
use stylet_host::core_args::CoreArgs;
use stylet_host::link::{Link, SceneModel};
use stylet_imaging::fluoroscopy::{Attenuation, CArm, Exposure, Fluoroscope};
use stylet_imaging::ultrasound::{NoPicture, Plane, Pose, Probe, Scanner, Settings, View};
use stylet_imaging::{Body, Gpu, Metal};
use stylet_implant::plan::{Hole, Template};
use stylet_implant::procedure::Live;
use stylet_surfaces::field::Field;

/// Longest wait for a snapshot; a core sends one at least every 30 ms.
const SNAPSHOT_WITHIN: Duration = Duration::from_secs(3);

const HELP: &str = "\
The picture shows the present state of tissue, needle and seeds. Ultrasound: the probe is in the hand of rt-core --device-2; without one
it is in the rectum, or behind the target if the scene has none, with its array at the centre of the target. Fluoroscopy: the C-arm turns
about the centre of the target; 0 degrees looks from behind the patient, positive orbital angles move the detector to his left, positive
cranial angles towards his head. The printed dose is the air kerma 15 cm before the isocentre. docs/imaging.md describes the simulation
and its limits.

Examples:
  host-ui picture --core target/quick/rt-core --scene pelvis --view transverse --template --out prostate.png
  host-ui picture --view sagittal --turn 10 --out side.png
  host-ui picture --view fluoroscopy --orbital 30 --out seeds.png";

#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct PictureArgs {
    #[command(flatten)]
    asked: CoreArgs,
    /// Start this rt-core when none is running, and end it afterwards
    #[arg(long, value_name = "PATH")]
    core: Option<PathBuf>,
    /// Picture to write
    #[arg(long, value_enum)]
    view: Wanted,
    /// File to write
    #[arg(long, value_name = "FILE.png")]
    out: PathBuf,
    /// Width and height in pixels
    #[arg(long, default_value_t = 768, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=2048))]
    pixels: u32,
    /// Move the probe by this into the patient, -100 to 100 mm
    #[arg(long, default_value_t = 0.0, value_name = "MM", allow_negative_numbers = true)]
    way: f64,
    /// Turn the probe about its axis, -180 to 180 degrees
    #[arg(long, default_value_t = 0.0, value_name = "DEG", allow_negative_numbers = true)]
    turn: f64,
    /// Depth of the ultrasound image, 20 to 120 mm
    #[arg(long, default_value_t = 60.0, value_name = "MM")]
    depth: f64,
    /// Gain of ultrasound, -60 to 60 dB
    #[arg(long, default_value_t = 0.0, value_name = "DB", allow_negative_numbers = true)]
    gain: f64,
    /// Draw the holes of the template on the transverse picture
    #[arg(long)]
    template: bool,
    /// Orbital angle of the C-arm, -180 to 180 degrees
    #[arg(long, default_value_t = 0.0, value_name = "DEG", allow_negative_numbers = true)]
    orbital: f64,
    /// Cranial angle of the C-arm, -60 to 60 degrees
    #[arg(long, default_value_t = 0.0, value_name = "DEG", allow_negative_numbers = true)]
    cranial: f64,
}

/// Requested picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Wanted {
    /// Ultrasound across the probe
    Transverse,
    /// Ultrasound along the probe
    Sagittal,
    /// Radiograph of a C-arm
    Fluoroscopy,
}

impl PictureArgs {
    pub fn run(self) -> Result<(), CommandError> {
        for (option, value, least, most) in [
            ("--way", self.way, -100.0, 100.0),
            ("--turn", self.turn, -180.0, 180.0),
            ("--depth", self.depth, 20.0, 120.0),
            ("--gain", self.gain, -60.0, 60.0),
            ("--orbital", self.orbital, -180.0, 180.0),
            ("--cranial", self.cranial, -60.0, 60.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(format!("{option} {value}: give {least} to {most}").into());
            }
        }
        let mut live = Live::connect(&self.asked, self.core.as_deref())?;
        let scene = live.scene.clone();
        let (field, metal) = now(&mut live, &scene)?;
        let body = Body::of_scene(&scene.header, &scene.labels).ok_or(NoPicture::NoLabels)?;
        let gpu = Gpu::headless(false)?;
        let pose = Pose::now(&scene.header, live.link.second_state());
        let rgba = match self.view {
            Wanted::Transverse => self.ultrasound(View::Transverse, pose, gpu, &scene, (&body, &field, &metal))?,
            Wanted::Sagittal => self.ultrasound(View::Sagittal, pose, gpu, &scene, (&body, &field, &metal))?,
            Wanted::Fluoroscopy => self.fluoroscopy(gpu, &scene, (&body, &field, &metal)),
        };
        let bytes = rgba.into_iter().flatten().collect();
        write_whole(&self.out, &png_of(bytes, [self.pixels; 2])?)?;
        println!("written: {}", self.out.display());
        Ok(())
    }

    fn ultrasound(
        &self,
        view: View,
        pose: Pose,
        gpu: Gpu,
        scene: &SceneModel,
        (body, field, metal): (&Body, &Field, &Metal),
    ) -> Result<Vec<[u8; 4]>, CommandError> {
        let plane = Plane {
            pose: pose.moved(self.way * 1e-3, self.turn.to_radians()),
            view,
            probe: Probe::default(),
            depth_m: self.depth * 1e-3,
            pixels: [self.pixels; 2],
        };
        let settings = Settings {
            gain_db: self.gain,
            ..Settings::default()
        };
        let mut scanner = Scanner::new(gpu);
        scanner.set_body(body, field);
        let greys = scanner.greys(&plane, &settings, metal)?;
        let mut pixels = opaque(greys);
        if self.template {
            let template = Template::before(&scene.header);
            for hole in Hole::all() {
                let place = Vector3::from(template.hole_m(hole));
                if let Some(at) = plane.crossing(place, template.inwards.into()) {
                    dot(&mut pixels, self.pixels, at);
                }
            }
        }
        Ok(pixels)
    }

    fn fluoroscopy(&self, gpu: Gpu, scene: &SceneModel, (body, field, metal): (&Body, &Field, &Metal)) -> Vec<[u8; 4]> {
        let header = &scene.header;
        let middle = (Vector3::from(header.target_lower_m) + Vector3::from(header.target_upper_m)) * 0.5;
        let arm = CArm {
            pixels: [self.pixels; 2],
            orbital: self.orbital.to_radians(),
            cranial: self.cranial.to_radians(),
            ..CArm::about(middle, header.patient().rotation().transpose())
        };
        let greys = Fluoroscope::new(gpu)
            .shoot(&arm, &Attenuation::smooth(body), field, metal)
            .greys();
        println!("air kerma: {:.0} uGy", Exposure::default().air_kerma_gy(&arm) * 1e6);
        opaque(greys)
    }
}

fn opaque(greys: Vec<u8>) -> Vec<[u8; 4]> {
    greys.into_iter().map(|g| [g, g, g, 255]).collect()
}

/// Returns the tissue and the metal of the first snapshot that arrives; waits for a second hand too.
fn now(live: &mut Live, scene: &SceneModel) -> Result<(Field, Metal), CommandError> {
    let is_whole = |link: &Link| {
        let has_second = link.session().is_some_and(|session| session.has_second());
        link.snapshot().is_some() && (!has_second || link.second_state().is_some())
    };
    let start = Instant::now();
    while !is_whole(&live.link) && start.elapsed() <= SNAPSHOT_WITHIN {
        std::thread::sleep(Duration::from_millis(10));
        live.link.poll();
    }
    let snapshot = live.link.snapshot();
    let snapshot = snapshot.ok_or("rt-core sends no tissue; see its messages")?;
    let nodes = scene.header.nodes;
    let field = Field::of(nodes, &snapshot.displacements_m);
    let metal = Metal::of_snapshot(&snapshot.header, live.link.state());
    Ok((field.unwrap_or_else(|| Field::rest(nodes)), metal))
}

/// Draws a dot of the template.
fn dot(pixels: &mut [[u8; 4]], side: u32, at: Vector2<f64>) {
    const COLOR: [u8; 4] = [150, 230, 150, 255];
    for (x, y) in [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)] {
        let place = [at.x.floor() as i64 + x, at.y.floor() as i64 + y];
        if place.iter().all(|c| (0..i64::from(side)).contains(c)) {
            pixels[place[1] as usize * side as usize + place[0] as usize] = COLOR;
        }
    }
}
