//! `nngtl model show`.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use crate::nn::{MODEL_FILES, ModelInfo};

/// Records that are longer, in characters, are shortened for people.
const LINE: usize = 300;

pub(super) fn show(path: &Path, console: &Console) -> Result<(), Failure> {
    let files = if path.is_dir() {
        MODEL_FILES.map(|name| path.join(name)).to_vec()
    } else {
        vec![path.to_owned()]
    };
    let read = |file: &std::path::PathBuf| {
        ModelInfo::read(file).map_err(|e| Failure::input(e.to_string()))
    };
    let models = files.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let text = if console.json() {
        let object = json!({ "version": JSON_VERSION, "outcome": "shown", "models": models });
        format!("{object}\n")
    } else {
        models.iter().map(describe).collect::<Vec<_>>().join("\n")
    };
    Ok(console.result(&text)?)
}

fn describe(model: &ModelInfo) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{}: {} parameters, {} bytes, {:.1} million multiply-adds\nsha256 {}",
        model.file,
        model.parameters,
        model.bytes,
        model.multiply_adds as f64 / 1e6,
        model.sha256
    );
    section(&mut text, "config", &model.config);
    section(&mut text, "training", &model.training);
    let _ = writeln!(text, "tensors");
    let widest = model.tensors.iter().map(|t| t.0.len()).max().unwrap_or(0);
    for (name, shape, stored) in &model.tensors {
        let _ = writeln!(text, "  {name:widest$}  {stored}  {shape:?}");
    }
    text
}

fn section(text: &mut String, title: &str, value: &Value) {
    let _ = writeln!(text, "{title}");
    match value.as_object() {
        Some(fields) if !fields.is_empty() => {
            for (key, value) in fields {
                let whole = line(value);
                match value.as_object().and_then(|members| members.iter().next()) {
                    Some((first, member)) if whole.len() > LINE => {
                        let more = value.as_object().map_or(0, serde_json::Map::len) - 1;
                        let _ = writeln!(
                            text,
                            "  {key}:\n    {first}: {}\n    and {more} more: --json shows all",
                            line(member)
                        );
                    }
                    _ => {
                        let _ = writeln!(text, "  {key}: {whole}");
                    }
                }
            }
        }
        _ => {
            let _ = writeln!(text, "  none");
        }
    }
}

/// A value on one line, fractions to four digits.
fn line(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<String> = fields
                .iter()
                .map(|(key, value)| format!("{key} {}", line(value)))
                .collect();
            format!("{{{}}}", fields.join(", "))
        }
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(line).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Number(number) => match number.as_f64() {
            Some(fraction) if number.is_f64() => format!("{}", rounded(fraction)),
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// To four significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_records_are_shortened() {
        let group = json!({"missions": 900, "loss": 0.018_809_107_160_195_71});
        let groups: serde_json::Map<String, Value> =
            (0..30).map(|k| (format!("g{k}"), group.clone())).collect();
        let mut text = String::new();
        let record = json!({"rate": 0.0015, "graph": [48, 48], "held_out": groups});
        section(&mut text, "training", &record);
        assert_eq!(
            text,
            "training\n  rate: 0.0015\n  graph: [48, 48]\n  held_out:\n    g0: {missions 900, loss 0.01881}\n    and 29 more: --json shows all\n"
        );
    }
}
