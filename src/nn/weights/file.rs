//! Reading a file into tensors.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashSet};
use std::fmt;

use safetensors::{Dtype, SafeTensors};
use serde::Deserialize;
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
        Self::examine(name, bytes)?.sound()
    }

    /// As [`Self::parse`], with what is wrong beside what could be read, so that the model can add what it finds.
    pub(in crate::nn) fn examine(name: &str, bytes: &'a [u8]) -> Result<Examined<'a>, WeightError> {
        Self::read(name, bytes, false)
    }

    /// As [`Self::examine`], for bytes that are part of the program: their digest is the one they
    /// state, their values are finite and no name stands twice, which a test has checked once and
    /// for all.
    pub(in crate::nn) fn examine_trusted(
        name: &str,
        bytes: &'a [u8],
    ) -> Result<Examined<'a>, WeightError> {
        Self::read(name, bytes, true)
    }

    fn read(name: &str, bytes: &'a [u8], trusted: bool) -> Result<Examined<'a>, WeightError> {
        let broken = |reason: String| WeightError {
            file: name.to_owned(),
            faults: vec![Fault::Structure(reason)],
        };
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
            found
        };
        let texts = [entry("config"), entry("training")];
        let stated = entry("sha256");
        let mut json = |entry: &'static str, text: Option<String>| {
            let text = text?; // told as missing
            if !trusted {
                faults.extend(duplicates(text.as_bytes()));
            }
            let read = serde_json::from_str(&text);
            let read = read.map_err(|e| {
                faults.push(Fault::BadMetadata {
                    entry,
                    reason: e.to_string(),
                });
            });
            read.ok()
        };
        let [config, training] = texts;
        let (config, training) = (json("config", config), json("training", training));
        let sha256 = match &stated {
            Some(stated) if trusted => stated.clone(),
            _ => hex(&Sha256::digest(buffer)),
        };
        if let Some(expected) = stated.filter(|stated| *stated != sha256) {
            let found = sha256.clone();
            faults.push(Fault::Digest { found, expected });
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
        faults.sort_by_key(ToString::to_string);
        let file = Self {
            name: name.to_owned(),
            config: config.unwrap_or_default(),
            training: training.unwrap_or_default(),
            sha256,
            tensors,
        };
        Ok(Examined { file, faults })
    }

    /// How many numbers the tensors hold together.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.tensors.values().map(|t| t.values.len()).sum()
    }
}

/// What could be read of a weight file, and what is wrong with it.
#[derive(Debug)]
pub(in crate::nn) struct Examined<'a> {
    pub(in crate::nn) file: WeightFile<'a>,
    pub(in crate::nn) faults: Vec<Fault>,
}

impl<'a> Examined<'a> {
    /// The file, if nothing is wrong with it.
    fn sound(self) -> Result<WeightFile<'a>, WeightError> {
        if self.faults.is_empty() {
            return Ok(self.file);
        }
        Err(WeightError {
            file: self.file.name,
            faults: self.faults,
        })
    }

    /// The file, and what `build` makes of it; or all that is wrong with it, with what `build` says of it.
    pub(in crate::nn) fn build<T>(
        self,
        build: impl FnOnce(&WeightFile<'a>) -> Result<T, WeightError>,
    ) -> Result<(WeightFile<'a>, T), WeightError> {
        let Self { file, mut faults } = self;
        match build(&file) {
            Ok(built) if faults.is_empty() => return Ok((file, built)),
            Ok(_) => {}
            Err(e) => {
                // A tensor of a type that cannot be read is there, and a config that cannot be read was told.
                let of_other_type = |name: &str| {
                    let mut types = faults.iter();
                    types.any(|f| matches!(f, Fault::Type { name: n, .. } if n == name))
                };
                let told = |fault: &Fault| match fault {
                    Fault::Missing { name, .. } => of_other_type(name),
                    _ => file.config.is_null(),
                };
                let more: Vec<Fault> = e.faults.into_iter().filter(|f| !told(f)).collect();
                faults.extend(more);
            }
        }
        Err(WeightError {
            file: file.name,
            faults,
        })
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

/// The names that stand more than once in an object, or in the header's `__metadata__` (JSON readers keep the last one silently). What is no
/// object has none.
fn duplicates(object: &[u8]) -> Vec<Fault> {
    #[derive(Default)]
    struct Names(Vec<Fault>);
    impl<'de> Visitor<'de> for Names {
        type Value = Self;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object")
        }
        fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Self, A::Error> {
            let mut seen = HashSet::new();
            while let Some(name) = map.next_key::<String>()? {
                if name == "__metadata__" {
                    self.0.extend(map.next_value::<Self>()?.0);
                } else {
                    map.next_value::<IgnoredAny>()?;
                }
                if let Some(twice) = seen.replace(name) {
                    self.0.push(Fault::Twice(twice));
                }
            }
            Ok(self)
        }
    }
    impl<'de> Deserialize<'de> for Names {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_map(Self::default())
        }
    }
    // What cannot be read is told by who reads it.
    serde_json::from_slice::<Names>(object).map_or_else(|_| Vec::new(), |names| names.0)
}
