//! Putting parts of one data set together that were made in different places.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::differences::{Difference, differences, listed};
use super::generate::{MANIFEST, add_shard};
use super::read::{ReadError, digest, read_manifest};
use super::record::{Manifest, ShardEntry};
use crate::plan::write_atomically;

/// Why parts could not be put together. Nothing but whole shards is ever written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// No part at all.
    #[error("no parts to put together")]
    Nothing,
    /// A manifest that cannot be read.
    #[error(transparent)]
    Manifest(Box<ReadError>),
    /// Parts of different sets.
    #[error(
        "{path}: made with other settings than {first} ({}): parts of different sets do not go together",
        listed(differences, "here")
    )]
    OtherSet {
        /// The part.
        path: PathBuf,
        /// The first part.
        first: PathBuf,
        /// What differs from the first part.
        differences: Vec<Difference>,
    },
    /// Maps that two parts have, with different content or in shards that begin elsewhere.
    #[error(
        "{path}: {file} holds maps {from} to {to}, which are in another part, too, but not the same"
    )]
    Overlap {
        /// The part.
        path: PathBuf,
        /// Its shard.
        file: String,
        /// The first map index.
        from: u64,
        /// The map index after the last.
        to: u64,
    },
    /// Maps that no part has.
    #[error("maps {from} to {to} are in no part: finish that part, or name it, too")]
    Missing {
        /// The first map index.
        from: u64,
        /// The map index after the last.
        to: u64,
    },
    /// A shard that is not what its manifest says.
    #[error("{path}: damaged (its digest is another one): make that part again")]
    Damaged {
        /// The shard.
        path: PathBuf,
    },
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Copies the shards of all `parts` into `out` and writes their common manifest, the same files as if the set
/// had been made in one place. Which part comes first does not matter, and a shard may be in several.
///
/// # Errors
/// Parts that do not belong together, maps that none of them has, damaged shards, and files that cannot be read
/// or written.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<Manifest, MergeError> {
    let read = |part: &PathBuf| {
        let manifest = read_manifest(part).map_err(|e| MergeError::Manifest(Box::new(e)))?;
        Ok((part.clone(), manifest))
    };
    let found: Vec<(PathBuf, Manifest)> = parts.iter().map(read).collect::<Result<_, _>>()?;
    let Some((first, model)) = found.first() else {
        return Err(MergeError::Nothing);
    };
    for (path, part) in &found {
        let differences = differences(model, part);
        if !differences.is_empty() {
            return Err(MergeError::OtherSet {
                path: path.clone(),
                first: first.clone(),
                differences,
            });
        }
    }
    let bounds = |f: fn(&Manifest) -> u64| found.iter().map(move |(_, m)| f(m));
    let (from, to) = (
        bounds(|m| m.from).min().unwrap_or(0),
        bounds(|m| m.to).max().unwrap_or(0),
    );
    let settings = model.settings.clone();
    let mut manifest = Manifest::empty(&model.generator, model.seed, from..to, settings);
    let shards = in_order(&found, from, to)?;
    fs::create_dir_all(out).map_err(at(out))?;
    for (folder, shard) in shards {
        let path = folder.join(&shard.file);
        let bytes = fs::read(&path).map_err(at(&path))?;
        if digest(&bytes) != shard.sha256 {
            return Err(MergeError::Damaged { path });
        }
        let copy = out.join(&shard.file);
        write_atomically(&copy, &bytes).map_err(at(&copy))?;
        add_shard(&mut manifest, shard.clone());
    }
    let path = out.join(MANIFEST);
    let text = serde_json::to_vec_pretty(&manifest).map_err(io::Error::from);
    let mut text = text.map_err(at(&path))?;
    text.push(b'\n');
    write_atomically(&path, &text).map_err(at(&path))?;
    Ok(manifest)
}

/// The shards by the maps that they hold, each once, if they hold all maps from `from` to `to`.
fn in_order<'a>(
    parts: &'a [(PathBuf, Manifest)],
    from: u64,
    to: u64,
) -> Result<Vec<(&'a Path, &'a ShardEntry)>, MergeError> {
    let of = |(path, part): &'a (PathBuf, Manifest)| {
        let path = path.as_path();
        part.shards.iter().map(move |s| (path, s))
    };
    let mut all: Vec<(&Path, &ShardEntry)> = parts.iter().flat_map(of).collect();
    // The same shard may be listed by an earlier program, too, which tells less of it.
    all.sort_by_key(|(_, s)| (s.from, s.to, s.gap.is_none()));
    let content = |s: &ShardEntry| (s.from, s.to, s.sha256.clone());
    all.dedup_by(|a, b| content(a.1) == content(b.1));
    let mut next = from;
    for (path, shard) in &all {
        if shard.from < next {
            return Err(MergeError::Overlap {
                path: path.to_path_buf(),
                file: shard.file.clone(),
                from: shard.from,
                to: shard.to,
            });
        }
        if shard.from > next {
            let (from, to) = (next, shard.from);
            return Err(MergeError::Missing { from, to });
        }
        next = shard.to;
    }
    if next < to {
        return Err(MergeError::Missing { from: next, to });
    }
    Ok(all)
}

fn at(path: &Path) -> impl Fn(io::Error) -> MergeError + use<> {
    let path = path.to_owned();
    move |source| MergeError::Io {
        path: path.clone(),
        source,
    }
}
