//! What the README promises: its output, its tables, its links.

mod cli;

use std::path::Path;

use cli::{nngtl, shipped};

fn readme() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    std::fs::read_to_string(path).unwrap()
}

/// Whether `line` is `pattern` with something in place of each `…`.
fn matches(pattern: &str, line: &str) -> bool {
    let mut parts = pattern.split('…');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = line.strip_prefix(first) else {
        return false;
    };
    let mut open = false;
    for part in parts {
        open = part.is_empty();
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    open || rest.is_empty()
}

#[test]
fn the_first_command_prints_what_is_promised() {
    let readme = readme();
    let (_, after) = readme.split_once("```text\n").unwrap();
    let (promised, _) = after.split_once("```").unwrap();
    let run = nngtl(&["plan", &shipped("case-study.toml")]);
    assert_eq!(run.code, 0, "{run:?}");
    let (promised, printed): (Vec<_>, Vec<_>) =
        (promised.lines().collect(), run.out.lines().collect());
    assert!(
        promised.len() == printed.len()
            && promised.iter().zip(&printed).all(|(p, l)| matches(p, l)),
        "the README promises\n{}\nbut the program prints\n{}\nif this is right, write it into the README, with … for times",
        promised.join("\n"),
        run.out
    );
}

/// The first cells of the table under a heading.
fn first_cells<'a>(readme: &'a str, heading: &str) -> Vec<&'a str> {
    let (_, after) = readme.split_once(heading).unwrap();
    let rows = after.lines().skip_while(|l| !l.starts_with('|')).skip(2);
    let cells: Vec<_> = rows
        .take_while(|l| l.starts_with('|'))
        .filter_map(|l| l.split('`').nth(1))
        .collect();
    assert!(cells.len() > 5, "no table under {heading}");
    cells
}

#[test]
fn every_command_and_setting_of_the_tables_exists() {
    let readme = readme();
    for command in first_cells(&readme, "## Commands") {
        let words = command.split(' ').skip(1);
        let mut words: Vec<&str> = words
            .take_while(|w| w.chars().all(|c| c.is_ascii_lowercase()))
            .collect();
        words.push("--help");
        let run = nngtl(&words);
        assert_eq!(run.code, 0, "{command}: {run:?}");
    }
    let help = nngtl(&["plan", "--help"]).out;
    for option in first_cells(&readme, "## Settings of the planner") {
        assert!(
            help.contains(&format!("{option} ")) || help.contains(&format!("{option}\n")),
            "{option}"
        );
    }
}

#[test]
fn every_linked_page_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = readme();
    let targets = readme
        .split("](")
        .skip(1)
        .filter_map(|t| t.split(')').next());
    let pages: Vec<_> = targets
        .filter(|t| !t.starts_with("http") && !t.starts_with("docs/pictures/"))
        .collect();
    assert!(pages.len() > 5);
    for page in pages {
        // A package of the crate leaves training/ out.
        let left_out = page.starts_with("training/") && !root.join("training").exists();
        assert!(left_out || root.join(page).exists(), "{page}");
    }
}
