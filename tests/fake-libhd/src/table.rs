//! The interface as the vendor documents it, typed independently of the code under test, so that a wrong number fails.

/// Every exported function: those of the vendor that a device needs.
pub const FUNCTIONS: [&str; 22] = [
    "hdInitDevice",
    "hdDisableDevice",
    "hdMakeCurrentDevice",
    "hdBeginFrame",
    "hdEndFrame",
    "hdGetError",
    "hdEnable",
    "hdDisable",
    "hdIsEnabled",
    "hdGetIntegerv",
    "hdGetDoublev",
    "hdGetString",
    "hdSetDoublev",
    "hdCheckCalibration",
    "hdCheckCalibrationStyle",
    "hdUpdateCalibration",
    "hdStartScheduler",
    "hdStopScheduler",
    "hdSetSchedulerRate",
    "hdScheduleAsynchronous",
    "hdUnschedule",
    "hdWaitForCompletion",
];

/// Number and name of every error.
pub const ERRORS: [(u32, &str); 22] = [
    (0x0000, "HD_SUCCESS"),
    (0x0100, "HD_INVALID_ENUM"),
    (0x0101, "HD_INVALID_VALUE"),
    (0x0102, "HD_INVALID_OPERATION"),
    (0x0103, "HD_INVALID_INPUT_TYPE"),
    (0x0104, "HD_BAD_HANDLE"),
    (0x0200, "HD_WARM_MOTORS"),
    (0x0201, "HD_EXCEEDED_MAX_FORCE"),
    (0x0202, "HD_EXCEEDED_MAX_FORCE_IMPULSE"),
    (0x0203, "HD_EXCEEDED_MAX_VELOCITY"),
    (0x0204, "HD_FORCE_ERROR"),
    (0x0300, "HD_DEVICE_FAULT"),
    (0x0301, "HD_DEVICE_ALREADY_INITIATED"),
    (0x0302, "HD_COMM_ERROR"),
    (0x0303, "HD_COMM_CONFIG_ERROR"),
    (0x0304, "HD_TIMER_ERROR"),
    (0x0400, "HD_ILLEGAL_BEGIN"),
    (0x0401, "HD_ILLEGAL_END"),
    (0x0402, "HD_FRAME_ERROR"),
    (0x0500, "HD_INVALID_PRIORITY"),
    (0x0501, "HD_SCHEDULER_FULL"),
    (0x0600, "HD_INVALID_LICENSE"),
];

/// Type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `int`.
    Ints,
    /// `double`.
    Reals,
    /// String.
    Text,
}

/// Readable parameters: number, kind, count.
pub const PARAMETERS: &[(u32, Kind, usize)] = &[
    (0x2000, Kind::Ints, 1),
    (0x2050, Kind::Reals, 3),
    (0x2051, Kind::Reals, 3),
    (0x2052, Kind::Reals, 16),
    (0x2053, Kind::Reals, 3),
    (0x2100, Kind::Reals, 3),
    (0x2150, Kind::Reals, 3),
    (0x2500, Kind::Text, 1),
    (0x2501, Kind::Text, 1),
    (0x2502, Kind::Text, 1),
    (0x2503, Kind::Text, 1),
    (0x2504, Kind::Text, 1),
    (0x2505, Kind::Reals, 1),
    (0x2550, Kind::Reals, 6),
    (0x2551, Kind::Reals, 6),
    (0x2553, Kind::Ints, 1),
    (0x2554, Kind::Ints, 1),
    (0x2555, Kind::Ints, 1),
    (0x2600, Kind::Ints, 1),
    (0x2601, Kind::Reals, 1),
    (0x2602, Kind::Reals, 1),
    (0x2603, Kind::Reals, 1),
    (0x2604, Kind::Reals, 1),
    (0x2605, Kind::Reals, 6),
    (0x2606, Kind::Reals, 1),
    (0x2700, Kind::Reals, 3),
    (0x2703, Kind::Reals, 3),
    (0x2704, Kind::Reals, 3),
    (0x2900, Kind::Ints, 1),
];
