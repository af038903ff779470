//! `stylet-demo`: the window over a core in the same process, without shared memory and without real time. A web page has
//! nothing else.

#[cfg(not(target_family = "wasm"))]
mod cli;
mod core;

#[cfg(target_family = "wasm")]
fn main() {
    host_ui::web::start(core::home(core::SCENE, Default::default()));
}

#[cfg(not(target_family = "wasm"))]
fn main() -> std::process::ExitCode {
    cli::run()
}
