//! Back ends over drivers that misbehave: interfaces, threads, and faults drawn at random.

#[cfg(test)]
mod drawn;
#[cfg(test)]
mod drd;
#[cfg(test)]
mod driven;
#[cfg(test)]
mod haply;
#[cfg(test)]
mod rig;
