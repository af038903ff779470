//! Options of the window.

use clap::Args;
use std::path::PathBuf;
use stylet_host::core_args::CoreArgs;
use stylet_host::roster::{self, Trainee};

/// Options of the window.
#[derive(Args, Clone, Debug, Default)]
pub struct Options {
    /// Core and scene.
    #[command(flatten)]
    pub core: CoreArgs,
    /// Image for the slices instead of simulated ultrasound, of the patient of --scene FILE: a
    /// DICOM series (its folder, or one of its files), NIfTI-1, NRRD, MetaImage
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub image: Option<PathBuf>,
    /// Show a recording made by 'host-ui record' instead of a running rt-core; nothing in it can be
    /// moved
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "scene")]
    pub watch: Option<PathBuf>,
    /// Ignore gamepads and 3D mice: only keys and mouse move the needle
    #[arg(long)]
    pub no_controllers: bool,
    /// Draw frames without a pause, for measurements
    #[arg(long)]
    pub without_pause: bool,
    /// Print each second how many frames were drawn and their cost
    #[arg(long)]
    pub count_frames: bool,
    /// Show a square in the lower right corner that switches between dark and light when the tip
    /// has moved by 0.5 mm, for a photodiode
    #[arg(long)]
    pub patch: bool,
    /// Show a trainee in a list, with the instance of their rt-core or of a 'relay join'; may be
    /// given several times; the window follows the first
    #[arg(long = "trainee", value_name = "NAME=INSTANCE")]
    pub trainees: Vec<Trainee>,
    /// Write a debrief into DIR/NAME/DATE at the end of each procedure, for 'host-ui class'
    #[arg(long, value_name = "DIR")]
    pub class: Option<PathBuf>,
    /// Name of the operator at this window, for --class [default: the instance; with a list, the
    /// followed trainee]
    #[arg(long, value_name = "NAME", requires = "class", value_parser = roster::name)]
    pub name: Option<String>,
}
