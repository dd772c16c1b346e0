"""Inference of the same weights by nngtl, ONNX Runtime and PyTorch, side by side on one core.

``python training/compare_inference.py target/release/nngtl`` (needs ``onnx`` and ``onnxruntime`` beside PyTorch) writes random weights of
the paper's networks to a folder, times each program in turns, and prints a Markdown table of milliseconds of processor time: mean and,
in brackets, the least wall-clock time. ONNX Runtime runs the convolution part alone (map in, heatmap or map feature out; the automaton's feature is given), PyTorch and
nngtl whole networks with an automaton of 6 states and 9 or 12 states and 60 transitions. Everything is f32, batch 1, one thread.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
import onnxruntime  # noqa: E402
import torch  # noqa: E402
from torch import nn  # noqa: E402
from torch.nn import functional as F  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))

from nngtl_training import configs, export, goldens, models  # noqa: E402


class PathConvolutions(nn.Module):
    """PathNet without its graph layers: (map, fused feature) to heatmap."""

    def __init__(self, net):
        super().__init__()
        self.encoder, self.decoder, self.head = net.encoder, net.decoder, net.head

    def forward(self, raster, feature):
        x = raster
        for block in self.encoder:
            x = F.leaky_relu(block(x), 0.2)
        x = torch.cat([x, feature], dim=1)
        for block in self.decoder:
            x = F.relu(block(x))
        return torch.sigmoid(self.head(x))


class StateConvolutions(nn.Module):
    """StateNet's map network: map to map feature."""

    def __init__(self, net):
        super().__init__()
        self.squeeze, self.trunk, self.project = net.squeeze, net.trunk, net.project

    def forward(self, raster):
        return self.project(self.trunk(self.squeeze(raster)))


def networks(widths):
    """Names and networks with random weights."""
    for n1 in widths:
        config = {**configs.PAPER_PATHNET, "n1": n1, "skip": "none"}
        yield f"PathNet n1 = {n1}", models.build(config).eval()
    yield "StateNet ResNet-50", models.build(configs.PAPER_STATENET).eval()


def onnx_session(net, raster, path):
    """The convolution part in ONNX Runtime, and what it is fed."""
    if net.config["kind"] == "pathnet":
        side = net.sizes[5]
        inputs = (raster, torch.rand(1, 16 * net.config["n1"], side, side))
        part, names = PathConvolutions(net), ["raster", "feature"]
    else:
        inputs, part, names = (raster,), StateConvolutions(net), ["raster"]
    torch.onnx.export(part.eval(), inputs, str(path), input_names=names, output_names=["out"], dynamo=False)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    return session, {name: value.numpy() for name, value in zip(names, inputs)}


def times(run, seconds):
    """Mean processor time and least wall-clock time in milliseconds, of runs after three that warm up."""
    for _ in range(3):
        run()
    found, begin, before = [], time.perf_counter(), time.process_time()
    while len(found) < 5 or time.perf_counter() - begin < seconds:
        start = time.perf_counter()
        run()
        found.append(1e3 * (time.perf_counter() - start))
    return 1e3 * (time.process_time() - before) / len(found), min(found)


def ours(binary, files, seconds):
    """The same of nngtl by file."""
    command = [binary, "bench", "inference", "--device", "cpu", "--no-paper", "--missions", "0", "--json", "--quiet"]
    command += ["--seconds", str(seconds), "--runs", "5"]
    for file in files:
        command += ["--model", str(file)]
    table = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return [(row["cpu_ms"] or row["steady_ms"]["median"], row["steady_ms"]["min"]) for row in table["rows"]], table


def compare(binary, folder, nets, seconds, rounds):
    """Rows (name, {program: [(processor time, least)]}), and what nngtl says of the machine."""
    torch.set_num_threads(1)
    rng = np.random.default_rng(1)
    rows, files, runs = [], [], []
    for number, (name, net) in enumerate(nets):
        goldens.randomise(net)
        raster, graphs = goldens.example(net.config["labels"], net.config["resolution"], rng)
        file = folder / f"network-{number}.safetensors"
        export.write(file, net)
        session, feed = onnx_session(net, raster, folder / f"network-{number}.onnx")
        files.append(file)
        runs.append(
            {
                "ONNX Runtime": lambda session=session, feed=feed: session.run(None, feed),
                "PyTorch": lambda net=net, raster=raster, graphs=graphs: net(raster, graphs),
            }
        )
        rows.append((name, {"nngtl": [], "ONNX Runtime": [], "PyTorch": []}))
    machine = ""
    for _ in range(rounds):
        # Turn by turn, so that a busy machine is busy for all.
        for (_, found), programs, file in zip(rows, runs, files):
            (pair,), table = ours(binary, [file], seconds)
            found["nngtl"].append(pair)
            machine = table["machine"]
            for program, run in programs.items():
                found[program].append(times(run, seconds))
    return rows, machine


def markdown(rows, machine):
    programs = ["nngtl", "ONNX Runtime", "PyTorch"]
    lines = [
        f"{machine}; onnxruntime {onnxruntime.__version__}, torch {torch.__version__}; one thread, batch 1, f32. Milliseconds of processor time (least wall-clock time).",
        "",
        "| network | nngtl, whole | ONNX Runtime, convolutions | PyTorch, whole | nngtl ÷ ONNX Runtime |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for name, found in rows:
        cells = []
        for program in programs:
            spent, least = zip(*found[program])
            cells.append(f"{min(spent):.2f} ({min(least):.2f})")
        best = {program: min(spent for spent, _ in found[program]) for program in programs}
        lines.append(f"| {name} | {' | '.join(cells)} | {best['nngtl'] / best['ONNX Runtime']:.2f} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binary", help="the nngtl program, built with --release")
    parser.add_argument("--widths", type=int, nargs="*", default=[8, 16, 32, 64], help="PathNet's n1")
    parser.add_argument("--seconds", type=float, default=1.0, help="for each network, program and round")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, torch.inference_mode():
        nets = networks(options.widths)
        print(markdown(*compare(options.binary, Path(folder), nets, options.seconds, options.rounds)))


if __name__ == "__main__":
    main()
