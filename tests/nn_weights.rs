//! Weight files that are at fault: every one is refused with all that is wrong, none panics.

mod common;

use std::borrow::Cow;
use std::collections::BTreeMap;

use nngtl::nn::models::Model;
use nngtl::nn::weights::{Fault, Tensor, WeightError, WeightFile};
use proptest::prelude::*;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use sha2::{Digest, Sha256};

const NETWORK: &str = "pathnet-paint";

fn bytes() -> Vec<u8> {
    std::fs::read(common::goldens().join(format!("models/{NETWORK}.safetensors"))).unwrap()
}

/// A weight file taken apart, to be put together again with faults.
struct Parts {
    tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
    metadata: BTreeMap<String, String>,
}

impl Parts {
    fn new() -> Self {
        let bytes = bytes();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let metadata = header.metadata().clone().unwrap().into_iter().collect();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let tensors = tensors
            .iter()
            .map(|(name, t)| {
                (
                    name.to_owned(),
                    (t.dtype(), t.shape().to_vec(), t.data().to_vec()),
                )
            })
            .collect();
        Self { tensors, metadata }
    }

    /// The file, with the digest of its tensors unless the metadata name one.
    fn assemble(&self) -> Vec<u8> {
        let write = |metadata: BTreeMap<String, String>| {
            let views = self.tensors.iter().map(|(name, (dtype, shape, data))| {
                (
                    name.clone(),
                    TensorView::new(*dtype, shape.clone(), data).unwrap(),
                )
            });
            safetensors::serialize(views, Some(metadata.into_iter().collect())).unwrap()
        };
        let mut metadata = self.metadata.clone();
        let plain = write(BTreeMap::new());
        let (length, _) = SafeTensors::read_metadata(&plain).unwrap();
        let digest = Sha256::digest(&plain[8 + length..]);
        let digest = digest
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect::<String>();
        metadata.insert("sha256".to_owned(), digest);
        write(metadata)
    }

    fn config(&mut self, change: impl FnOnce(&mut serde_json::Map<String, serde_json::Value>)) {
        let text = self.metadata.get_mut("config").unwrap();
        let mut config: serde_json::Value = serde_json::from_str(text).unwrap();
        change(config.as_object_mut().unwrap());
        *text = config.to_string();
    }

    fn values(&mut self, name: &str) -> &mut Vec<u8> {
        &mut self.tensors.get_mut(name).unwrap().2
    }
}

fn load(bytes: &[u8]) -> Result<Model, WeightError> {
    Model::read("weights", bytes)
}

fn faults(bytes: &[u8]) -> Vec<Fault> {
    let error = load(bytes).unwrap_err();
    assert!(!error.faults.is_empty());
    assert!(error.to_string().starts_with("weights: "), "{error}");
    error.faults
}

#[test]
fn an_untouched_file_loads() {
    assert!(load(&bytes()).is_ok());
    assert!(load(&Parts::new().assemble()).is_ok());
}

#[test]
fn weights_are_the_same_wherever_a_file_lies_in_memory() {
    let whole = bytes();
    let expected = load(&whole).unwrap().program.constants;
    for shift in 1..4 {
        let moved = [&vec![0; shift], whole.as_slice()].concat();
        assert_eq!(load(&moved[shift..]).unwrap().program.constants, expected);
    }
    // The built-in ones lie so that they need not be copied.
    for bytes in nngtl::nn::embedded().unwrap() {
        let file = WeightFile::parse("built-in", bytes).unwrap();
        let borrowed = |t: &Tensor<'_>| matches!(t.values, Cow::Borrowed(_));
        assert!(cfg!(target_endian = "big") || file.tensors.values().all(borrowed));
    }
}

#[test]
fn all_faults_of_the_tensors_are_told_by_name() {
    let mut parts = Parts::new();
    let head = parts.tensors.remove("head.weight").unwrap();
    parts.tensors.insert("head.wieght".to_owned(), head);
    let (_, shape, data) = parts.tensors.get_mut("condition.bias").unwrap();
    shape[0] -= 1;
    data.truncate(4 * shape[0]);
    let faults = faults(&parts.assemble());
    let text: Vec<String> = faults.iter().map(ToString::to_string).collect();
    assert_eq!(faults.len(), 3, "{text:?}");
    assert!(
        faults
            .iter()
            .any(|f| matches!(f, Fault::Missing { name, .. } if name == "head.weight"))
    );
    assert!(faults.contains(&Fault::Unused("head.wieght".to_owned())));
    assert!(
        faults
            .iter()
            .any(|f| matches!(f, Fault::Shape { name, .. } if name == "condition.bias"))
    );
}

#[test]
fn values_that_are_not_finite_are_told_with_their_place() {
    let mut parts = Parts::new();
    parts.values("condition.bias")[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    parts.values("head.bias")[..4].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes());
    let faults = faults(&parts.assemble());
    assert!(faults.contains(&Fault::NotFinite {
        name: "condition.bias".to_owned(),
        count: 1,
        first: 1
    }));
    assert!(faults.contains(&Fault::NotFinite {
        name: "head.bias".to_owned(),
        count: 1,
        first: 0
    }));
}

