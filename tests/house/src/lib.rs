//! Rules of the repository that a program can check.

#[cfg(test)]
mod browser;
#[cfg(test)]
mod docs_names;
#[cfg(test)]
mod features;
#[cfg(test)]
mod walls;
