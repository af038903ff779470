//! Tissue and force in hard cases and in many hands.

#[cfg(test)]
mod as_it_runs;
#[cfg(test)]
mod chain;
#[cfg(test)]
mod coupled;
#[cfg(test)]
mod envelope;
#[cfg(test)]
mod hard_cases;
#[cfg(test)]
mod needle;
#[cfg(test)]
mod outside;
#[cfg(test)]
mod patch;
#[cfg(test)]
mod rig;
#[cfg(test)]
mod rows;
#[cfg(test)]
mod stability;
#[cfg(test)]
mod torque;
#[cfg(test)]
mod z_width;
