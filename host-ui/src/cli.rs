//! The command line of `host-ui`.

use crate::app;
use crate::command::CommandError;
use crate::command::picture::PictureArgs;
use clap::{CommandFactory, Parser, Subcommand};
use std::rc::Rc;
use stylet_controllers as controller;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_host::link::Link;
use stylet_host::{health, record};
use stylet_implant::procedure;
use stylet_manual::{ManualArgs, Product};
use stylet_shm_schema::Instance;

/// Commands on files, of OpenIGTLink, and the demonstration.
pub const PRODUCTS: [Product; 3] = [
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
            "sources",
        ],
    },
    Product {
        program: "stylet-igtl",
        commands: &["igtl"],
    },
    Product {
        program: "stylet-demo",
        commands: &["demo"],
    },
];

/// Operator's program of Stylet, a haptic simulator of prostate brachytherapy.
///
/// Start `rt-core` first, then `host-ui` for the window; `host-ui demo` needs no `rt-core`.
/// `host-ui procedure` implants the seeds of the default plan without a window and writes the
/// results. In the window, keys, mouse, a gamepad or a 3D mouse hold the needle: F1 lists their
/// functions, `host-ui controllers` lists the connected ones.
#[derive(Parser, Debug)]
#[command(name = "host-ui", version, args_conflicts_with_subcommands = true, after_help = stylet_manual::list("host-ui", &PRODUCTS))]
pub struct Cli {
    #[command(flatten)]
    window: app::Options,
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
    Procedure(procedure::Options),
    /// Record every tick of the force loop and the tissue's snapshots in an MCAP file, and count
    /// losses
    Record(record::Options),
    /// Say how many ticks of a running core succeed, of the last 100 and of all watched ones, also for a monitoring
    /// system; a tick succeeds if its force leaves within its period
    Health(health::Options),
    /// Convert a recording into a table, or into a motion for rt-core's replay device
    Export(record::Export),
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
                let mut window = self.window;
                if window.image.is_some() && window.core.file().is_none() {
                    return Err("--image belongs to a patient: give the segmentation with --scene FILE".into());
                }
                together(&[window.core.file(), window.image.as_deref()], Shared::Frame)?;
                let mut instances = window.trainees.iter().map(|trainee| trainee.instance.clone());
                window.core.instance = instances.next().unwrap_or(window.core.instance);
                let instances: Vec<Instance> = instances.chain([window.core.instance.clone()]).collect();
                let ended = app::run(window, Rc::new(Link::new));
                instances.iter().for_each(Instance::sweep);
                Ok(ended?)
            }
            Some(Task::Controllers) => Ok(controller::list()?),
            Some(Task::Record(options)) => {
                let ended = record::run(&options);
                options.instance.sweep();
                Ok(ended?)
            }
            Some(Task::Health(options)) => {
                let ended = health::run(&options);
                options.instance.sweep();
                Ok(ended?)
            }
            Some(Task::Export(options)) => Ok(record::export(&options)?),
            Some(Task::Flight { instance }) => {
                println!("written: {}", record::save_flight(&instance)?);
                Ok(())
            }
            Some(Task::Picture(args)) => args.run(),
            Some(Task::Manual(args)) => Ok(args.run(Self::command())?),
            Some(Task::Procedure(options)) => {
                together(&[options.core.file(), options.plan.as_deref()], Shared::Frame)?;
                let instance = options.core.instance.clone();
                let ended = procedure::run(options);
                instance.sweep();
                Ok(ended?)
            }
        }
    }
}
