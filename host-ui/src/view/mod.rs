//! Pictures of the body: the deforming gland, the needle and the seeds, in three dimensions and in
//! slices.

mod body;
mod camera;
mod collected;
mod draw;
pub(crate) mod driver;
mod fluoro;
pub(crate) mod free;
mod gpu;
pub(crate) mod kinds;
mod legend;
mod marks;
pub mod middle;
pub mod orientation;
pub(crate) mod paste;
mod pick;
pub mod probe;
mod scene3d;
pub mod slice;
pub(crate) mod state;
mod uniforms;
