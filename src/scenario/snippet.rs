//! Lines of a text with a caret below the place that is meant.

use std::ops::Range;

/// At most this many characters of a line are shown on either side of the place.
const WINDOW: usize = 60;

/// Shows the line in which `span` begins, with carets below it.
pub(crate) fn show(text: &str, first_line: usize, span: &Range<usize>) -> String {
    // A place may be stated in bytes, within a character.
    let start = text.floor_char_boundary(span.start);
    let end = text.ceil_char_boundary(span.end.min(text.len()));
    let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |i| start + i);
    let line = first_line + text[..start].matches('\n').count();
    let before: Vec<char> = text[line_start..start].chars().collect();
    let after: Vec<char> = text[start..line_end].trim_end().chars().collect();
    let meant = text[start..end.clamp(start, line_end)].chars().count();

    let cut_left = before.len().saturating_sub(WINDOW);
    let cut_right = after.len().min(WINDOW);
    let mut shown = String::new();
    if cut_left > 0 {
        shown.push('…');
    }
    shown.extend(&before[cut_left..]);
    let indent = shown.chars().count();
    shown.extend(&after[..cut_right]);
    if cut_right < after.len() {
        shown.push('…');
    }
    let shown = shown.replace('\t', " ");
    let carets = "^".repeat(meant.clamp(1, cut_right.max(1)));

    let number = line.to_string();
    let margin = " ".repeat(number.len());
    format!(
        "{margin} |\n{number} | {shown}\n{margin} | {:indent$}{carets}",
        ""
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caret_stands_below_the_place() {
        let text = "a = 1\ntask = \"λ l9\"\n";
        let start = text.find("l9").unwrap();
        let expected = "  |\n8 | task = \"λ l9\"\n  |           ^^";
        let shown = show(text, 7, &(start..start + 2));
        assert_eq!(shown, expected);
    }

    #[test]
    fn long_lines_are_cut_around_the_place() {
        let text = format!("{}X{}", "a".repeat(500), "b".repeat(500));
        let shown = show(&text, 1, &(500..501));
        assert!(shown.lines().all(|l| l.chars().count() < 140), "{shown}");
        let line = shown.lines().nth(1).unwrap();
        let caret = shown.lines().nth(2).unwrap();
        let column = caret.chars().position(|c| c == '^').unwrap();
        assert_eq!(line.chars().nth(column), Some('X'));
    }

    #[test]
    fn places_beyond_the_text_do_not_panic() {
        assert!(show("", 1, &(0..0)).contains('^'));
        assert!(show("ab", 1, &(9..12)).contains('^'));
        // Half of a character, as a fuzzer found it behind a byte-order mark.
        assert!(show("a\u{feff}b", 1, &(1..2)).contains('^'));
        assert!(show("a\u{feff}b", 1, &(2..3)).contains('^'));
    }
}
