//! Spread of a quantity: the forms that a study file has for it, and one value of it.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};
use toml::Value;

/// The forms, as errors and help list them.
pub const FORMS: &str = "a number, { uniform = [least, most] }, { log_uniform = [least, most] }, { choice = [a, b, ...] }, \
                         { normal = [mean, deviation], within = [least, most] } or { log_normal = [median, factor], within = [least, most] }";

/// A normal distribution that is wider than its limits by more than this would be drawn from for ever.
const WIDEST: f64 = 20.0;

/// A distribution with an end on both sides.
#[derive(Clone, Debug, PartialEq)]
pub enum Spread {
    /// Constant value.
    Fixed(f64),
    /// Each value between the two is equally likely.
    Uniform([f64; 2]),
    /// Each value of the logarithm is equally likely.
    LogUniform([f64; 2]),
    /// Each of these is equally likely.
    Choice(Vec<f64>),
    /// Mean and standard deviation; what falls outside is drawn again.
    Normal([f64; 2], [f64; 2]),
    /// Median, and the factor that 68 % lie within in both directions; what falls outside is drawn again.
    LogNormal([f64; 2], [f64; 2]),
}

impl Spread {
    /// Reads a value of the study file; the error says what is wrong with it, without its key.
    pub fn of_toml(value: &Value) -> Result<Self, SpreadProblem> {
        if let Some(fixed) = number(value) {
            return finite(&[fixed]).map(|()| Self::Fixed(fixed));
        }
        let table = value.as_table().ok_or(SpreadProblem::Form)?;
        let list = |key: &str| {
            let list = table.get(key)?.as_array()?;
            list.iter().map(number).collect::<Option<Vec<f64>>>()
        };
        let pair = |key: &str| {
            list(key)
                .and_then(|l| <[f64; 2]>::try_from(l).ok())
                .ok_or(SpreadProblem::Form)
        };
        let mut keys: Vec<&str> = table.keys().map(String::as_str).collect();
        keys.sort_unstable();
        let spread = match keys.as_slice() {
            ["uniform"] => Self::Uniform(pair("uniform")?),
            ["log_uniform"] => Self::LogUniform(pair("log_uniform")?),
            ["choice"] => Self::Choice(list("choice").filter(|l| !l.is_empty()).ok_or(SpreadProblem::Form)?),
            ["normal", "within"] => Self::Normal(pair("normal")?, pair("within")?),
            ["log_normal", "within"] => Self::LogNormal(pair("log_normal")?, pair("within")?),
            ["normal"] | ["log_normal"] => return Err(SpreadProblem::Unbounded),
            _ => return Err(SpreadProblem::Form),
        };
        spread.checked()
    }

    fn checked(self) -> Result<Self, SpreadProblem> {
        use SpreadProblem as P;
        let [least, most] = self.bounds();
        finite(&[least, most])?;
        if least > most {
            return Err(P::Empty { least, most });
        }
        match &self {
            Self::LogUniform([least, _]) if *least <= 0.0 => Err(P::NotPositive(*least)),
            Self::Normal([mean, deviation], _) => {
                finite(&[*mean, *deviation])?;
                check_middle(*mean, [least, most])?;
                check_width(*deviation, most - least)?;
                Ok(self)
            }
            Self::LogNormal([median, factor], _) => {
                finite(&[*median, *factor])?;
                if least <= 0.0 {
                    return Err(P::NotPositive(least));
                }
                if *factor < 1.0 {
                    return Err(P::Factor(*factor));
                }
                check_middle(*median, [least, most])?;
                check_width(factor.ln(), (most / least).ln())?;
                Ok(self)
            }
            _ => Ok(self),
        }
    }

    /// Returns the bounds of all values.
    pub fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Fixed(value) => [*value; 2],
            Self::Uniform(b) | Self::LogUniform(b) | Self::Normal(_, b) | Self::LogNormal(_, b) => *b,
            Self::Choice(values) => values
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], &v| [l.min(v), h.max(v)]),
        }
    }

    /// Draws a value.
    pub fn draw(&self, random: &mut ChaCha8Rng) -> f64 {
        match self {
            Self::Fixed(value) => *value,
            Self::Uniform([least, most]) => between(*least, *most, unit(random)),
            Self::LogUniform([least, most]) => between(least.ln(), most.ln(), unit(random)).exp().clamp(*least, *most),
            Self::Choice(values) => values[(unit(random) * values.len() as f64) as usize % values.len()],
            Self::Normal([mean, deviation], within) => inside(*within, || {
                let normal: f64 = StandardNormal.sample(random);
                mean + deviation * normal
            }),
            Self::LogNormal([median, factor], within) => inside(*within, || {
                let normal: f64 = StandardNormal.sample(random);
                median * (factor.ln() * normal).exp()
            }),
        }
    }
}

/// Problem with a distribution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpreadProblem {
    /// None of the forms.
    #[error("give {FORMS}")]
    Form,
    /// A tail without an end.
    #[error("a normal distribution needs its ends: within = [least, most]")]
    Unbounded,
    /// NaN or infinite.
    #[error("{0} is no finite number")]
    NotFinite(f64),
    /// The ends are exchanged.
    #[error("[{least}, {most}]: the first must be the smaller one")]
    Empty {
        /// Bound as given.
        least: f64,
        /// Bound as given.
        most: f64,
    },
    /// A logarithm of that does not exist.
    #[error("{0} has no logarithm: the least value must be above 0")]
    NotPositive(f64),
    /// A factor in both directions.
    #[error("the factor is {0}; it must be 1 or more")]
    Factor(f64),
    /// Next to all draws would be thrown away.
    #[error("the middle is {middle}, outside of within = [{least}, {most}]")]
    MiddleOutside {
        /// Mean or median.
        middle: f64,
        /// Bound as given.
        least: f64,
        /// Bound as given.
        most: f64,
    },
    /// Next to all draws would be thrown away.
    #[error("it is wider than {WIDEST} times what `within` leaves of it, or its width is negative: use uniform")]
    TooWide,
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn finite(values: &[f64]) -> Result<(), SpreadProblem> {
    match values.iter().find(|v| !v.is_finite()) {
        Some(&value) => Err(SpreadProblem::NotFinite(value)),
        None => Ok(()),
    }
}

fn check_middle(middle: f64, [least, most]: [f64; 2]) -> Result<(), SpreadProblem> {
    if (least..=most).contains(&middle) {
        return Ok(());
    }
    Err(SpreadProblem::MiddleOutside { middle, least, most })
}

fn check_width(deviation: f64, room: f64) -> Result<(), SpreadProblem> {
    if deviation >= 0.0 && deviation <= WIDEST * room {
        Ok(())
    } else {
        Err(SpreadProblem::TooWide)
    }
}

/// Draws 53 random bits, from 0 to just below 1.
fn unit(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn between(least: f64, most: f64, share: f64) -> f64 {
    (least + (most - least) * share).clamp(least, most)
}

fn inside([least, most]: [f64; 2], mut draw: impl FnMut() -> f64) -> f64 {
    loop {
        let value = draw();
        if (least..=most).contains(&value) {
            return value;
        }
    }
}
