//! The latency laboratory as a user runs it: causes that are injected into a measurement, and campaigns that are
//! killed.

#[cfg(test)]
mod campaign;
#[cfg(test)]
mod causes;
#[cfg(test)]
mod inject;
