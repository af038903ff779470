//! The command line of `host-ui`.

use crate::app;
use crate::command::CommandError;
use crate::command::export::ExportArgs;
use crate::command::picture::PictureArgs;
use crate::command::record::RecordArgs;
use clap::{CommandFactory, Parser, Subcommand};
use std::path::PathBuf;
use stylet_controllers as controller;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_host::core_args::CoreArgs;
use stylet_host::record;
use stylet_host::roster::{self, Trainee};
use stylet_implant::procedure;
use stylet_manual::{ManualArgs, Product};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{MAX_LEFT_NEEDLES, ParameterChange};

/// Commands on files, and of OpenIGTLink.
pub const PRODUCTS: [Product; 2] = [
    Product {
        program: "stylet-clinic",
        commands: &[
            "scene",
            "convert",
            "dicom",
            "plan",
            "dose",
            "find-seeds",
            "post-implant",
            "compare",
            "perturb",
            "study",
            "class",
        ],
    },
    Product {
        program: "stylet-igtl",
        commands: &["igtl"],
    },
];

/// Operator's program of Stylet, a haptic simulator of prostate brachytherapy.
///
/// Start `rt-core` first, then `host-ui` for the window. `host-ui procedure` implants the seeds of
/// the default plan without a window and writes the results. In the window, keys, mouse, a gamepad
/// or a 3D mouse hold the needle: F1 lists their functions, `host-ui controllers` lists the
/// connected ones.
#[derive(Parser, Debug)]
#[command(name = "host-ui", version, args_conflicts_with_subcommands = true, after_help = stylet_manual::list("host-ui", &PRODUCTS))]
pub struct Cli {
    #[command(flatten)]
    window: CoreArgs,
    /// Image for the slices instead of simulated ultrasound, of the patient of --scene FILE: a
    /// DICOM series (its folder, or one of its files), NIfTI-1, NRRD, MetaImage
    #[arg(long, value_name = "FILE", requires = "scene")]
    image: Option<PathBuf>,
    /// Show a recording made by 'host-ui record' instead of a running rt-core; nothing in it can be
    /// moved
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "scene")]
    watch: Option<PathBuf>,
    /// Ignore gamepads and 3D mice: only keys and mouse move the needle
    #[arg(long)]
    no_controllers: bool,
    /// Draw frames without a pause, for measurements
    #[arg(long)]
    without_pause: bool,
    /// Print each second how many frames were drawn and their cost
    #[arg(long)]
    count_frames: bool,
    /// Show a square in the lower right corner that switches between dark and light when the tip
    /// has moved by 0.5 mm, for a photodiode
    #[arg(long)]
    patch: bool,
    /// Show a trainee in a list, with the instance of their rt-core or of a 'relay join'; may be
    /// given several times; the window follows the first
    #[arg(long = "trainee", value_name = "NAME=INSTANCE", value_parser = trainee)]
    trainees: Vec<Trainee>,
    /// Write a debrief into DIR/NAME/DATE at the end of each procedure, for 'host-ui class'
    #[arg(long, value_name = "DIR")]
    class: Option<PathBuf>,
    /// Name of the operator at this window, for --class [default: the instance; with a list, the
    /// followed trainee]
    #[arg(long, value_name = "NAME", requires = "class", value_parser = name)]
    name: Option<String>,
    #[command(subcommand)]
    task: Option<Task>,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// List the connected gamepads and 3D mice, their access rights, and the functions of their
    /// axes and buttons
    Controllers,
    /// Plan, place the needles, insert, drop the seeds while retracting; write result.json,
    /// force.csv and, for a plan, a debrief
    Procedure {
        #[command(flatten)]
        common: CoreArgs,
        /// Folder for the results [default: out/procedure-<UTC time>]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Start this rt-core when none is running, and end it afterwards
        #[arg(long, value_name = "PATH")]
        core: Option<PathBuf>,
        /// Speed of insertion in mm/s [default: that of the scene file, or 50]
        #[arg(long, value_name = "MM/S")]
        insert_speed: Option<f64>,
        /// Plan of many needles (TOML) from 'host-ui plan' [default: that of the scene file, or one
        /// needle through the middle]
        #[arg(long, value_name = "FILE")]
        plan: Option<PathBuf>,
        /// Rehearse every needle first, and shift the drops so that each seed comes to rest on plan
        #[arg(long)]
        compensate: bool,
        /// Insert this many stabilising needles first, 0 to 4; they leave no seed, hold the gland
        /// during the implant, and are withdrawn at the end
        #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=MAX_LEFT_NEEDLES as i64))]
        stabilise: u8,
        /// Source file for the score [default: the source that the plan names, 6711 or 200]
        #[arg(long, value_name = "FILE")]
        source: Option<PathBuf>,
        /// Set a parameter before anything else, in the window's unit, such as
        /// needle.bending_stiffness=0.016; may be given several times, and stays in force in the
        /// core
        #[arg(long = "set", value_name = "KEY=VALUE", value_parser = procedure::parameter)]
        parameters: Vec<ParameterChange>,
        /// Turn the force on although a fault stands; without this the procedure does not begin,
        /// because only a person re-arms after a fault
        #[arg(long)]
        rearm: bool,
        /// Seeds along the needle, 1 to 128, if no plan is given
        #[arg(long, default_value_t = 5, conflicts_with = "plan", value_parser = clap::value_parser!(u16).range(1..=128))]
        seeds: u16,
    },
    /// Record every tick of the force loop and the tissue's snapshots in an MCAP file, and count
    /// losses
    Record(RecordArgs),
    /// Convert a recording into a table, or into a motion for rt-core's replay device
    Export(ExportArgs),
    /// Let rt-core write its flight recording: the last seconds of both loops, for 'rt-core replay'
    Flight {
        /// Name under which rt-core was started
        #[arg(long, default_value = "main", value_parser = Instance::new)]
        instance: Instance,
    },
    /// Write the ultrasound of a probe, or a radiograph of a C-arm, of the running scene, as PNG
    Picture(PictureArgs),
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

