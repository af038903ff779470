//! Pictures of the ultrasound probe, computed on a thread of its own: one that takes long delays
//! neither the needle nor the hands of clients.

use crate::codec::{Body, CodecError, Image, Timestamp};
use crate::frame;
use crate::server::Server;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};
use stylet_base::job;
use stylet_base::lines::Lines;
use stylet_host::link::{Link, LinkStatus, SceneModel};
use stylet_imaging::ultrasound::{NoPicture, Plane, Pose, Probe, Scanner, Settings, View};
use stylet_imaging::{Body as Imaged, Gpu, Metal, NoGpu};
use stylet_shm_schema::SceneId;
use stylet_surfaces::field::Field;

/// Options of the pictures.
#[derive(Args, Debug)]
pub struct ImageOptions {
    /// Also send the picture of the ultrasound probe, as the IMAGE Ultrasound; needs a graphics driver
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub image: Option<View>,
    /// Pictures per second, 0.1 to 60; fewer where one takes longer
    #[arg(long, default_value_t = 10.0, value_name = "HZ")]
    pub image_hz: f64,
    /// Width and height of the picture in pixels
    #[arg(long, default_value_t = 768, value_name = "N", value_parser = clap::value_parser!(u16).range(64..=2048))]
    pub pixels: u16,
    /// Depth of the picture, 20 to 120 mm
    #[arg(long, default_value_t = 60.0, value_name = "MM")]
    pub depth: f64,
}

fn views() -> impl TypedValueParser<Value = View> {
    PossibleValuesParser::new(["transverse", "sagittal"]).map(|name| match name.as_str() {
        "sagittal" => View::Sagittal,
        _ => View::Transverse,
    })
}

/// Option, its value, and the limits that the value is beyond.
#[derive(Debug, thiserror::Error)]
#[error("{0} {1}: {2} to {3} are possible")]
pub struct Beyond(&'static str, f64, f64, f64);

impl ImageOptions {
    /// Checks the limits of the values.
    pub fn check(&self) -> Result<(), Beyond> {
        for (option, value, least, most) in [
            ("--image-hz", self.image_hz, 0.1, 60.0),
            ("--depth", self.depth, 20.0, 120.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Beyond(option, value, least, most));
            }
        }
        Ok(())
    }
}

/// State of the core from which a picture is made.
struct Wanted {
    time: Timestamp,
    scene: Arc<SceneModel>,
    plane: Plane,
    field: Field,
    metal: Metal,
}

type Made = Result<(Timestamp, Image), NoPicture>;

/// The thread that computes pictures, and its one task.
pub struct Pictures {
    wanted: Sender<Wanted>,
    made: Receiver<Made>,
    is_busy: bool,
    next: Instant,
    every: Duration,
    view: View,
    depth_m: f64,
    pixels: [u32; 2],
    /// Why the last picture could not be made.
    pub trouble: Option<NoPicture>,
}

impl Pictures {
    /// Starts the thread; `None` if no pictures are asked for. Fails without a graphics driver.
    pub fn begin(options: &ImageOptions) -> Result<Option<Self>, NoGpu> {
        let Some(view) = options.image else { return Ok(None) };
        let mut scanner = Scanner::new(Gpu::headless(false)?);
        let (wanted, tasks) = channel();
        let (answer, made) = channel();
        // Without a thread there is no answer, as after the loss of the device.
        let _spawned = job::spawn("igtl-image", move || {
            let mut drawn = None;
            let mut made = |wanted| answer.send(picture(&mut scanner, &mut drawn, wanted)).is_ok();
            while tasks.recv().is_ok_and(&mut made) {}
            // Before the channel, whose end says that the device is gone.
            drop(scanner);
        });
        Ok(Some(Self {
            wanted,
            made,
            is_busy: false,
            next: Instant::now(),
            every: Duration::from_secs_f64(1.0 / options.image_hz),
            view,
            depth_m: options.depth * 1e-3,
            pixels: [u32::from(options.pixels); 2],
            trouble: None,
        }))
    }

    /// Publishes the picture that is ready, and asks for the next one when it is due.
    pub fn pass(&mut self, link: &Link, server: &Server, lines: &Lines) -> Result<(), CodecError> {
        let made = match self.made.try_recv() {
            Ok(made) => Some(made),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(NoPicture::Lost)),
        };
        if let Some(made) = made {
            self.is_busy = false;
            let before = std::mem::replace(&mut self.trouble, made.as_ref().err().copied());
            match made {
                Ok((time, image)) => server.send("Ultrasound", time, Body::Image(image))?,
                Err(why) if before == Some(why) => {}
                Err(why) => {
                    lines.say(format!("no ultrasound: {why}"));
                }
            }
        }
        // While one is computed, the next one is late rather than old.
        if !self.is_busy && Instant::now() >= self.next && server.has_clients() {
            self.ask(link);
        }
        Ok(())
    }

    fn ask(&mut self, link: &Link) {
        let (Some(scene), Some(snapshot), LinkStatus::Live) = (link.scene(), link.snapshot(), link.status()) else {
            return;
        };
        self.next = (self.next + self.every).max(Instant::now());
        let nodes = scene.header.nodes;
        let wanted = Wanted {
            time: Timestamp::now(),
            scene: Arc::clone(scene),
            plane: Plane {
                pose: Pose::now(&scene.header, link.second_state()),
                view: self.view,
                probe: Probe::default(),
                depth_m: self.depth_m,
                pixels: self.pixels,
            },
            field: Field::of(nodes, &snapshot.displacements_m).unwrap_or_else(|| Field::rest(nodes)),
            metal: Metal::of_snapshot(&snapshot.header, link.state()),
        };
        self.is_busy = self.wanted.send(wanted).is_ok();
    }
}

impl Drop for Pictures {
    /// Waits for the thread: a graphics driver that still computes may crash a program that ends.
    fn drop(&mut self) {
        self.wanted = channel().0;
        while self.made.recv().is_ok() {}
    }
}

fn picture(scanner: &mut Scanner, drawn: &mut Option<SceneId>, wanted: Wanted) -> Made {
    let header = &wanted.scene.header;
    if *drawn != Some(header.id()) {
        let body = Imaged::of_scene(header, &wanted.scene.labels).ok_or(NoPicture::NoLabels)?;
        scanner.set_body(&body, &wanted.field);
        *drawn = Some(header.id());
    }
    scanner.set_field(&wanted.field);
    let image = Image {
        greys: scanner.greys(&wanted.plane, &Settings::default(), &wanted.metal)?,
        size: [wanted.plane.pixels[0] as u16, wanted.plane.pixels[1] as u16, 1],
        columns: frame::picture(&header.patient(), &wanted.plane),
    };
    Ok((wanted.time, image))
}
