"""The committed goldens are what the models compute now."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from nngtl_training import export, goldens
from nngtl_training.graph import Graphs

FOLDER = Path(__file__).parents[2] / "tests" / "goldens"


@pytest.mark.parametrize("name", goldens.GOLDENS)
def test_golden(name):
    model, _ = export.read(FOLDER / "models" / f"{name}.safetensors")
    io = load_file(FOLDER / "models" / f"{name}.io.safetensors")
    states, transitions = len(io["states"]), len(io["transitions"])
    graphs = Graphs(
        io["states"],
        io["transitions"].float(),
        io["source"].long(),
        io["target"].long(),
        torch.zeros(states, dtype=torch.long),
        torch.zeros(transitions, dtype=torch.long),
        1,
        io["ways"][None] if "ways" in io else None,
    )
    found = goldens.output(model, io["raster"].float()[None], graphs)
    torch.testing.assert_close(found, io["output"], rtol=1e-5, atol=1e-6)
    # A golden whose output hardly varies would prove nothing.
    assert io["output"].std() > 1e-3


def test_rasters():
    assert json.loads((FOLDER / "rasters.json").read_text()) == json.loads(json.dumps(goldens.rasters()))
