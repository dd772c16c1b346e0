//! Axes: from values to pixels, and which values are named.

use super::super::shapes::{nice_step, number, ticks};

/// How values are spaced.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm.
    Log,
    /// One place for each name, the first at the top; values are places counted from 0.
    Names(Vec<String>),
}

/// An axis of a panel.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// What it measures, with the unit.
    pub(crate) label: String,
    /// How values are spaced.
    pub(crate) scale: Scale,
    /// The least and the largest value that is shown; what lies beyond is drawn at the edge.
    pub(crate) range: [f64; 2],
    /// Whether the lowest value stands for everything below, too.
    pub(crate) has_floor: bool,
    /// What follows a number, as `%`.
    pub(crate) unit: &'static str,
}

/// A place that is marked on an axis.
pub(super) struct Tick {
    pub(super) at: f64,
    /// Empty for a line without a number.
    pub(super) name: String,
}

impl Axis {
    /// An axis with even spacing that holds all these values, and round numbers at its ends.
    pub(crate) fn linear(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = ends(values).unwrap_or((0.0, 1.0));
        let room = if high > low {
            high - low
        } else {
            high.abs().max(1.0)
        };
        let step = nice_step(room / 4.0);
        let low = (low / step + 1e-9).floor() * step;
        let high = (high / step - 1e-9).ceil() * step;
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
            range: [low, if high > low { high } else { low + step }],
            has_floor: false,
            unit: "",
        }
    }

    /// A logarithmic axis that holds all of these values that are above 0.
    pub(crate) fn log(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let above = values.into_iter().filter(|&v| v > 0.0);
        let (low, high) = ends(above).unwrap_or((1.0, 10.0));
        // Ends at 1, 2 or 5 times a power of ten.
        let up = nice_step(high * (1.0 - 1e-9));
        let down = 1.0 / nice_step((1.0 - 1e-9) / low);
        Self {
            label: label.to_owned(),
            scale: Scale::Log,
            range: [down, if up > down { up } else { down * 10.0 }],
            has_floor: false,
            unit: "",
        }
    }

    /// An axis of names.
    pub(crate) fn names(names: Vec<String>) -> Self {
        Self {
            label: String::new(),
            range: [-0.5, names.len() as f64 - 0.5],
            scale: Scale::Names(names),
            has_floor: false,
            unit: "",
        }
    }

    /// The same axis from `least` on; lesser values are drawn there, and its name says so.
    pub(crate) fn with_floor(mut self, least: f64) -> Self {
        self.range[0] = least;
        self.has_floor = true;
        self
    }

    /// The same axis with a unit behind its numbers.
    pub(crate) fn with_unit(mut self, unit: &'static str) -> Self {
        self.unit = unit;
        self
    }

    /// Where a value lies between the ends, from 0 to 1; from the top for names.
    pub(super) fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let value = value.clamp(low, high);
        match self.scale {
            Scale::Log => (value / low).ln() / (high / low).ln(),
            Scale::Linear | Scale::Names(_) => (value - low) / (high - low),
        }
    }

    /// The places to mark.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        let [low, high] = self.range;
        match &self.scale {
            Scale::Names(names) => names
                .iter()
                .enumerate()
                .map(|(k, name)| Tick {
                    at: k as f64,
                    name: name.clone(),
                })
                .collect(),
            Scale::Linear => {
                let step = nice_step((high - low) / 5.0);
                ticks(low, high, step)
                    .map(|at| Tick {
                        at,
                        name: format!("{}{}", number(at, step), self.unit),
                    })
                    .collect()
            }
            Scale::Log => self.log_ticks(),
        }
    }

    fn log_ticks(&self) -> Vec<Tick> {
        let [low, high] = self.range;
        let decades = (high / low).log10();
        let slack = 1e-9;
        let powers = (low.log10() - slack).floor() as i32..=(high.log10() + slack).ceil() as i32;
        let shown = |at: &f64| *at >= low * (1.0 - slack) && *at <= high * (1.0 + slack);
        // Names keep their distance: all of 1, 2, 5 on short axes, powers of ten on long ones, every other
        // power on longer ones.
        let every = if decades > 6.0 { 2 } else { 1 };
        let mut found = Vec::new();
        for power in powers {
            for factor in [1.0, 2.0, 5.0] {
                let at = factor * 10_f64.powi(power);
                if !shown(&at) {
                    continue;
                }
                let is_floor = self.has_floor && at <= low * (1.0 + slack);
                let named =
                    is_floor || (factor == 1.0 && power.rem_euclid(every) == 0) || decades <= 2.1;
                let sign = if is_floor { "≤ " } else { "" };
                let name = if named {
                    format!("{sign}{}{}", plain(at), self.unit)
                } else {
                    String::new()
                };
                found.push(Tick { at, name });
            }
        }
        found
    }
}

/// A number with three digits between spaces, or with the decimals it needs.
fn plain(value: f64) -> String {
    if value < 1.0 {
        let digits = (-value.log10() - 1e-9).ceil().max(0.0) as usize;
        return format!("{value:.digits$}");
    }
    let digits = format!("{value:.0}");
    let mut spaced = String::with_capacity(digits.len() + digits.len() / 3);
    for (k, digit) in digits.chars().enumerate() {
        if digits.len() > 4 && k > 0 && (digits.len() - k).is_multiple_of(3) {
            spaced.push('\u{a0}');
        }
        spaced.push(digit);
    }
    spaced
}

/// The least and the largest finite value.
fn ends(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|v| v.is_finite());
    finite.fold(None, |ends, v| match ends {
        None => Some((v, v)),
        Some((low, high)) => Some((v.min(low), v.max(high))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(axis: &Axis) -> Vec<String> {
        let named = axis.ticks().into_iter().map(|t| t.name);
        named.filter(|n| !n.is_empty()).collect()
    }

    #[test]
    fn axes_end_at_round_numbers_and_hold_what_they_were_made_for() {
        let log = Axis::log("n", [0.0, 3.0, 17_000.0]);
        assert_eq!(log.range, [2.0, 20_000.0]);
        assert_eq!(names(&log), ["10", "100", "1000", "10\u{a0}000"]);
        assert_eq!((log.share(0.0), log.share(1e9)), (0.0, 1.0));
        assert!((log.share(200.0) - 0.5).abs() < 1e-12);
        let linear = Axis::linear("l", [0.31, 1.9]);
        assert!(linear.range[0] <= 0.31 && linear.range[1] >= 1.9);
        assert_eq!(names(&linear)[0], "0.0");
        assert_eq!(Axis::linear("l", []).range, [0.0, 1.0]);
        let flat = Axis::linear("l", [2.0, 2.0]);
        assert!(flat.range[0] < flat.range[1]);
    }

    #[test]
    fn a_floor_says_what_it_holds() {
        let axis = Axis::log("gap", [0.5, 90.0])
            .with_floor(0.1)
            .with_unit(" %");
        assert_eq!(names(&axis)[0], "≤ 0.1 %");
        assert_eq!(axis.share(-3.0), 0.0);
    }
}
