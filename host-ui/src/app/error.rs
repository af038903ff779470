//! Reasons why a window could not be opened.

use stylet_base::format;

/// Returns the environment's display, for messages.
pub(super) fn shown_on() -> String {
    let named = ["WAYLAND_DISPLAY", "DISPLAY"]
        .iter()
        .filter_map(|name| Some(format!("{name}={}", format::printable(&std::env::var(name).ok()?))));
    let named = named.collect::<Vec<_>>().join(", ");
    if named.is_empty() {
        "neither WAYLAND_DISPLAY nor DISPLAY is set".to_owned()
    } else {
        named
    }
}

/// Reason why the window could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// There is no display, or it does not answer.
    #[error("no display answers ({0}). Start it in a desktop, or use `host-ui procedure`, which needs no window")]
    Display(String),
    /// No graphics driver can draw.
    #[error(
        "no graphics driver can draw the window ({0}). Install mesa-vulkan-drivers, or use `host-ui procedure`, which needs no window"
    )]
    Driver(eframe::egui_wgpu::WgpuError),
    /// The recording cannot be read.
    #[error("{0} cannot be opened: {1}. 'host-ui record --out FILE.mcap' makes a recording")]
    Recording(String, std::io::Error),
    /// Any other error, as the library reports it.
    #[error("the window cannot be opened: {0}. `host-ui procedure` needs no window")]
    Other(eframe::Error),
}
