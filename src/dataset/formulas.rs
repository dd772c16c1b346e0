//! Formulas that a user has, in the place of random syntax trees.

use std::sync::Arc;

use super::maps::{MAX_REGIONS, region_name};
use super::read::digest;
use crate::ltl::{Formula, ParseError};

/// Formulas over the regions `l1` to `l7` of drawn maps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormulaList {
    formulas: Arc<[Formula]>,
    hash: String,
}

/// What is wrong with a line of a list of formulas.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormulaListError {
    /// A line that is no formula.
    #[error("line {line}: {source}")]
    Formula {
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        source: Box<ParseError>,
    },
    /// A name that no drawn map has.
    #[error(
        "line {line}: drawn maps have no region `{name}`: expected l1 to l{MAX_REGIONS}, or a to {} for them",
        last_letter()
    )]
    Name {
        /// The line, counted from 1.
        line: usize,
        /// The name.
        name: String,
    },
    /// No line with a formula.
    #[error("no formula: expected one on each line")]
    Empty,
}

/// The letter that stands for the last region.
fn last_letter() -> char {
    char::from(b'a' + MAX_REGIONS as u8 - 1)
}

impl FormulaList {
    /// Reads a formula from each line; lines that are empty or begin with `#` hold none. The letters `a` to `g` stand for `l1` to `l7`,
    /// as in lists by Spot's generator.
    ///
    /// ```
    /// use nngtl::dataset::FormulaList;
    /// let list = FormulaList::parse("# what the robot is told\nF a & G !b\nG F l3\n")?;
    /// let texts: Vec<String> = list.formulas().iter().map(ToString::to_string).collect();
    /// assert_eq!(texts, ["Fl1 & G!l2", "GFl3"]);
    /// # Ok::<(), nngtl::dataset::FormulaListError>(())
    /// ```
    ///
    /// # Errors
    /// The first line that is wrong, or a list without any formula.
    pub fn parse(text: &str) -> Result<Self, FormulaListError> {
        let lines = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()));
        let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let formulas = lines.map(|(line, text)| {
            let formula = text
                .parse::<Formula>()
                .map_err(|source| FormulaListError::Formula {
                    line,
                    source: Box::new(source),
                })?;
            let named = formula.rename(&|name| region(name).ok_or_else(|| name.to_owned()));
            named.map_err(|name| FormulaListError::Name { line, name })
        });
        let formulas: Arc<[Formula]> = formulas.collect::<Result<_, _>>()?;
        if formulas.is_empty() {
            return Err(FormulaListError::Empty);
        }
        Ok(Self {
            formulas,
            hash: digest(text.as_bytes()),
        })
    }

    /// The formulas, in the order of their lines.
    #[must_use]
    pub fn formulas(&self) -> &[Formula] {
        &self.formulas
    }

    /// The SHA-256 of the text, in hexadecimal digits.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }
}

/// The region of a drawn map that a name or a letter stands for.
fn region(name: &str) -> Option<String> {
    let mut regions = (0..MAX_REGIONS).map(region_name);
    let letter = match name.as_bytes() {
        &[letter @ b'a'..=b'z'] => regions.nth(usize::from(letter - b'a')),
        _ => None,
    };
    letter.or_else(|| (0..MAX_REGIONS).map(region_name).find(|r| r == name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let error = |text| FormulaList::parse(text).unwrap_err().to_string();
        assert!(error("F a\n\nG (b\n").starts_with("line 3: "));
        let wrong = error("F a\nF h\n");
        assert_eq!(
            wrong,
            "line 2: drawn maps have no region `h`: expected l1 to l7, or a to g for them"
        );
        assert!(error("F l8").contains("`l8`"));
        assert_eq!(
            FormulaList::parse("# none\n\n"),
            Err(FormulaListError::Empty)
        );
    }
}
