<<<<<<< HEAD
//! The real-time process: scenes, tissue, force loop.

pub mod scene;
pub mod tissue;
=======
//! The real-time process: device, force loop, tissue.

pub mod force;
pub mod needle;
>>>>>>> force
