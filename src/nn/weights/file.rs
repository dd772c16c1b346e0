//! Reading a file into tensors.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashSet};
use std::fmt;

use safetensors::{Dtype, SafeTensors};
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use sha2::{Digest, Sha256};

use super::{Fault, WeightError};
use crate::number::hex;

/// A tensor as it stands in a file, its values as `f32`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor<'a> {
    /// The sizes of its axes.
    pub shape: Vec<usize>,
    /// `F32` or `F16`, as stored.
    pub stored: &'static str,
    /// The values, last axis fastest: the file's own bytes where they are `f32` in this machine's
    /// order and place, so that weights are copied once only, by who packs them.
    pub values: Cow<'a, [f32]>,
}

/// The contents of a weight file, checked as far as that is possible without knowing the model.
#[derive(Debug, Clone)]
pub struct WeightFile<'a> {
    /// The file's name, for messages.
    pub name: String,
    /// The `config` of its metadata.
    pub config: serde_json::Value,
    /// The training record of its metadata.
    pub training: serde_json::Value,
    /// The digest of the tensor buffer, in hexadecimal.
    pub sha256: String,
    /// The tensors by name.
    pub tensors: BTreeMap<String, Tensor<'a>>,
}

impl<'a> WeightFile<'a> {
    /// Reads a file's bytes; `name` stands for the file in messages.
    ///
    /// # Errors
    /// A broken structure, a name that stands twice, missing metadata, a digest that does not
    /// match, tensors that are not `f32` or `f16`, or that hold NaN or infinite values.
    pub fn parse(name: &str, bytes: &'a [u8]) -> Result<Self, WeightError> {
        Self::read(name, bytes, false)
    }

    /// As [`Self::parse`], for bytes that are part of the program: their digest is the one they
    /// state, their values are finite and no name stands twice, which a test has checked once and
    /// for all.
    pub(in crate::nn) fn parse_trusted(name: &str, bytes: &'a [u8]) -> Result<Self, WeightError> {
        Self::read(name, bytes, true)
    }

    fn read(name: &str, bytes: &'a [u8], trusted: bool) -> Result<Self, WeightError> {
        let fail = |faults| WeightError {
            file: name.to_owned(),
            faults,
        };
        let broken = |reason: String| fail(vec![Fault::Structure(reason)]);
        let (length, header) =
            SafeTensors::read_metadata(bytes).map_err(|e| broken(e.to_string()))?;
        let (text, buffer) = bytes[8..].split_at(length);
        if text.first() != Some(&b'{') {
            return Err(broken("the header does not begin with `{`".to_owned()));
        }
        let mut faults = if trusted {
            Vec::new()
        } else {
            duplicates(text)
        };
        let mut entry = |key: &'static str| {
            let found = header.metadata().as_ref().and_then(|m| m.get(key)).cloned();
            if found.is_none() {
                faults.push(Fault::NoMetadata(key));
            }
            found.unwrap_or_default()
        };
        let (config, training, stated) = (entry("config"), entry("training"), entry("sha256"));
        let mut json = |entry: &'static str, text: &str| {
            serde_json::from_str(text).unwrap_or_else(|e| {
                if !text.is_empty() {
                    faults.push(Fault::BadMetadata {
                        entry,
                        reason: e.to_string(),
                    });
                }
                serde_json::Value::Null
            })
        };
        let (config, training) = (json("config", &config), json("training", &training));
        let sha256 = if trusted {
            stated.clone()
        } else {
            hex(&Sha256::digest(buffer))
        };
        if !stated.is_empty() && stated != sha256 {
            faults.push(Fault::Digest {
                found: sha256.clone(),
                expected: stated,
            });
        }
        let tensors = header
            .tensors()
            .into_iter()
            .filter_map(|(name, info)| {
                // Reading the header has checked that these lie in the buffer, one after the other.
                let data = &buffer[info.data_offsets.0..info.data_offsets.1];
                let tensor = read_tensor(&name, info.dtype, &info.shape, data);
                let tensor = tensor.map_err(|fault| faults.push(fault)).ok()?;
                if !trusted {
                    faults.extend(not_finite(&name, &tensor.values));
                }
                Some((name, tensor))
            })
            .collect();
        if !faults.is_empty() {
            faults.sort_by_key(ToString::to_string);
            return Err(fail(faults));
        }
        Ok(Self {
            name: name.to_owned(),
            config,
            training,
            sha256,
            tensors,
        })
    }

    /// How many numbers the tensors hold together.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.tensors.values().map(|t| t.values.len()).sum()
    }
}

fn read_tensor<'a>(
    name: &str,
    dtype: Dtype,
    shape: &[usize],
    data: &'a [u8],
) -> Result<Tensor<'a>, Fault> {
    let (stored, values) = match dtype {
        Dtype::F32 => ("F32", singles(data)),
        Dtype::F16 => {
            let (words, _) = data.as_chunks::<2>();
            let values = words.iter().map(|&b| half::f16::from_le_bytes(b).to_f32());
            ("F16", Cow::Owned(values.collect()))
        }
        other => {
            return Err(Fault::Type {
                name: name.to_owned(),
                found: format!("{other:?}"),
            });
        }
    };
    Ok(Tensor {
        shape: shape.to_vec(),
        stored,
        values,
    })
}

/// Numbers in little-endian order, where they stand if they stand right for this machine.
fn singles(data: &[u8]) -> Cow<'_, [f32]> {
    match bytemuck::try_cast_slice(data) {
        Ok(values) if cfg!(target_endian = "little") => Cow::Borrowed(values),
        _ => {
            let (words, _) = data.as_chunks::<4>();
            Cow::Owned(words.iter().map(|&b| f32::from_le_bytes(b)).collect())
        }
    }
}

/// The values that are NaN or infinite, if there are any.
fn not_finite(name: &str, values: &[f32]) -> Option<Fault> {
    // A pass without branches first: nearly all tensors are sound.
    if values.iter().fold(true, |all, v| all & v.is_finite()) {
        return None;
    }
    let wrong = || values.iter().map(|v| !v.is_finite());
    Some(Fault::NotFinite {
        name: name.to_owned(),
        count: wrong().filter(|&w| w).count(),
        first: wrong().position(|w| w)?,
    })
}

/// The names that stand more than once in a header (JSON readers keep the last one silently).
fn duplicates(header: &[u8]) -> Vec<Fault> {
    struct Names(Vec<Fault>);
    impl<'de> Visitor<'de> for Names {
        type Value = Vec<Fault>;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object")
        }
        fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut seen = HashSet::new();
            while let Some((name, IgnoredAny)) = map.next_entry::<String, IgnoredAny>()? {
                if let Some(twice) = seen.replace(name) {
                    self.0.push(Fault::Twice(twice));
                }
            }
            Ok(self.0)
        }
    }
    let mut reader = serde_json::Deserializer::from_slice(header);
    reader
        .deserialize_map(Names(Vec::new()))
        .unwrap_or_else(|e| vec![Fault::Structure(e.to_string())])
}