#[test]
fn a_negative_variance_is_told() {
    let mut parts = Parts::new();
    parts.values("encoder.0.norm.running_var")[..4].copy_from_slice(&(-1f32).to_le_bytes());
    assert_eq!(
        faults(&parts.assemble()),
        [Fault::Variance("encoder.0.norm.running_var".to_owned())]
    );
}

#[test]
fn other_types_are_told_and_halves_are_read() {
    let mut parts = Parts::new();
    for (dtype, _, data) in parts.tensors.values_mut() {
        let words = data
            .as_chunks::<4>()
            .0
            .iter()
            .map(|&b| half::f16::from_f32(f32::from_le_bytes(b)));
        *data = words.flat_map(half::f16::to_le_bytes).collect();
        *dtype = Dtype::F16;
    }
    assert!(load(&parts.assemble()).is_ok());
    parts.tensors.get_mut("head.bias").unwrap().0 = Dtype::BF16;
    assert!(
        matches!(&faults(&parts.assemble())[..], [Fault::Type { name, .. }] if name == "head.bias")
    );
}

#[test]
fn a_flipped_bit_in_the_tensors_breaks_the_digest() {
    let mut bytes = bytes();
    let last = bytes.len() - 4;
    bytes[last] ^= 1;
    assert!(matches!(faults(&bytes)[..], [Fault::Digest { .. }]));
}

#[test]
fn metadata_that_is_missing_or_broken_is_told() {
    let mut parts = Parts::new();
    parts.metadata.remove("training");
    parts.metadata.insert("config".to_owned(), "{".to_owned());
    let faults = faults(&parts.assemble());
    assert!(faults.contains(&Fault::NoMetadata("training")));
    assert!(faults.iter().any(|f| matches!(
        f,
        Fault::BadMetadata {
            entry: "config",
            ..
        }
    )));
}

#[test]
fn versions_and_sizes_of_the_config_are_checked() {
    let mut parts = Parts::new();
    parts.config(|c| {
        c["encoding"] = 3.into();
        c["labels"] = 0.into();
        c["widths"] = vec![16u64, 1 << 40].into();
    });
    let faults = faults(&parts.assemble());
    assert!(faults.iter().any(|f| matches!(
        f,
        Fault::Version {
            what: "encoding",
            found: 3,
            ..
        }
    )));
    assert!(faults.iter().any(|f| matches!(
        f,
        Fault::Config {
            field: "labels",
            ..
        }
    )));
    assert!(faults.iter().any(|f| matches!(
        f,
        Fault::Config {
            field: "widths",
            ..
        }
    )));
}

#[test]
fn a_name_that_stands_twice_is_told() {
    let bytes = bytes();
    let (length, _) = SafeTensors::read_metadata(&bytes).unwrap();
    let header = std::str::from_utf8(&bytes[8..8 + length])
        .unwrap()
        .trim_end();
    let twice = header.replacen(
        "\"head.bias\":",
        "\"head.bias\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4]},\"head.bias\":",
        1,
    );
    assert_ne!(twice, header);
    let mut broken = (twice.len() as u64).to_le_bytes().to_vec();
    broken.extend(twice.as_bytes());
    broken.extend(&bytes[8 + length..]);
    assert!(faults(&broken).contains(&Fault::Twice("head.bias".to_owned())));
}

#[test]
fn every_truncation_is_refused() {
    let bytes = bytes();
    for length in (0..64).chain((64..bytes.len()).step_by(997)) {
        assert!(load(&bytes[..length]).is_err(), "{length} bytes");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn changed_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = bytes();
        // Most of a file is numbers; what can break a reader is the header.
        let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize + 8;
        for (index, value) in changes {
            bytes[index.index(header)] = value;
        }
        let _ = load(&bytes);
    }

    #[test]
    fn any_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), header in 0u64..400) {
        let mut framed = header.to_le_bytes().to_vec();
        framed.extend(&bytes);
        prop_assert!(load(&framed).is_err());
        prop_assert!(load(&bytes).is_err());
    }

    #[test]
    fn changed_numbers_of_the_config_never_panic(key in any::<prop::sample::Index>(), number in prop_oneof![0u64..300, any::<u64>()], list in any::<bool>()) {
        let mut parts = Parts::new();
        parts.config(|c| {
            let key = c.keys().nth(key.index(c.len())).unwrap().clone();
            c[&key] = if list { vec![number; 3].into() } else { number.into() };
        });
        let _ = load(&parts.assemble());
    }
}

/// Weight files whose digest is not computed when they are loaded, since they are part of the
/// program: here it is.
#[test]
fn the_weights_that_are_built_in_are_sound() {
    for bytes in nngtl::nn::embedded().into_iter().flatten() {
        load(bytes).unwrap();
    }
}

