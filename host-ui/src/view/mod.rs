//! What is drawn of the body: the deforming gland, the needle and the seeds, in three dimensions.

pub mod camera;
mod gpu;
mod marks;
mod mesh;
pub mod scene3d;
