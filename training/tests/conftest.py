import os
import sys
from pathlib import Path

import pytest
import torch

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]
os.environ.setdefault("OMP_NUM_THREADS", "1")
torch.set_num_threads(1)

import synthetic  # noqa: E402

from nngtl_training import shards  # noqa: E402


@pytest.fixture(scope="session")
def made_by_nngtl():
    """A small data set that ``nngtl dataset generate`` made: (folder, its maps)."""
    folder = Path(__file__).parent / "made_by_nngtl"
    return folder, [entry for _, entry in shards.maps(folder, shards.read_manifest(folder))]


@pytest.fixture(scope="session")
def data_set(tmp_path_factory):
    """A small synthetic data set: (folder, its maps)."""
    folder = tmp_path_factory.mktemp("data")
    return folder, synthetic.write(folder, 12, seed=3)
