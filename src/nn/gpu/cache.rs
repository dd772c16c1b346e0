//! Compiled kernels on disk, where the adapter gives them away (Vulkan).
//!
//! Many drivers keep what they compile by themselves; for those that do not, this saves the
//! compilation at every start but the first. A file holds a mark, the SHA-256 of the rest, and
//! what the driver gave. It is never more than a help: whatever is wrong with folder or file is
//! logged, and the kernels are compiled.

use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use wgpu::{AdapterInfo, Device, PipelineCache};

use super::kernels;

/// What a file begins with.
const MARK: &[u8; 16] = b"nngtl kernels 1\n";

/// Bytes of a SHA-256.
const DIGEST: usize = 32;

/// More than this is not read: all kernels together are some hundred kilobytes.
const LARGEST: u64 = 64 << 20;

/// A driver's cache of pipelines, and the file that it came from and goes to.
#[derive(Debug)]
pub(super) struct KernelCache {
    cache: PipelineCache,
    file: PathBuf,
    /// The digest of what the file holds.
    kept: Option<[u8; DIGEST]>,
}

impl KernelCache {
    /// The cache of this device, filled from its file in `folder` if there is a sound one. `None`
    /// if the adapter's kernels cannot be kept.
    pub(super) fn open(device: &Device, adapter: &AdapterInfo, folder: &Path) -> Option<Self> {
        let adapter = wgpu::util::pipeline_cache_key(adapter)?;
        // Another program or other shaders would fill the file with what nobody asks for.
        let version = env!("CARGO_PKG_VERSION");
        let shaders = &kernels::digest()[..16];
        let file = folder.join(format!("{adapter}-{version}-{shaders}.bin"));
        let data = match read(&file) {
            Ok(data) => Some(data),
            Err(Unusable::Missing) => None,
            Err(why) => {
                log::warn!(
                    "the kernel cache {} is not used: {why}; kernels are compiled anew",
                    file.display()
                );
                None
            }
        };
        Some(Self {
            kept: data.as_deref().map(digest),
            cache: create(device, data.as_deref()),
            file,
        })
    }

    /// What pipelines are made with.
    pub(super) fn pipelines(&self) -> &PipelineCache {
        &self.cache
    }

    /// Writes what the driver has compiled, if that is more than the file holds.
    pub(super) fn keep(&mut self) {
        let Some(data) = self.cache.get_data() else {
            return;
        };
        let digest = digest(&data);
        if self.kept == Some(digest) {
            return;
        }
        match write(&self.file, &digest, &data) {
            Ok(()) => log::debug!(
                "kept {} bytes of kernels in {}",
                data.len(),
                self.file.display()
            ),
            Err(e) => log::warn!(
                "compiled kernels cannot be kept in {}: {e}",
                self.file.display()
            ),
        }
        // A folder that cannot be written is told once.
        self.kept = Some(digest);
    }
}

/// The one call of this crate's that the driver takes on trust.
#[allow(unsafe_code)]
fn create(device: &Device, data: Option<&[u8]>) -> PipelineCache {
    let descriptor = wgpu::PipelineCacheDescriptor {
        label: Some("kernels"),
        data,
        // Data of another driver or version is left aside.
        fallback: true,
    };
    // SAFETY: `data` must be what `PipelineCache::get_data` returned. It is what `keep` wrote: the
    // file lies in a folder that on Unix nobody but its owner may write to, nor to the file itself
    // (`private`); it was moved there whole; its digest was computed from what `get_data` returned
    // and is checked before use; its name has the adapter's key, and wgpu checks adapter, driver
    // and length again in a header of its own.
    unsafe { device.create_pipeline_cache(&descriptor) }
}

/// Why a file is not used.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error("there is none")]
    Missing,
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("others than its owner may write it")]
    Shared,
    #[error("it is no kernel cache, or damaged")]
    Damaged,
}

fn read(path: &Path) -> Result<Vec<u8>, Unusable> {
    let file = match fs::File::open(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Err(Unusable::Missing),
        opened => opened?,
    };
    let folder = path.parent().unwrap_or(path);
    if !(private(&file.metadata()?) && private(&fs::metadata(folder)?)) {
        return Err(Unusable::Shared);
    }
    let mut bytes = Vec::new();
    file.take(LARGEST).read_to_end(&mut bytes)?;
    let sound = bytes
        .split_at_checked(MARK.len() + DIGEST)
        .filter(|(head, data)| head.starts_with(MARK) && head[MARK.len()..] == digest(data));
    match sound {
        Some((_, data)) => Ok(data.to_vec()),
        None => Err(Unusable::Damaged),
    }
}

/// Whether its owner alone may write it.
#[cfg(unix)]
fn private(of: &fs::Metadata) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    of.permissions().mode() & 0o022 == 0
}

/// Elsewhere folders of users are theirs by default.
#[cfg(not(unix))]
fn private(_: &fs::Metadata) -> bool {
    true
}

/// Writes a file beside its place and moves it there: readers see the old one or the new one.
fn write(path: &Path, digest: &[u8; DIGEST], data: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(path);
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    for part in [&MARK[..], digest, data] {
        file.write_all(part)?;
    }
    file.persist(path)?;
    Ok(())
}

fn digest(data: &[u8]) -> [u8; DIGEST] {
    Sha256::digest(data).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_as_they_were_written_and_not_otherwise() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/kernels.bin");
        assert!(matches!(read(&path), Err(Unusable::Missing)));
        let data = b"what a driver gave".to_vec();
        write(&path, &digest(&data), &data).unwrap();
        assert_eq!(read(&path).unwrap(), data);
        let whole = fs::read(&path).unwrap();
        for at in [0, MARK.len(), whole.len() - 1] {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            fs::write(&path, damaged).unwrap();
            assert!(matches!(read(&path), Err(Unusable::Damaged)), "byte {at}");
        }
        for length in [0, MARK.len(), whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(
                matches!(read(&path), Err(Unusable::Damaged)),
                "{length} bytes"
            );
        }
        // A later run mends it.
        write(&path, &digest(&data), &data).unwrap();
        assert_eq!(read(&path).unwrap(), data);
    }

    #[cfg(unix)]
    #[test]
    fn what_others_may_write_is_not_trusted() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kernels.bin");
        write(&path, &digest(b"x"), b"x").unwrap();
        for of in [path.as_path(), folder.path()] {
            let mode = fs::metadata(of).unwrap().permissions();
            fs::set_permissions(of, fs::Permissions::from_mode(0o777)).unwrap();
            assert!(matches!(read(&path), Err(Unusable::Shared)));
            fs::set_permissions(of, mode).unwrap();
            assert!(read(&path).is_ok());
        }
    }
}
