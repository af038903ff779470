//! Dose against published tables, closed forms and independent code.

#[cfg(test)]
mod dvh;
#[cfg(test)]
mod grid;
#[cfg(test)]
mod registration;
#[cfg(test)]
mod source;
#[cfg(test)]
mod sources;
#[cfg(test)]
mod tg43;
