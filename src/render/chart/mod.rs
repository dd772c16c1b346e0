//! Charts: lines, bands, boxes and intervals in panels side by side, as SVG.
//!
//! The colours are those of the Okabe–Ito palette, darkened where lines on white need it, and lines of
//! different colours differ in their dashes, too.

mod axis;
mod draw;

pub(crate) use axis::Axis;

/// How something is drawn: a colour and dashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ink(pub(crate) usize);

impl Ink {
    /// Colour and dashes of the inks.
    const ALL: [(&'static str, &'static str); 8] = [
        ("#7a8087", "7 3"),
        ("#c84c00", ""),
        ("#005fa3", "2 2.5"),
        ("#b78a00", "9 3 2 3"),
        ("#00875f", ""),
        ("#b0558c", "4 2"),
        ("#2f9fd8", "12 3"),
        ("#22262b", "1.5 1.5"),
    ];

    fn colour(self) -> &'static str {
        Self::ALL[self.0 % Self::ALL.len()].0
    }

    fn dashes(self) -> &'static str {
        Self::ALL[self.0 % Self::ALL.len()].1
    }
}

/// What a set of values looks like as a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spread {
    /// 5 %, 25 %, 50 %, 75 % and 95 % of the values lie below.
    pub(crate) quantiles: [f64; 5],
    /// Their mean.
    pub(crate) mean: f64,
}

/// Something drawn in a panel, in the panel's values.
#[derive(Clone, Debug)]
pub(crate) enum Mark {
    /// A line through points.
    Line(Vec<[f64; 2]>, Ink),
    /// The space between two lines, as (x, low, high).
    Band(Vec<[f64; 3]>, Ink),
    /// A lying box at a height: quartiles with the median, whiskers at 5 % and 95 %, a dot at the mean.
    Box(f64, Spread, Ink),
    /// A value with its interval at a height.
    Interval(f64, [f64; 3], Ink),
    /// An upright dashed line with a name.
    Limit(f64, String),
}

/// One system of axes.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) marks: Vec<Mark>,
}

/// A picture of panels side by side.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) title: String,
    /// What the signs mean, in a line or two.
    pub(crate) subtitle: String,
    /// Names of inks; none where the axes name everything.
    pub(crate) legend: Vec<(String, Ink)>,
    pub(crate) panels: Vec<Panel>,
}
