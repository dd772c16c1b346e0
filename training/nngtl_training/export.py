"""Weight files: safetensors with config, training record and digest (docs/networks.md, *Files*)."""

import argparse
import hashlib
import json
import os
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save

from . import models

FORMAT, ENCODING = 1, 1
# Version 2 is how the published code encodes (docs/networks.md, *Published checkpoints*).
ENCODINGS = (1, 2)
TRAINING_ONLY = ("dropout",)


def buffer_digest(data):
    """The hex SHA-256 of what follows the header of a safetensors file's bytes."""
    header = int.from_bytes(data[:8], "little")
    return hashlib.sha256(data[8 + header :]).hexdigest()


def _ordered(data):
    """The same file with its metadata in alphabetical order (the library's order changes from run to run)."""
    end = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:end])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + data[end:]


def tensors(model, half=False):
    """What a file holds of a model: parameters and running statistics, as f32 or f16."""
    return {
        name: value.detach().to("cpu", torch.float16 if half else torch.float32).contiguous()
        for name, value in model.state_dict().items()
        if not name.endswith("num_batches_tracked")
    }


def write(path, model, training=None, extra=None, half=False):
    """Writes a weight file, in f16 if ``half``; ``extra`` joins the config (for instance ``{"power": 4}``)."""
    config = {"format": FORMAT, "encoding": ENCODING, **model.config, **(extra or {})}
    for key in TRAINING_ONLY:
        config.pop(key, None)
    held = tensors(model, half)
    wrong = [name for name, value in held.items() if not bool(torch.isfinite(value).all())]
    if wrong:
        raise ValueError(f"{path}: not written, values are not finite in {', '.join(wrong)}")
    metadata = {
        "config": json.dumps(config),
        "training": json.dumps(training or {}),
        "sha256": buffer_digest(save(held)),
    }
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Whole or not at all, also when the disk fills up in the middle.
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(_ordered(save(held, metadata)))
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def read(path):
    """The model of a weight file and its training record, after checking digest, names and shapes."""
    path = Path(path)
    with safe_open(path, "pt") as file:
        metadata = file.metadata() or {}
        held = {name: file.get_tensor(name) for name in file.keys()}
    if metadata.get("sha256") != buffer_digest(path.read_bytes()):
        raise ValueError(f"{path}: the tensors do not have the digest that the file names: fetch it again")
    config = json.loads(metadata["config"])
    for key, known in (("format", (FORMAT,)), ("encoding", ENCODINGS)):
        if config.pop(key, None) not in known:
            raise ValueError(f"{path}: {key} is not {' or '.join(map(str, known))}")
    model = models.build(config)
    missing, unused = model.load_state_dict(held, strict=False)
    missing = [name for name in missing if not name.endswith("num_batches_tracked")]
    if missing or unused:
        raise ValueError(f"{path}: missing tensors {missing}, unknown tensors {unused}")
    return model.eval(), json.loads(metadata["training"])


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Writes the weight file of a training run.")
    parser.add_argument("run", type=Path, help="folder that nngtl-train wrote")
    parser.add_argument("out", type=Path, help="weight file, for example models/compact/pathnet.safetensors")
    parser.add_argument("--power", type=float, help="exponent that inference applies to the heatmap")
    parser.add_argument("--half", action="store_true", help="store the tensors as 16-bit floats: half the size")
    options = parser.parse_args(arguments)
    state = torch.load(options.run / "checkpoint.pt", map_location="cpu", weights_only=False)
    model = models.build(state["config"]["network"])
    model.load_state_dict(state["model"])
    extra = {} if options.power is None else {"power": options.power}
    write(options.out, model, state["record"], extra, options.half)
    print(f"{options.out}: {options.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
