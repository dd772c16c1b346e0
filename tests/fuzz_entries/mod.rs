//! What is fuzzed: one function for each kind of input. The targets of `cargo fuzz` and the bounded
//! run on stable Rust (`tests/fuzz_bounded.rs`) call the same ones. They return nothing: any answer is
//! right that is one, and came soon.

use std::path::Path;
use std::time::Duration;

use nngtl::automaton::{Limits, read_hoa_stream, translate};
use nngtl::ltl::{self, Formula, ParseOptions};
use nngtl::maps::{self, Format, MapOptions};
use nngtl::nn::weights::WeightFile;
use nngtl::scenario::Scenario;
use nngtl::system::Continuous;
use nngtl::transfer::LibraryFile;
use nngtl::workspace::Workspace;

/// Inputs beyond this length take long and find nothing new.
const LONGEST: usize = 1 << 16;

/// Small limits: what is too large should be refused soon.
fn limits() -> Limits {
    Limits {
        states: 2_000,
        transitions: 50_000,
        time: Some(Duration::from_millis(500)),
    }
}

fn text(data: &[u8]) -> Option<&str> {
    std::str::from_utf8(data)
        .ok()
        .filter(|t| t.len() <= LONGEST)
}

/// A formula: parses, prints, parses again to the same, and translates.
pub(crate) fn formula(data: &[u8]) {
    let Some(text) = text(data) else { return };
    let Ok(parsed) = ltl::parse(text, &ParseOptions::default()) else {
        return;
    };
    let formula = parsed.formula;
    let printed = formula.to_string();
    let again: Formula = printed.parse().unwrap_or_else(|e| panic!("{printed}: {e}"));
    assert_eq!(again, formula, "{printed}");
    let names: Vec<String> = formula
        .propositions()
        .iter()
        .map(ToString::to_string)
        .collect();
    if names.len() > 6 || printed.len() > 300 {
        return;
    }
    if let Ok(letters) = nngtl::alphabet::Alphabet::disjoint(names) {
        let _ = translate(&formula, std::sync::Arc::new(letters), &limits());
    }
}

/// Automata in the HOA format.
pub(crate) fn hoa(data: &[u8]) {
    let Some(text) = text(data) else { return };
    if let Ok(all) = read_hoa_stream(text, &limits()) {
        for nba in all {
            let _ = nba.trimmed();
        }
    }
}

/// A scenario: the first byte chooses the syntax. What loads gets a visibility graph.
pub(crate) fn scenario(data: &[u8]) {
    let Some((first, rest)) = data.split_first() else {
        return;
    };
    let path = ["s.toml", "s.json", "s.jsonl"][usize::from(*first) % 3];
    let Some(text) = text(rest) else { return };
    // No map files: what they hold has a target of its own.
    let path = Path::new("no/such/folder").join(path);
    for scenario in Scenario::parse_all(path, text).into_iter().flatten() {
        match scenario {
            Ok(scenario) => {
                let _ = Continuous::new(scenario.workspace.clone(), scenario.start);
                let _ = scenario.warnings();
            }
            Err(e) => {
                assert!(!e.to_string().is_empty());
                let _ = e.snippet();
            }
        }
    }
}

/// A map: the first byte chooses format and options. A ROS map's picture follows its YAML behind a
/// zero byte.
pub(crate) fn map(data: &[u8]) {
    let Some((first, rest)) = data.split_first() else {
        return;
    };
    if rest.len() > LONGEST {
        return;
    }
    let format = [Format::Ros, Format::MovingAi, Format::GeoJson][usize::from(first % 3)];
    let options = MapOptions {
        robot_radius: f64::from(first >> 4 & 1) * 0.3,
        tolerance: [None, Some(0.0)][usize::from(first >> 5 & 1)],
        unknown_is_free: first >> 6 & 1 == 1,
        ..MapOptions::default()
    };
    let (head, picture) = match rest.iter().position(|&b| b == 0) {
        Some(at) if format == Format::Ros => (&rest[..at], &rest[at + 1..]),
        _ => (rest, &rest[..0]),
    };
    let read = maps::read(Path::new("m"), format, head, &options, &mut |_| {
        Ok(picture.to_vec())
    });
    match read {
        Ok(map) => {
            let small = map.obstacles.len() < 300;
            if let (true, Ok(workspace)) =
                (small, Workspace::new(map.bounds, map.obstacles, vec![]))
            {
                let at = workspace.bounds().min;
                let _ = Continuous::new(std::sync::Arc::new(workspace), at);
            }
        }
        Err(e) => assert!(!e.to_string().is_empty()),
    }
}

/// A weight file.
pub(crate) fn weights(data: &[u8]) {
    match WeightFile::parse("fuzz.safetensors", data) {
        Ok(file) => assert!(file.parameters() <= data.len()),
        Err(e) => assert!(!e.to_string().is_empty()),
    }
}

/// A library of skills, as it stands and as the body of a file with a right checksum.
pub(crate) fn library(data: &[u8]) {
    use sha2::Digest as _;
    let Ok(folder) = tempfile::tempdir() else {
        return;
    };
    let path = folder.path().join("fuzz.library");
    let digest = sha2::Sha256::digest(data);
    let hex: String = digest.iter().map(|b| format!("{b:02x}")).collect();
    let mut whole = format!("nngtl-library 1 sha256:{hex} {}\n", data.len()).into_bytes();
    whole.extend_from_slice(data);
    for bytes in [data, &whole] {
        if std::fs::write(&path, bytes).is_ok()
            && let Err(e) = LibraryFile::read(&path)
        {
            assert!(!e.to_string().is_empty());
        }
    }
}
