//! Readers of files against those written by other programs, and against hostile input.

#[cfg(test)]
mod cases;
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
#[cfg(test)]
mod together;
