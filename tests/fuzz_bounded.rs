//! The fuzz targets of `fuzz/`, a bounded number of times on stable Rust: shipped files, changed at
//! random. Nothing may panic or take long.
#![allow(clippy::print_stdout)] // tells what was run

mod fuzz_entries;

use std::path::Path;
use std::time::{Duration, Instant};

use nngtl::random::{Random, generator, unit};

/// How many cases of each kind; more with `NNGTL_TEST_SCALE` (a factor).
fn cases(n: u64) -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (n as f64 * scale).max(1.0) as u64
}

fn below(random: &mut Random, n: usize) -> usize {
    ((unit(random) * n as f64) as usize).min(n.saturating_sub(1))
}

/// Words that break things.
const WORDS: [&str; 30] = [
    "0",
    "-1",
    "1e308",
    "1e-320",
    "999999999",
    "18446744073709551616",
    "NaN",
    "inf",
    "null",
    "[",
    "]",
    "[]",
    "{",
    "}",
    "(",
    ")",
    "\"",
    "'",
    "\n",
    "\r\n",
    ",",
    ":",
    "=",
    "#",
    "- ",
    "\0",
    "\u{feff}",
    "é",
    "U",
    "true",
];

/// A changed copy of `seed`: some bytes flipped, cut out, doubled, swapped for other bytes of it or
/// for words.
fn changed(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut data = seed.to_vec();
    for _ in 0..=below(random, 4) {
        if data.is_empty() {
            break;
        }
        let at = below(random, data.len());
        let most = 1 + below(random, 40);
        let length = 1 + below(random, most);
        let end = (at + length).min(data.len());
        match below(random, 7) {
            0 => data[at] ^= 1 << below(random, 8),
            1 => {
                data.drain(at..end);
            }
            2 => {
                let piece = data[at..end].to_vec();
                let to = below(random, data.len());
                data.splice(to..to, piece);
            }
            3 => data[at] = (unit(random) * 256.0) as u8,
            4 => {
                let word = WORDS[below(random, WORDS.len())];
                data.splice(at..at, word.bytes());
            }
            5 => {
                // A number takes the place of another.
                let digit = data[at..].iter().position(u8::is_ascii_digit);
                if let Some(from) = digit.map(|d| at + d) {
                    let rest = &data[from..];
                    let n = rest
                        .iter()
                        .take_while(|b| b.is_ascii_digit() || **b == b'.')
                        .count();
                    let word = WORDS[below(random, 8)];
                    data.splice(from..from + n, word.bytes());
                }
            }
            _ => data.truncate(at),
        }
    }
    data
}

/// Runs changed copies of the seeds, each of which is run unchanged first.
fn run(name: &str, seeds: &[Vec<u8>], n: u64, entry: fn(&[u8])) {
    let began = Instant::now();
    let mut slowest = Duration::ZERO;
    assert!(!seeds.is_empty(), "{name}: no seeds");
    seeds.iter().for_each(|seed| entry(seed));
    for i in 0..n {
        let mut random = generator(i, 41);
        let data = changed(&seeds[i as usize % seeds.len()], &mut random);
        let case = Instant::now();
        let run = std::panic::catch_unwind(|| entry(&data));
        if let Err(panic) = run {
            println!("{name}, case {i}: {:?}", String::from_utf8_lossy(&data));
            std::panic::resume_unwind(panic);
        }
        slowest = slowest.max(case.elapsed());
    }
    println!(
        "{name}: {n} cases in {:.2?}, the slowest {slowest:.2?}",
        began.elapsed()
    );
    assert!(slowest < Duration::from_secs(20), "{name}: {slowest:?}");
}

