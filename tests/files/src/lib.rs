//! Readers of files against what other programs wrote, and against hostile input.

#[cfg(test)]
mod corpus;
#[cfg(test)]
mod dicom;
#[cfg(test)]
mod labels;
#[cfg(test)]
mod results;
#[cfg(test)]
mod study;
