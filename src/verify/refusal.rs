//! Why a plan is refused.

use std::fmt;

use nalgebra::Point2;

/// A part of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Walked once.
    Prefix,
    /// Walked for ever.
    Suffix,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prefix => "prefix",
            Self::Suffix => "suffix",
        })
    }
}

/// Why a plan is refused. Points and legs are counted from 0: leg `i` leads from point `i` to
/// point `i + 1`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A part has no point.
    #[error("the {part} is empty: expected at least one point")]
    Empty {
        /// Which part.
        part: Part,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the {part} is ({x}, {y}): coordinates must be finite numbers")]
    NotFinite {
        /// Which part.
        part: Part,
        /// Which point.
        index: usize,
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
    },
    /// The plan begins elsewhere.
    #[error("the prefix begins at {}, but the robot starts at {}", p(at), p(start))]
    WrongStart {
        /// Where the plan begins, map units.
        at: Point2<f64>,
        /// Where the robot is, map units.
        start: Point2<f64>,
    },
    /// The suffix does not begin where the prefix ends.
    #[error("the suffix begins at {}, but the prefix ends at {}", p(at), p(end))]
    Disconnected {
        /// Where the suffix begins, map units.
        at: Point2<f64>,
        /// Where the prefix ends, map units.
        end: Point2<f64>,
    },
    /// The suffix does not return to its beginning.
    #[error(
        "the suffix ends at {}, but must return to its beginning {}",
        p(at),
        p(end)
    )]
    NotClosed {
        /// Where the suffix ends, map units.
        at: Point2<f64>,
        /// Where it begins, map units.
        end: Point2<f64>,
    },
    /// A point lies in an obstacle or out of bounds.
    #[error(
        "point {index} of the {part}, {}, lies in an obstacle or outside the bounds",
        p(at)
    )]
    NotFree {
        /// Which part.
        part: Part,
        /// Which point.
        index: usize,
        /// Where it is, map units.
        at: Point2<f64>,
    },
    /// A leg runs through an obstacle or out of bounds.
    #[error("leg {leg} of the {part} {} near {}", met(*obstacle), p(at))]
    Blocked {
        /// Which part.
        part: Part,
        /// Which leg.
        leg: usize,
        /// The obstacle's number in the map, from 0; `None` for the bounds.
        obstacle: Option<usize>,
        /// A point of the leg that is not free, map units.
        at: Point2<f64>,
    },
    /// The letter changes more than once along a leg.
    #[error(
        "leg {leg} of the {part} sees {letters}: the letter may change at most once along a leg"
    )]
    SegmentRule {
        /// Which part.
        part: Part,
        /// Which leg.
        leg: usize,
        /// The letters along the leg, ends included.
        letters: String,
    },
    /// A waypoint of a plan on a grid is not a cell's centre.
    #[error("point {index} of the {part}, {}, is no cell's centre", p(at))]
    OffCentre {
        /// Which part.
        part: Part,
        /// Which point.
        index: usize,
        /// Where it is, map units.
        at: Point2<f64>,
    },
    /// A leg of a plan on a grid runs neither along a row nor along a column.
    #[error("leg {leg} of the {part} runs neither along a row nor along a column")]
    Oblique {
        /// Which part.
        part: Part,
        /// Which leg.
        leg: usize,
    },
    /// A leg of a plan on a grid meets a region that holds neither of its ends.
    #[error("leg {leg} of the {part} runs through {letter}, where it neither begins nor ends")]
    ThroughRegion {
        /// Which part.
        part: Part,
        /// Which leg.
        leg: usize,
        /// What is seen there.
        letter: String,
    },
    /// The stated cost is not the path's.
    #[error("the plan states a {what} cost of {stated}, its path has {found}")]
    Cost {
        /// `prefix`, `suffix` or `total`.
        what: &'static str,
        /// As the plan states it, map units.
        stated: f64,
        /// As the path has it, map units.
        found: f64,
    },
    /// The word does not satisfy the formula.
    #[error("the mission is not fulfilled: on the word {word} it does not hold that {failing}")]
    Formula {
        /// The word, as `{} {a} ({b} {})^ω`.
        word: String,
        /// The conjuncts of the formula that do not hold.
        failing: String,
    },
    /// The automaton does not accept the word.
    #[error("the mission is not fulfilled: the automaton does not accept the word {word}")]
    NotAccepted {
        /// The word, as `{} {a} ({b} {})^ω`.
        word: String,
    },
    /// The formula speaks of the next letter.
    #[error(
        "the mission uses X (next), which has no meaning while a robot moves continuously: use U, F and G"
    )]
    Next,
    /// The formula has no value on this map's words: it names a region that is not there.
    #[error("the mission does not belong to this map: {0}")]
    Evaluate(String),
    /// The automaton was made for other letters.
    #[error("the automaton speaks of other letters than this map's")]
    ForeignAlphabet,
}

fn p(at: &Point2<f64>) -> String {
    format!("({}, {})", at.x, at.y)
}

fn met(obstacle: Option<usize>) -> String {
    match obstacle {
        Some(i) => format!("runs into obstacle {}", i + 1),
        None => "leaves the bounds".to_owned(),
    }
}