fn file(name: &str) -> Vec<u8> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::read(root.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn with_first(first: u8, rest: &[u8]) -> Vec<u8> {
    [&[first], rest].concat()
}

#[test]
fn formulas() {
    let seeds = [
        "[]<> a && (!b U c) && <> d",
        "G(a -> X(!b W (c & F d)))",
        "! (p0 xor p1) <-> (p2 R p3) M true",
        "<>[]((a V b) || not c /\\ d \\/ e => false)",
    ];
    let seeds: Vec<Vec<u8>> = seeds.iter().map(|s| s.as_bytes().to_vec()).collect();
    run("formula", &seeds, cases(4_000), fuzz_entries::formula);
}

#[test]
fn automata() {
    let seeds = [
        "HOA: v1\nStates: 1\nStart: 0\nAP: 2 \"a\" \"b\"\nacc-name: generalized-Buchi 2\nAcceptance: 2 Inf(0)&Inf(1)\n--BODY--\nState: 0\n[!0&!1] 0\n[0&!1] 0 {0}\n[!0&1] 0 {1}\n[0&1] 0 {0 1}\n--END--\n",
        "HOA: v1 /* a /* nested */ comment */ name: \"x \\\" y\" States: 3 Start: 1 Alias: @x 0&!1 AP: 2 \"p\" \"q\" Acceptance: 1 Inf(0) --BODY-- State: [@x|1] 0 \"s\" {0} 1 2 State: 1 {0} [t] 0 [@x] 1 State: 2 --END--",
    ];
    let seeds: Vec<Vec<u8>> = seeds.iter().map(|s| s.as_bytes().to_vec()).collect();
    run("hoa", &seeds, cases(4_000), fuzz_entries::hoa);
}

#[test]
fn scenarios() {
    let small = br#"{"name": "x", "start": [0.1, 0.1], "task": "<> a", "workspace": {"bounds": [[0, 0], [1, 1]], "obstacles": [[[0.4, 0], [0.6, 0], [0.6, 0.7]]], "regions": {"a": [[0.7, 0.1], [0.9, 0.1], [0.8, 0.3]]}}}"#;
    let seeds = [
        with_first(0, &file("scenarios/case-study.toml")),
        with_first(0, &file("scenarios/overlap.toml")),
        with_first(0, &file("scenarios/office.toml")),
        with_first(0, &file("scenarios/transfer-grid.toml")),
        with_first(1, small),
        with_first(2, small),
    ];
    run("scenario", &seeds, cases(3_000), fuzz_entries::scenario);
}

#[test]
fn maps() {
    let ros = |first: u8, yaml: &[u8], picture: &[u8]| [&[first], yaml, &[0], picture].concat();
    let yaml = file("scenarios/office.yaml");
    let mut png = Vec::new();
    {
        let mut encoder = png::Encoder::new(&mut png, 6, 5);
        encoder.set_color(png::ColorType::Rgba);
        let mut writer = encoder.write_header().unwrap();
        let pixels: Vec<u8> = (0..6 * 5 * 4).map(|i| (i * 37 % 256) as u8).collect();
        writer.write_image_data(&pixels).unwrap();
    }
    let cave = "type octile\nheight 6\nwidth 9\nmap\n.........\n.@@@@@@@.\n.@.....@.\n.@.@T@.@.\n.@.....@.\nSW@@@@@@.\n";
    let seeds = [
        ros(0, &yaml, b"P5 8 5 255\n\x00\xfe\xfe\xfe\x00\xfe\x00\x00\xfe\x00\xfe\x00\xfe\x00\xfe\x00\xcd\xcd\xfe\xfe\x00\x00\x00\x00\xfe\xfe\xfe\xfe\x00\xfe\xfe\x00\xfe\x00\xfe\x00\xfe\xfe\xfe\xfe"),
        ros(0x60, &yaml, b"P2\n# text\n3 2 9\n0 9 5\n9 0 3\n"),
        ros(0x30, b"image: a.png\nresolution: 0.5\norigin: [1, 2, 0.3]\nnegate: 1\noccupied_thresh: 0.6\nfree_thresh: 0.3\nmode: scale\n", &png),
        with_first(1, cave.as_bytes()),
        with_first(0x31, cave.as_bytes()),
        with_first(2, &file("scenarios/campus.geojson")),
    ];
    run("map", &seeds, cases(4_000), fuzz_entries::map);
}

#[test]
fn weights() {
    let header = br#"{"__metadata__":{"config":"{\"a\":1}","training":"{}"},"w":{"dtype":"F32","shape":[2,2],"data_offsets":[0,16]},"b":{"dtype":"F16","shape":[2],"data_offsets":[16,20]}}"#;
    let mut small = (header.len() as u64).to_le_bytes().to_vec();
    small.extend(header);
    small.extend([
        0, 0, 128, 63, 1, 2, 3, 4, 0, 0, 128, 127, 9, 8, 7, 6, 0, 60, 0, 124,
    ]);
    let seeds = [small];
    run("weights", &seeds, cases(4_000), fuzz_entries::weights);
    let whole = [file("models/compact/statenet.safetensors")];
    run("weights", &whole, cases(20), fuzz_entries::weights);
}

#[test]
fn libraries() {
    let body = br#"{"map":"ab","regions":["a"],"skills":[{"path":[[0.1,0.2],[0.3,0.4]],"letters":[[],["a"]],"cost":0.3}]}"#;
    let digest = {
        use sha2::Digest as _;
        sha2::Sha256::digest(body)
    };
    let hex: String = digest.iter().map(|b| format!("{b:02x}")).collect();
    let mut whole = format!("nngtl-library 1 sha256:{hex} {}\n", body.len()).into_bytes();
    whole.extend(body);
    run(
        "library",
        &[body.to_vec(), whole],
        cases(800),
        fuzz_entries::library,
    );
}
