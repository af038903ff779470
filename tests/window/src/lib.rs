//! The window by its labels and its kept pictures, and clipped or overlapping parts.

#[cfg(test)]
mod animation;
#[cfg(test)]
mod controllers;
#[cfg(test)]
mod driven;
#[cfg(test)]
mod image;
#[cfg(test)]
mod instructor;
#[cfg(test)]
mod kept;
#[cfg(test)]
mod live;
#[cfg(test)]
mod opened;
#[cfg(test)]
mod own_data;
#[cfg(test)]
mod plan;
#[cfg(test)]
mod plugged;
#[cfg(test)]
mod probe;
#[cfg(test)]
mod senders;
#[cfg(test)]
mod sights;
#[cfg(test)]
mod states;
#[cfg(test)]
mod terminal;
#[cfg(test)]
mod update;
#[cfg(test)]
mod watch;
#[cfg(test)]
mod whole;
