//! Tissue and force in hard cases and in many hands.

#[cfg(test)]
mod coupled;
#[cfg(test)]
mod envelope;
#[cfg(test)]
mod hard_cases;
#[cfg(test)]
mod needle;
#[cfg(test)]
mod stability;
#[cfg(test)]
mod z_width;