impl Cli {
    /// Executes the command.
    ///
    /// # Errors
    ///
    /// The text for the terminal: the failure and its remedy.
    pub fn run(self) -> Result<(), CommandError> {
        if self.task.is_some() {
            stylet_manual::end_with_reader();
        }
        match self.task {
            None => {
                if self.image.is_some() && self.window.file().is_none() {
                    return Err("--image belongs to a patient: give the segmentation with --scene FILE".into());
                }
                together(&[self.window.file(), self.image.as_deref()], Shared::Frame)?;
                let first = self.trainees.first().map(|trainee| trainee.instance.clone());
                let instance = first.unwrap_or(self.window.instance);
                let others: Vec<Instance> = self.trainees.iter().skip(1).map(|t| t.instance.clone()).collect();
                let ended = app::run(app::Options {
                    instance: instance.clone(),
                    scene: self.window.scene,
                    label: self.window.label,
                    image: self.image,
                    watch: self.watch,
                    controllers: !self.no_controllers,
                    pause: !self.without_pause,
                    count_frames: self.count_frames,
                    patch: self.patch,
                    trainees: self.trainees,
                    class: self.class,
                    name: self.name.unwrap_or_else(|| instance.name().to_owned()),
                });
                others.iter().for_each(Instance::sweep);
                instance.sweep();
                Ok(ended?)
            }
            Some(Task::Controllers) => Ok(controller::list()?),
            Some(Task::Record(args)) => args.run(),
            Some(Task::Export(args)) => Ok(args.run()?),
            Some(Task::Flight { instance }) => {
                println!("written: {}", record::save_flight(&instance)?);
                Ok(())
            }
            Some(Task::Picture(args)) => args.run(),
            Some(Task::Manual(args)) => Ok(args.run(Self::command())?),
            Some(Task::Procedure {
                common,
                out,
                core,
                insert_speed,
                plan,
                compensate,
                stabilise,
                source,
                parameters,
                rearm,
                seeds,
            }) => {
                if let Some(speed) = insert_speed.filter(|s| !(0.1..=500.0).contains(s)) {
                    return Err(format!("--insert-speed {speed}: give 0.1 to 500 mm/s").into());
                }
                together(&[common.file(), plan.as_deref()], Shared::Frame)?;
                let instance = common.instance.clone();
                let ended = procedure::run(procedure::Options {
                    connect: procedure::Connect { asked: common, core },
                    out,
                    insert_m_per_s: insert_speed.map(|s| s / 1e3),
                    seeds: usize::from(seeds),
                    plan,
                    compensate,
                    stabilise: usize::from(stabilise),
                    source,
                    parameters,
                    rearm,
                });
                instance.sweep();
                Ok(ended?)
            }
        }
    }
}

fn name(text: &str) -> Result<String, String> {
    match roster::is_name(text) {
        true => Ok(text.to_owned()),
        false => Err("a name is 1 to 60 letters, digits, spaces, '-', '_' or '.', and begins with no '.'".to_owned()),
    }
}

fn trainee(text: &str) -> Result<Trainee, String> {
    let (who, instance) = text.split_once('=').ok_or("give NAME=INSTANCE, such as Otto=seat-1")?;
    Ok(Trainee {
        name: name(who)?,
        instance: Instance::new(instance).map_err(|e| e.to_string())?,
    })
}
