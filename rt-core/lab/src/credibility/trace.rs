//! Requirements that control the hazards, each with the tests that fail if it does not hold.

use serde::Serialize;

/// Requirement on the software.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Requirement {
    /// Id; those of limits are the ids of `rt-core latency`.
    pub id: &'static str,
    pub what: &'static str,
    pub hazards: &'static [&'static str],
    /// File of the repository and test function, or the program that measures it.
    pub tests: &'static [(&'static str, &'static str)],
}

const LATENCY: &[(&str, &str)] = &[(
    "tests/tests/system/lab_latency.rs",
    "report_holds_the_whole_path_and_the_loops_stayed_clean",
)];

/// Returns a limit of `rt-core latency`.
const fn limit(id: &'static str, what: &'static str, hazards: &'static [&'static str]) -> Requirement {
    Requirement {
        id,
        what,
        hazards,
        tests: LATENCY,
    }
}

pub const REQUIREMENTS: &[Requirement] = &[
    Requirement {
        id: "REQ-FORCE-001",
        what: "Magnitude and rate of the force stay within the limits of settings and device, whatever is asked for.",
        hazards: &["HAZ-01", "HAZ-03"],
        tests: &[
            (
                "rt-core/sim/src/force/gate/tests.rs",
                "neither_magnitude_nor_slew_is_ever_exceeded",
            ),
            (
                "rt-core/sim/src/force/gate/tests.rs",
                "the_device_limit_holds_whatever_the_settings_say",
            ),
        ],
    },
    Requirement {
        id: "REQ-FORCE-002",
        what: "A force that is no number becomes zero within the ramp, and is reported.",
        hazards: &["HAZ-01", "HAZ-08"],
        tests: &[(
            "rt-core/sim/src/force/gate/tests.rs",
            "a_force_that_is_nan_ramps_to_zero_and_reports",
        )],
    },
    Requirement {
        id: "REQ-FORCE-003",
        what: "Motors that are warm get no more than their continuous force.",
        hazards: &["HAZ-04"],
        tests: &[(
            "rt-core/sim/src/force/gate/tests.rs",
            "warm_motors_get_no_more_than_their_continuous_force",
        )],
    },
    Requirement {
        id: "REQ-FORCE-004",
        what: "No hand of the envelope makes the loop vibrate, at any lateness that the watchdog permits.",
        hazards: &["HAZ-03"],
        tests: &[
            (
                "tests/physics/src/envelope.rs",
                "no_hand_of_the_envelope_makes_the_loop_sing_at_any_lateness_anywhere",
            ),
            (
                "tests/physics/src/envelope/on_line.rs",
                "no_hand_sings_on_a_line_in_tissue_of_any_stiffness",
            ),
            (
                "tests/physics/src/z_width.rs",
                "below_the_bound_no_wall_sings_at_any_rate_and_well_above_it_does",
            ),
        ],
    },
    Requirement {
        id: "REQ-SAFE-001",
        what: "Each fault of the watchdog takes the force to zero within 20 ticks; none is raised in ordinary operation.",
        hazards: &["HAZ-02"],
        tests: &[
            (
                "rt-core/runtime/src/rt/watchdog/tests.rs",
                "every_cause_ramps_the_force_out_in_time_and_the_operator_can_rearm",
            ),
            (
                "tests/tests/system/process_loops.rs",
                "tissue_that_stops_takes_the_force_off_and_the_operator_rearms",
            ),
        ],
    },
    Requirement {
        id: "REQ-SAFE-002",
        what: "A force loop that stops over motors ends the process; over none, and after a process was stopped, the force stays off.",
        hazards: &["HAZ-02"],
        tests: &[
            (
                "tests/tests/system/device_procedure.rs",
                "a_stopped_force_loop_over_a_phantom_ends_the_core_with_a_recording",
            ),
            (
                "tests/tests/system/process_loops.rs",
                "a_stopped_simulated_force_loop_is_waited_for_with_the_force_off",
            ),
            (
                "tests/tests/system/process_loops.rs",
                "a_core_that_is_stopped_whole_and_goes_on_turns_the_force_off_and_lives",
            ),
        ],
    },
    Requirement {
        id: "REQ-SAFE-003",
        what: "A host that dies, stops or floods the core cannot be felt.",
        hazards: &["HAZ-02", "HAZ-08"],
        tests: &[
            (
                "tests/tests/system/kill.rs",
                "killing_hosts_in_an_insertion_adds_no_gap",
            ),
            (
                "tests/tests/system/process_hosts.rs",
                "the_operator_can_release_under_a_flood_that_disturbs_no_loop",
            ),
        ],
    },
    limit("REQ-LAT-001", "Wake-up of the force loop, p50.", &["HAZ-03"]),
    limit("REQ-LAT-002", "Wake-up of the force loop, p99.", &["HAZ-03"]),
    limit("REQ-LAT-003", "Wake-up of the force loop, p99.9.", &["HAZ-03"]),
    limit(
        "REQ-LAT-004",
        "Latest wake-up of the force loop.",
        &["HAZ-02", "HAZ-03"],
    ),
    limit("REQ-LAT-005", "Jitter of the period, p99.", &["HAZ-03"]),
    limit("REQ-LAT-006", "Own work of a tick, p99.", &["HAZ-03"]),
    limit("REQ-LAT-007", "Own work of a tick, p99.9.", &["HAZ-03"]),
    limit("REQ-LAT-008", "Device read to force written, p99.9.", &["HAZ-03"]),
    limit("REQ-LAT-009", "Missed deadlines.", &["HAZ-02", "HAZ-03"]),
    limit("REQ-LAT-010", "Overruns.", &["HAZ-02", "HAZ-03"]),
    limit("REQ-LAT-011", "Tip moved to tissue answered, p99.", &["HAZ-05"]),
    limit("REQ-LAT-012", "Tip moved to host saw it, p99.", &["HAZ-05"]),
    limit(
        "REQ-LAT-013",
        "Stiffest stable wall at p99.9 of the delay.",
        &["HAZ-03"],
    ),
    Requirement {
        id: "REQ-RT-001",
        what: "Neither loop calls the heap once it is armed.",
        hazards: &["HAZ-02", "HAZ-03"],
        tests: &[(
            "tests/tests/system/rt_contract.rs",
            "armed_threads_make_no_heap_call_and_fault_no_page",
        )],
    },
    Requirement {
        id: "REQ-RT-002",
        what: "Neither loop faults a page once it is armed.",
        hazards: &["HAZ-02", "HAZ-03"],
        tests: &[(
            "tests/tests/system/rt_contract.rs",
            "armed_threads_make_no_heap_call_and_fault_no_page",
        )],
    },
    limit(
        "REQ-RT-003",
        "Neither loop waits for another thread.",
        &["HAZ-02", "HAZ-03"],
    ),
    limit(
        "REQ-RT-004",
        "Measuring costs a tick at most a microsecond, p99.",
        &["HAZ-09"],
    ),
    Requirement {
        id: "REQ-MODEL-001",
        what: "The finite-element solver agrees with independent solutions: kept ones of another solver, a dense one, closed forms.",
        hazards: &["HAZ-05"],
        tests: &[
            (
                "rt-core/sim/src/tissue/fem/tests/golden.rs",
                "agrees_with_the_golden_solutions",
            ),
            (
                "rt-core/sim/src/tissue/fem/tests/step.rs",
                "step_finds_what_a_dense_solver_finds",
            ),
            (
                "rt-core/sim/src/tissue/fem/tests/locking.rs",
                "oedometer_has_the_modulus_of_the_closed_form",
            ),
            (
                "rt-core/sim/src/tissue/fem/tests/operator.rs",
                "uniform_strain_is_exact_on_an_irregular_body",
            ),
        ],
    },
    Requirement {
        id: "REQ-MODEL-002",
        what: "The needle line agrees with closed forms of line loads, spheres and beams.",
        hazards: &["HAZ-05"],
        tests: &[
            (
                "rt-core/sim/src/line/compliance/tests.rs",
                "a_line_load_in_a_fixed_cylinder_moves_tissue_by_the_logarithm",
            ),
            (
                "rt-core/sim/src/line/compliance/tests.rs",
                "the_tip_moves_tissue_as_a_rigid_sphere_does",
            ),
            (
                "rt-core/sim/src/line/beam/tests.rs",
                "a_beam_on_an_elastic_foundation_decays_as_hetenyi_says",
            ),
        ],
    },
    Requirement {
        id: "REQ-MODEL-003",
        what: "Every tissue model meets each hard case, or the page of results says that it does not.",
        hazards: &["HAZ-05"],
        tests: &[("tests/physics/src/stability.rs", "every_model_meets_every_hard_case")],
    },
    Requirement {
        id: "REQ-MODEL-004",
        what: "Contact makes no energy, and half the tick and half the spacing change little.",
        hazards: &["HAZ-03", "HAZ-05"],
        tests: &[
            (
                "rt-core/sim/src/line/contact/tests.rs",
                "ten_thousand_random_cycles_make_no_energy",
            ),
            (
                "rt-core/sim/src/line/contact/tests.rs",
                "half_the_tick_and_half_the_spacing_change_little",
            ),
        ],
    },
    Requirement {
        id: "REQ-DOSE-001",
        what: "Dose of a seed by TG-43U1 agrees with an independent evaluation.",
        hazards: &["HAZ-06"],
        tests: &[
            (
                "tests/dose/src/tg43.rs",
                "point_dose_agrees_with_an_independent_evaluation_in_all_directions",
            ),
            (
                "tests/dose/src/grid.rs",
                "any_grid_agrees_with_the_loop_over_seeds_and_voxels",
            ),
        ],
    },
    Requirement {
        id: "REQ-DOSE-002",
        what: "Histograms and metrics agree with closed forms and with numpy.",
        hazards: &["HAZ-06"],
        tests: &[
            (
                "tests/dose/src/dvh.rs",
                "doses_to_volumes_follow_the_closed_form_and_d01cc_is_not_d2cc",
            ),
            ("tests/tests/system/dose_cli.rs", "metrics_of_a_plan_agree_with_numpy"),
        ],
    },
    Requirement {
        id: "REQ-PLACE-001",
        what: "Every format of image gives the same structures at the same place, oblique and anisotropic ones included.",
        hazards: &["HAZ-07"],
        tests: &[
            (
                "tests/tests/system/formats.rs",
                "every_format_gives_the_same_structures_at_the_same_place",
            ),
            (
                "tests/tests/system/volume.rs",
                "the_procedure_runs_in_an_oblique_anisotropic_volume_at_its_place",
            ),
        ],
    },
    Requirement {
        id: "REQ-PLACE-002",
        what: "Structure set, plan and dose of a study name each other, their images and one frame of reference.",
        hazards: &["HAZ-07"],
        tests: &[(
            "tests/files/src/study.rs",
            "the_files_of_a_study_are_complete_and_reference_each_other",
        )],
    },
    Requirement {
        id: "REQ-DATA-001",
        what: "Nothing from shared memory is used unchecked; invalid commands are refused and counted.",
        hazards: &["HAZ-08"],
        tests: &[
            (
                "tests/tests/system/shm_invalid.rs",
                "core_refuses_invalid_records_of_hosts_and_runs_on",
            ),
            (
                "tests/tests/system/process_hosts.rs",
                "ten_thousand_invalid_commands_are_all_refused_and_counted",
            ),
        ],
    },
    Requirement {
        id: "REQ-DATA-002",
        what: "A file that cannot be used is refused with its reason, and the run goes on.",
        hazards: &["HAZ-08"],
        tests: &[
            (
                "tests/tests/system/formats.rs",
                "a_scene_file_that_cannot_be_used_is_refused_and_the_scene_goes_on",
            ),
            (
                "tests/tests/system/volume.rs",
                "unusable_volumes_get_one_clear_message_and_the_scene_goes_on",
            ),
        ],
    },
    Requirement {
        id: "REQ-REC-001",
        what: "Every tick has its record, as a host sees it.",
        hazards: &["HAZ-09"],
        tests: &[("tests/tests/system/insertion.rs", "every_tick_has_its_record")],
    },
    Requirement {
        id: "REQ-REC-002",
        what: "A flight recording repeats bit by bit.",
        hazards: &["HAZ-05", "HAZ-09"],
        tests: &[(
            "tests/tests/system/recorder_flight.rs",
            "request_fault_and_end_leave_recordings_that_repeat_bit_for_bit",
        )],
    },
    Requirement {
        id: "REQ-REC-003",
        what: "A report that was altered is found.",
        hazards: &["HAZ-09"],
        tests: &[("tests/tests/system/lab_latency.rs", "changed_report_is_found")],
    },
    Requirement {
        id: "REQ-USE-001",
        what: "Window, documents and this file say that Stylet is for research and training.",
        hazards: &["HAZ-10"],
        tests: &[("rt-core/lab/src/credibility/tests.rs", "the_page_says_what_it_is_not")],
    },
];
