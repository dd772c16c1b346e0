//! `nngtl model show`.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use crate::nn::{MODEL_FILES, ModelInfo};

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
                let _ = writeln!(text, "  {key}: {value}");
            }
        }
        _ => {
            let _ = writeln!(text, "  none");
        }
    }
}
