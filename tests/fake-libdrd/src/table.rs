//! The published interface, typed independently of the code under test, so that a wrong name or type fails.

/// Source of a declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// In `dhdc.h` of SDK 3.17.5 (github chai3d/chai3d, 7c76b1f) and, with the same types, in that of 3.7.0 (CHAI3D
    /// 3.2).
    Both,
    /// Only in `dhdc.h` of SDK 3.17.5.
    Newer,
}

/// A function of the interface.
#[derive(Clone, Copy, Debug)]
pub struct Function {
    /// Its name.
    pub name: &'static str,
    /// Its declaration in C without the name: the result, and the types of the arguments.
    pub c: &'static str,
    /// Source of the declaration.
    pub source: Source,
    /// The library is useless without it.
    pub required: bool,
}

const fn required(name: &'static str, c: &'static str) -> Function {
    Function {
        name,
        c,
        source: Source::Both,
        required: true,
    }
}

const fn optional(name: &'static str, c: &'static str, source: Source) -> Function {
    Function {
        name,
        c,
        source,
        required: false,
    }
}

/// Number of functions.
pub const COUNT: usize = 23;

/// Every function that the fake exports.
pub const FUNCTIONS: [Function; COUNT] = [
    required("dhdErrorGetLast", "int ()"),
    required("dhdGetDeviceCount", "int ()"),
    required("dhdOpenID", "int (char)"),
    required("dhdClose", "int (char)"),
    required("dhdStop", "int (char)"),
    required("dhdEnableForce", "int (uchar, char)"),
    required("dhdGetSystemType", "int (char)"),
    required("dhdGetStatus", "int (int*, char)"),
    required("dhdGetButtonMask", "uint (char)"),
    required(
        "dhdGetPositionAndOrientationFrame",
        "int (double*, double*, double*, double(*)[3], char)",
    ),
    required(
        "dhdSetForceAndTorqueAndGripperForce",
        "int (double, double, double, double, double, double, double, char)",
    ),
    optional("dhdGetSDKVersion", "void (int*, int*, int*, int*)", Source::Both),
    optional("dhdGetSystemName", "const char* (char)", Source::Both),
    optional("dhdGetSerialNumber", "int (ushort*, char)", Source::Both),
    optional("dhdHasActiveWrist", "bool (char)", Source::Both),
    optional("dhdGetComFreq", "double (char)", Source::Both),
    optional("dhdEnableExpertMode", "int ()", Source::Both),
    optional("dhdDisableExpertMode", "int ()", Source::Both),
    optional("dhdSetTimeGuard", "int (int, char)", Source::Both),
    optional("dhdSetWatchdog", "int (uchar, char)", Source::Both),
    optional("dhdGetWatchdog", "int (uchar*, char)", Source::Both),
    optional("dhdSetMaxForce", "int (double, char)", Source::Newer),
    optional("dhdSetMaxTorque", "int (double, char)", Source::Newer),
];

/// Name of every error, by its number minus one.
pub const ERRORS: [&str; 22] = [
    "DHD_ERROR",
    "DHD_ERROR_COM",
    "DHD_ERROR_DHC_BUSY",
    "DHD_ERROR_NO_DRIVER_FOUND",
    "DHD_ERROR_NO_DEVICE_FOUND",
    "DHD_ERROR_NOT_AVAILABLE",
    "DHD_ERROR_TIMEOUT",
    "DHD_ERROR_GEOMETRY",
    "DHD_ERROR_EXPERT_MODE_DISABLED",
    "DHD_ERROR_NOT_IMPLEMENTED",
    "DHD_ERROR_OUT_OF_MEMORY",
    "DHD_ERROR_DEVICE_NOT_READY",
    "DHD_ERROR_FILE_NOT_FOUND",
    "DHD_ERROR_CONFIGURATION",
    "DHD_ERROR_INVALID_INDEX",
    "DHD_ERROR_DEPRECATED",
    "DHD_ERROR_NULL_ARGUMENT",
    "DHD_ERROR_REDUNDANT_FAIL",
    "DHD_ERROR_NOT_ENABLED",
    "DHD_ERROR_DEVICE_IN_USE",
    "DHD_ERROR_INVALID",
    "DHD_ERROR_NO_REGULATION",
];

/// Entries of the status array, in order.
pub const STATUS: [&str; 17] = [
    "POWER",
    "CONNECTED",
    "STARTED",
    "RESET",
    "IDLE",
    "FORCE",
    "BRAKE",
    "TORQUE",
    "WRIST_DETECTED",
    "ERROR",
    "GRAVITY",
    "TIMEGUARD",
    "WRIST_INIT",
    "REDUNDANCY",
    "FORCE_OFF_CAUSE",
    "LOCKS",
    "AXIS_CHECKED",
];

/// Returns the index of a function in [`FUNCTIONS`].
///
/// # Panics
///
/// If the interface has no such function.
pub fn index_of(function: &str) -> usize {
    let found = FUNCTIONS.iter().position(|f| f.name == function);
    found.expect("a function of the interface")
}
