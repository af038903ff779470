//! Opens the window in a desktop.

use super::error::{WindowError, shown_on};
use super::{App, Home, Options};
use stylet_base::format;

/// Opens the window over the core that `home` connects to, and returns when it is closed.
///
/// # Errors
///
/// Without a display or a graphics driver, or if the recording to watch cannot be opened.
pub fn run(options: Options, home: Home) -> Result<(), WindowError> {
    if let Some(path) = &options.watch {
        let name = || format::printable(&path.display().to_string());
        std::fs::File::open(path).map_err(|why| WindowError::Recording(name(), why))?;
    }
    let mut native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Stylet")
            .with_app_id("stylet")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([960.0, 600.0])
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        ..Default::default()
    };
    if options.without_pause {
        native.wgpu_options.surface.present_mode = eframe::wgpu::PresentMode::AutoNoVsync;
    }
    let create: eframe::AppCreator<'_> = Box::new(|cc| Ok(Box::new(App::with_home(cc, options, home))));
    eframe::run_native("Stylet", native, create).map_err(|why| match why {
        eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_) => WindowError::Display(shown_on()),
        eframe::Error::Wgpu(why) => WindowError::Driver(why),
        other => WindowError::Other(other),
    })
}
