//! The table of layers: a row for each crate.

const WINDOW: &[&str] = &[
    "egui",
    "eframe",
    "egui_plot",
    "egui-wgpu",
    "egui_kittest",
    "wgpu",
    "winit",
];
/// Crates that compute pictures without a window use `wgpu`.
const TOOLKIT: &[&str] = &["egui", "eframe", "egui-wgpu", "winit"];
/// Only `shm-schema/ports` makes ports (ADR 19).
const PORTS: &[&str] = &["iceoryx2"];
const ARGUMENTS: &[&str] = &["clap"];
const PROGRAM: &[&str] = &["indicatif", "signal-hook"];
const DEVICES: &[&str] = &["evdev", "libloading"];
const DICOM: &[&str] = &["dicom-core", "dicom-dictionary-std", "dicom-object", "nifti"];

/// Absent from the libraries that build for `wasm32-unknown-unknown`: simulation and dose.
const SYSTEM: &[&str] = &["libc", "memmap2", "rustix", "tungstenite"];

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

/// From the bottom up: a crate uses those above it in this table. A new crate needs a row; a row may precede its crate.
pub const LAYERS: &[Layer] = &[
    // Tests: those of the relay use one of its packages.
    Layer {
        folder: "tests/kit",
        may_use: &[],
        never: &[WINDOW, PORTS, DEVICES, DICOM],
        not_itself: &[],
    },
    // Below both sides.
    Layer {
        folder: "hw/device",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "hw",
        may_use: &["hw/device"],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/anatomy",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/text",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/random",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/report",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/write",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/manual",
        may_use: &["shm-schema/write"],
        never: &[WINDOW, PORTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/insertions",
        may_use: &["shm-schema/write"],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/settings",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema",
        may_use: &["shm-schema/anatomy", "shm-schema/settings", "shm-schema/random"],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/ports",
        may_use: &["shm-schema"],
        never: &[WINDOW, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/wall",
        may_use: &["shm-schema"],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "shm-schema/procedure",
        may_use: &["shm-schema", "shm-schema/anatomy"],
        never: &[WINDOW, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[PORTS],
    },
    // The real-time side.
    Layer {
        folder: "rt-core/heap",
        may_use: &[],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "rt-core/sim",
        may_use: &[
            "hw/device",
            "rt-core/heap",
            "shm-schema/anatomy",
            "shm-schema/settings",
            "shm-schema/random",
            "tests/kit",
        ],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[SYSTEM],
    },
    Layer {
        folder: "rt-core/runtime",
        may_use: &[
            "shm-schema/procedure",
            "rt-core/heap",
            "hw",
            "rt-core/sim",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/wall",
            "shm-schema/random",
            "tests/kit",
        ],
        // The process that owns the device never communicates with hosts itself.
        never: &[WINDOW, PORTS, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "rt-core/lab",
        may_use: &[
            "rt-core/heap",
            "hw",
            "rt-core/runtime",
            "rt-core/sim",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/wall",
            "shm-schema/manual",
            "shm-schema/report",
            "shm-schema/write",
            "shm-schema/text",
            "shm-schema/random",
        ],
        never: &[WINDOW, PORTS, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "rt-core/study",
        may_use: &[
            "shm-schema/insertions",
            "shm-schema/procedure",
            "hw",
            "rt-core/runtime",
            "rt-core/sim",
            "shm-schema",
            "shm-schema/manual",
            "shm-schema/write",
            "shm-schema/text",
        ],
        never: &[WINDOW, PORTS, DICOM],
        not_itself: &[DEVICES],
    },
    Layer {
        folder: "rt-core",
        may_use: &[
            "rt-core/heap",
            "hw",
            "rt-core/runtime",
            "rt-core/sim",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/manual",
            "shm-schema/text",
        ],
        never: &[WINDOW, PORTS, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "rt-core/bridge",
        may_use: &["shm-schema", "shm-schema/ports", "shm-schema/wall"],
        never: &[WINDOW, ARGUMENTS, PROGRAM, DEVICES, DICOM],
        not_itself: &[PORTS],
    },
    // The host's side.
    Layer {
        folder: "host-ui/base",
        may_use: &["shm-schema/anatomy", "shm-schema/write", "shm-schema/text"],
        never: &[WINDOW, PORTS, DEVICES, DICOM],
        not_itself: &[],
    },
    Layer {
        folder: "host-ui/files",
        may_use: &["host-ui/base", "shm-schema", "shm-schema/anatomy", "shm-schema/random"],
        never: &[WINDOW, DEVICES],
        not_itself: &[PORTS],
    },
    Layer {
        folder: "host-ui/dose",
        may_use: &["shm-schema/anatomy", "shm-schema/report", "shm-schema/random"],
        never: &[WINDOW, PORTS, ARGUMENTS, PROGRAM, DEVICES, DICOM, SYSTEM],
        not_itself: &[],
    },
    Layer {
        folder: "host-ui/surfaces",
        may_use: &["shm-schema"],
        never: &[WINDOW, DEVICES, DICOM],
        not_itself: &[PORTS, ARGUMENTS],
    },
    Layer {
        folder: "host-ui/imaging",
        may_use: &["host-ui/surfaces", "shm-schema", "shm-schema/anatomy"],
        never: &[TOOLKIT, DEVICES, DICOM],
        not_itself: &[PORTS, ARGUMENTS],
    },
    Layer {
        folder: "host-ui/recordings",
        may_use: &["host-ui/base", "host-ui/surfaces", "shm-schema"],
        never: &[WINDOW, PORTS, DEVICES, DICOM],
        not_itself: &[ARGUMENTS, PROGRAM],
    },
    Layer {
        folder: "host-ui/host",
        may_use: &[
            "host-ui/base",
            "host-ui/files",
            "host-ui/recordings",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/ports",
        ],
        never: &[WINDOW, DEVICES],
        not_itself: &[PORTS, DICOM],
    },
    Layer {
        folder: "host-ui/implant",
        may_use: &[
            "shm-schema/procedure",
            "host-ui/base",
            "host-ui/dose",
            "host-ui/files",
            "host-ui/host",
            "host-ui/surfaces",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/report",
            "shm-schema/random",
        ],
        never: &[WINDOW, DEVICES],
        not_itself: &[PORTS],
    },
    Layer {
        folder: "host-ui/population",
        may_use: &[
            "shm-schema/insertions",
            "shm-schema/report",
            "host-ui/base",
            "host-ui/dose",
            "host-ui/files",
            "host-ui/implant",
        ],
        never: &[WINDOW, DEVICES],
        not_itself: &[PORTS, ARGUMENTS],
    },
    Layer {
        // Its pictures of the probe are those of `host-ui picture`.
        folder: "host-ui/igtl",
        may_use: &[
            "host-ui/base",
            "host-ui/host",
            "host-ui/imaging",
            "host-ui/surfaces",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/manual",
            "shm-schema/random",
        ],
        never: &[TOOLKIT, DEVICES],
        not_itself: &[PORTS, DICOM],
    },
    Layer {
        folder: "host-ui/relay",
        may_use: &[
            "shm-schema",
            "shm-schema/manual",
            "shm-schema/ports",
            "shm-schema/random",
            "tests/kit",
        ],
        never: &[WINDOW, DEVICES, DICOM],
        not_itself: &[PORTS],
    },
    Layer {
        folder: "host-ui/controllers",
        may_use: &["host-ui/base"],
        never: &[WINDOW, PORTS, DICOM],
        not_itself: &[ARGUMENTS, PROGRAM],
    },
    Layer {
        folder: "host-ui/clinic",
        may_use: &[
            "host-ui/base",
            "host-ui/dose",
            "host-ui/files",
            "host-ui/host",
            "host-ui/implant",
            "host-ui/population",
            "host-ui/surfaces",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/manual",
            "shm-schema/report",
        ],
        never: &[WINDOW, DEVICES],
        not_itself: &[PORTS, DICOM],
    },
    Layer {
        folder: "host-ui",
        may_use: &[
            "shm-schema/procedure",
            "host-ui/base",
            "host-ui/controllers",
            "host-ui/dose",
            "host-ui/files",
            "host-ui/host",
            "host-ui/imaging",
            "host-ui/implant",
            "host-ui/surfaces",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/manual",
            "shm-schema/random",
            "tests/kit",
        ],
        never: &[],
        not_itself: &[PORTS],
    },
    // For scripts of either side, without a process of its own.
    Layer {
        folder: "rt-core/python",
        may_use: &[
            "host-ui/base",
            "host-ui/dose",
            "host-ui/files",
            "host-ui/recordings",
            "hw",
            "rt-core/runtime",
            "rt-core/sim",
            "rt-core/study",
            "shm-schema",
            "shm-schema/anatomy",
            "shm-schema/insertions",
            "shm-schema/procedure",
        ],
        never: &[WINDOW, PORTS],
        not_itself: &[ARGUMENTS, PROGRAM, DEVICES, DICOM, SYSTEM],
    },
];

/// Crates for tests and measurements: they may use every crate, and no other crate may use them.
pub const OUTSIDE: &[&str] = &["tests", "tests/fake-libhd", "benches"];
