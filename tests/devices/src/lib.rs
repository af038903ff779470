//! Back ends over drivers that misbehave: interfaces, threads, and faults drawn at random.

#[cfg(test)]
mod drd;
