//! The whole system: processes, devices, faults, recordings, and implants carried out.

mod device_abi;
mod device_libhd;
mod device_procedure;
mod dose_cli;
mod force_insertions;
mod formats;
mod igtl;
mod igtl_python;
mod insertion;
mod kill;
mod lab_latency;
mod perturb_cli;
mod plan_compensation;
mod plan_optimised;
mod plan_rehearsal;
mod process_hosts;
mod process_loops;
mod process_restart;
mod recorder_flight;
mod recorder_mcap;
mod rt_contract;
mod scene_memory;
mod scene_surfaces;
mod scenes;
mod shm_invalid;
mod volume;
