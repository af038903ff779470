//! Everything wrong with an input, reported together.

use std::error::Error;
use std::fmt;

/// Problems of one input, at least one; shown one a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProblemList<P>(pub Vec<P>);

impl<P> ProblemList<P> {
    /// Returns the problems as an error if there is one.
    pub fn check(found: Vec<P>) -> Result<(), Self> {
        match found.is_empty() {
            true => Ok(()),
            false => Err(Self(found)),
        }
    }
}

impl<P> From<P> for ProblemList<P> {
    fn from(only: P) -> Self {
        Self(vec![only])
    }
}

impl<P: fmt::Display> fmt::Display for ProblemList<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, problem) in self.0.iter().enumerate() {
            let line_end = if n == 0 { "" } else { "\n" };
            write!(f, "{line_end}{problem}")?;
        }
        Ok(())
    }
}

impl<P: fmt::Debug + fmt::Display> Error for ProblemList<P> {}
