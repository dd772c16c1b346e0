"""Reads data sets as docs/dataset.md describes them, and refuses what is not whole."""

import gzip
import hashlib
import json
from pathlib import Path

FORMAT = 1


class DataError(ValueError):
    """A data set that cannot be used; the message names the file."""


def read_manifest(directory):
    """The manifest of a data set, its format checked."""
    path = Path(directory) / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{path}: not found; a data set is a directory with manifest.json and shards") from None
    except json.JSONDecodeError as error:
        raise DataError(f"{path}: not JSON: {error}") from None
    if manifest.get("format") != FORMAT:
        raise DataError(f"{path}: format {manifest.get('format')!r}, expected {FORMAT}: generate the set anew")
    return manifest


def digest(path):
    """The hex SHA-256 of a file."""
    value = hashlib.sha256()
    with open(path, "rb") as file:
        for block in iter(lambda: file.read(1 << 20), b""):
            value.update(block)
    return value.hexdigest()


def verify(directory):
    """Checks that every shard of the manifest is there and has its digest; returns the manifest."""
    manifest = read_manifest(directory)
    for shard in manifest["shards"]:
        path = Path(directory) / shard["file"]
        if not path.is_file():
            raise DataError(f"{path}: named in the manifest but missing")
        found = digest(path)
        if found != shard["sha256"]:
            raise DataError(f"{path}: SHA-256 is {found}, the manifest says {shard['sha256']}: fetch it again")
    return manifest


def maps(directory, manifest):
    """All maps of a data set, shard by shard: where each stands (for messages), and the map as a dictionary."""
    for shard in manifest["shards"]:
        path = Path(directory) / shard["file"]
        with gzip.open(path, "rt", encoding="utf-8") as lines:
            for number, line in enumerate(lines, start=1):
                place = f"{path}: line {number}"
                try:
                    entry = json.loads(line)
                except json.JSONDecodeError as error:
                    raise DataError(f"{place}: not JSON: {error}") from None
                yield place, entry


def fingerprint(manifest):
    """A short name of a data set's content: a digest of its shards' digests."""
    text = "\n".join(shard["sha256"] for shard in manifest["shards"])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