#[test]
fn half_precision_is_read_and_its_faults_are_told() {
    let mut parts = Parts::new();
    for (dtype, _, data) in parts.tensors.values_mut() {
        let words: Vec<f32> = data
            .as_chunks::<4>()
            .0
            .iter()
            .map(|&b| f32::from_le_bytes(b))
            .collect();
        *dtype = Dtype::F16;
        *data = words
            .iter()
            .flat_map(|&v| half::f16::from_f32(v).to_le_bytes())
            .collect();
    }
    let (whole, halved) = (load(&bytes()).unwrap(), load(&parts.assemble()).unwrap());
    for (a, b) in whole
        .program
        .constants
        .iter()
        .zip(&halved.program.constants)
    {
        assert_eq!(a.len(), b.len());
        let largest = a.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert!(
            a.iter()
                .zip(&b[..])
                .all(|(x, y)| (x - y).abs() <= 2e-3 * largest)
        );
    }
    // A number beyond the range of half precision, a shape that lost a row, a type of 64 bits.
    parts.values("head.weight")[..2].copy_from_slice(&half::f16::INFINITY.to_le_bytes());
    let (dtype, _, data) = parts.tensors.get_mut("head.bias").unwrap();
    *dtype = Dtype::F64;
    *data = vec![0; 8];
    let text: Vec<String> = faults(&parts.assemble())
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(text.len(), 2, "{text:?}");
    assert!(
        text.iter()
            .any(|t| t.contains("`head.weight` has 1 values that are not finite"))
    );
    assert!(
        text.iter()
            .any(|t| t.contains("`head.bias` is of type F64"))
    );
}

#[test]
fn faults_of_values_config_and_tensors_are_told_together() {
    let mut parts = Parts::new();
    parts.values("head.weight")[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    parts.tensors.remove("condition.bias").unwrap();
    let extra = parts.tensors["head.bias"].clone();
    parts.tensors.insert("spare\u{1b}".to_owned(), extra);
    let (dtype, _, data) = parts.tensors.get_mut("paint.bias").unwrap();
    (*dtype, _) = (Dtype::BF16, data.truncate(data.len() / 2));
    let error = load(&parts.assemble()).unwrap_err();
    let text = error.to_string();
    for part in [
        "`head.weight` has 1 values that are not finite",
        "`condition.bias` of shape",
        "`spare\\u{1b}` is not part of this model",
        "`paint.bias` is of type BF16",
    ] {
        assert_eq!(text.matches(part).count(), 1, "{part}: {text}");
    }
    assert_eq!(error.faults.len(), 4, "{text}");
    // A version that is not known is told with what is wrong with the values.
    parts.config(|config| {
        config.insert("format".to_owned(), 9.into());
    });
    let text = load(&parts.assemble()).unwrap_err().to_string();
    assert!(
        text.contains("format version 9") && text.contains("not finite"),
        "{text}"
    );
}

#[test]
fn fields_that_mean_nothing_and_names_that_stand_twice_are_refused() {
    let mut parts = Parts::new();
    parts.config(|config| {
        config.insert("powr".to_owned(), 2.into());
    });
    let text = load(&parts.assemble()).unwrap_err().to_string();
    assert!(text.contains("`powr` is no field"), "{text}");

    let mut parts = Parts::new();
    let config = parts.metadata.get_mut("config").unwrap();
    *config = config.replacen('{', "{\"format\": 9, ", 1);
    let text = load(&parts.assemble()).unwrap_err().to_string();
    assert!(text.contains("`format` stands twice"), "{text}");

    // The same in the metadata, where a second digest would hide the first.
    let whole = Parts::new().assemble();
    let (length, _) = SafeTensors::read_metadata(&whole).unwrap();
    let header = std::str::from_utf8(&whole[8..8 + length]).unwrap();
    let twice = header.replacen("\"sha256\"", "\"sha256\":\"\",\"sha256\"", 1);
    let padded = format!("{twice:<width$}", width = twice.len().next_multiple_of(8));
    let size = (padded.len() as u64).to_le_bytes();
    let bytes = [&size[..], padded.as_bytes(), &whole[8 + length..]].concat();
    let text = load(&bytes).unwrap_err().to_string();
    assert!(text.contains("`sha256` stands twice"), "{text}");
}

#[test]
fn a_digest_that_says_nothing_and_norms_that_overflow_are_refused() {
    let whole = Parts::new().assemble();
    let (length, header) = SafeTensors::read_metadata(&whole).unwrap();
    let digest = header.metadata().as_ref().unwrap()["sha256"].clone();
    let header = std::str::from_utf8(&whole[8..8 + length]).unwrap();
    let empty = header.replace(&digest, "");
    let padded = format!("{empty:<length$}");
    let bytes = [&whole[..8], padded.as_bytes(), &whole[8 + length..]].concat();
    assert!(matches!(faults(&bytes)[..], [Fault::Digest { .. }]));

    let mut parts = Parts::new();
    parts.values("encoder.0.norm.weight")[..4].copy_from_slice(&f32::MAX.to_le_bytes());
    parts.values("encoder.0.norm.running_var")[..4].copy_from_slice(&1e-30_f32.to_le_bytes());
    let expected = Fault::Norm("encoder.0.norm".to_owned());
    assert_eq!(faults(&parts.assemble()), [expected]);
}
