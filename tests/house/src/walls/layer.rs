//! What a row of the table of layers says, and the foreign crates that it names.

pub const WINDOW: &[&str] = &[
    "egui",
    "eframe",
    "egui_plot",
    "egui-wgpu",
    "egui_kittest",
    "wgpu",
    "winit",
];
/// Crates that compute pictures without a window use `wgpu`.
pub const TOOLKIT: &[&str] = &["egui", "eframe", "egui-wgpu", "winit"];
/// Only `shm-schema/ports` makes ports (ADR 19).
pub const PORTS: &[&str] = &["iceoryx2"];
pub const ARGUMENTS: &[&str] = &["clap"];
pub const PROGRAM: &[&str] = &["indicatif", "signal-hook"];
pub const DEVICES: &[&str] = &["evdev", "libloading"];
pub const DICOM: &[&str] = &["dicom-core", "dicom-dictionary-std", "dicom-object", "nifti"];

/// Absent from the libraries that build for `wasm32-unknown-unknown`: simulation and dose.
pub const SYSTEM: &[&str] = &["libc", "memmap2", "rustix", "tungstenite"];

/// Dependencies allowed to one crate.
pub struct Layer {
    pub folder: &'static str,
    /// Folders of our crates that its manifest may name.
    pub may_use: &'static [&'static str],
    /// External crates that neither it nor its dependencies may name.
    pub never: &'static [&'static [&'static str]],
    /// External crates that it may not name itself.
    pub not_itself: &'static [&'static [&'static str]],
}
