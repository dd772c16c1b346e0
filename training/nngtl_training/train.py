"""The training loop: ``nngtl-train --help``.

A step depends on seed and step number alone (batch, augmentation, dropout), so that a run continued from a
checkpoint gives the same weights as one that was never stopped. With a budget in minutes the learning rate follows the
clock, and the two agree only up to that.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import distributed
from torch.nn import functional as F

from . import __version__, batches, configs, data, export, metrics, models, targets

CHECKPOINT = "checkpoint.pt"


@dataclass
class Team:
    """The processes of one run (``torchrun``); alone unless told otherwise."""

    rank: int = 0
    size: int = 1

    @classmethod
    def from_environment(cls, device):
        size = int(os.environ.get("WORLD_SIZE", "1"))
        if size > 1:
            distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
            return cls(distributed.get_rank(), size)
        return cls()


class Run:
    """Everything that a training run owns."""

    def __init__(self, config, missions, seed=0, device="cpu", team=None):
        self.config, self.seed = config, seed
        self.device, self.team = torch.device(device), team or Team()
        self.missions = missions.to(self.device)
        self.options = config["training"]
        torch.manual_seed(seed)
        self.model = models.build(config["network"]).to(self.device, memory_format=torch.channels_last)
        self.forward = self.model
        if self.team.size > 1:
            self.forward = torch.nn.parallel.DistributedDataParallel(self.model, find_unused_parameters=True)
        self.optimizer = torch.optim.AdamW(
            self.model.parameters(), lr=self.options["rate"], weight_decay=self.options["weight_decay"]
        )
        self.step, self.elapsed = 0, 0.0
        # A GPU is still busy with a step when the program has asked for all of it: time to make the next batch.
        self.early, self.ahead = self.device.type == "cuda", None
        self.record = {
            "package": __version__,
            "torch": torch.__version__,
            "seed": seed,
            "training": self.options,
            "data": missions.fingerprint,
            "missions": len(missions),
            "skipped": missions.skipped,
            "families": missions.families(),
            "handed": [],
        }
        self.augment = batches.Augment(
            self.options["symmetries"], self.options["permute"], self.options["jitter"]
        )
        precision = self.options["precision"]
        self.half = precision == "bf16" or (precision == "auto" and _fast_bf16(self.device))

    @property
    def epoch(self):
        return self.step * self.options["batch"] / self.passes

    @property
    def passes(self):
        """Samples of an epoch: each mission as often as the configuration ``repeats`` it."""
        return self.options.get("repeats", 1) * len(self.missions)

    def rate(self, progress):
        """The learning rate; ``progress`` in [0, 1] is the share of the budget that is spent."""
        rate = self.options["rate"]
        warm = min(1.0, (self.step + 1) / max(1, self.options["warm_up"]))
        if self.options["schedule"] == "cosine":
            rate *= 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(1.0, progress)))
        return rate * warm

    def frozen(self):
        """Whether the trunk stands still now (IV-D: a trunk with given weights, at first)."""
        return "trunk" in self.record and self.epoch < self.options.get("frozen_epochs", 0)

    def batch(self, step):
        """The step, the seed of its dropout, and its batch, or this process's share of it."""
        rng = np.random.default_rng([self.seed, 1, step, self.team.rank])
        seed = int(rng.integers(2**31))
        chosen = batches.indices(len(self.missions), self.options["batch"], self.seed, step)
        chosen = chosen[self.team.rank :: self.team.size]
        paths = self.config["network"]["kind"] == "pathnet"
        reach, spread = self.options["reach"], self.options.get("spread")
        return step, seed, batches.make(self.missions, chosen, self.augment, rng, reach, paths, spread)

    def train_step(self, progress):
        """One step; returns the loss."""
        if self.ahead is None or self.ahead[0] != self.step:
            self.ahead = self.batch(self.step)
        _, seed, batch = self.ahead
        torch.manual_seed(seed)
        for group in self.optimizer.param_groups:
            group["lr"] = self.rate(progress)
        self.model.train()
        if hasattr(self.model, "trunk"):
            fixed = self.frozen()
            self.model.trunk.requires_grad_(not fixed).train(not fixed)
        inputs = batch.raster
        if inputs.dim() == 4:
            inputs = inputs.contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.half):
            logits = self.forward(inputs, batch.graphs)
        loss = self.loss(logits.float(), batch)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 5.0)
        self.optimizer.step()
        self.step += 1
        self.ahead = self.batch(self.step) if self.early else None
        return loss.item()

    def loss(self, logits, batch):
        """Binary cross entropy: over cells for PathNet, over the logits of the states for StateNet."""
        if self.config["network"]["kind"] == "pathnet":
            weight = torch.tensor(self.options["positive_weight"], device=logits.device)
            return F.binary_cross_entropy_with_logits(logits, targets.lowered(batch.heat, logits), pos_weight=weight)
        truth = batch.visited[:, None]
        if logits.shape[1] == 2:
            truth = torch.cat([1 - truth, truth], dim=1)
        loss = F.binary_cross_entropy_with_logits(logits, truth.expand_as(logits), reduction="none").mean(dim=1)
        owner = batch.graphs.state_graph
        # Between one voice per state, where a few large automata drown the rest, and one per mission.
        weight = torch.bincount(owner).float()[owner] ** -self.options["balance"]
        return (loss * weight).sum() / weight.sum()

    def state(self):
        return {
            "config": self.config,
            "model": self.model.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step,
            "elapsed": self.elapsed,
            "record": {**self.record, "steps": self.step, "epochs": round(self.epoch, 2), "minutes": round(self.elapsed / 60, 1)},
        }

    def save(self, path):
        """Writes a checkpoint, whole or not at all."""
        if self.team.rank == 0:
            partial = Path(path).with_suffix(".partial")
            torch.save(self.state(), partial)
            partial.replace(path)

    def restore(self, path):
        state = torch.load(path, map_location=self.device, weights_only=False)
        if state["config"] != self.config or state["record"]["data"] != self.missions.fingerprint or state["record"]["seed"] != self.seed:
            raise SystemExit(f"{path}: made with another configuration, seed or data set: choose another --out")
        self.model.load_state_dict(state["model"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.elapsed, self.record = state["step"], state["elapsed"], state["record"]


def _fast_bf16(device):
    """Whether bfloat16 is worth it: a GPU that has it, or a CPU with instructions for it."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    try:
        return "avx512_bf16" in Path("/proc/cpuinfo").read_text() or "amx_bf16" in Path("/proc/cpuinfo").read_text()
    except OSError:
        return False


class Log:
    """``log.csv`` and, on request, TensorBoard."""

    def __init__(self, folder, tensorboard):
        self.path = folder / "log.csv"
        self.board = None
        if tensorboard:
            from torch.utils.tensorboard import SummaryWriter

            self.board = SummaryWriter(folder)

    def add(self, step, values):
        row = {"step": step, **values}
        fresh = not self.path.exists()
        with open(self.path, "a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            if fresh:
                writer.writerow(["step", "name", "value"])
            writer.writerows([step, name, f"{value:.6g}"] for name, value in values.items())
        if self.board:
            for name, value in values.items():
                self.board.add_scalar(name, value, step)
        print(" ".join(f"{k} {v:.5g}" for k, v in row.items()), flush=True)


def train(run, out, held_out=None, minutes=None, steps=None, save_minutes=5.0, check_minutes=5.0, check_limit=400, tensorboard=False):
    """Trains until the budget is spent, then evaluates on all of ``held_out`` and exports."""
    out.mkdir(parents=True, exist_ok=True)
    lead = run.team.rank == 0
    log = Log(out, tensorboard) if lead else None
    began, before = time.monotonic(), run.elapsed
    spread = run.options.get("spread")
    last = {"save": run.elapsed, "check": run.elapsed, "log": run.step}
    losses = []

    def progress():
        if steps is not None:
            return run.step / steps
        share = torch.tensor(run.elapsed / (60 * minutes), device=run.device)
        if run.team.size > 1:
            distributed.broadcast(share, 0)
        return share.item()

    while (share := progress()) < 1:
        losses.append(run.train_step(share))
        run.elapsed = before + time.monotonic() - began
        if run.step - last["log"] >= 100:
            done = run.step * run.options["batch"]
            if lead:
                log.add(run.step, {"loss": float(np.mean(losses)), "epoch": run.epoch, "rate": run.rate(share), "samples": done, "minutes": run.elapsed / 60})
            losses, last["log"] = [], run.step
        if run.elapsed - last["save"] > 60 * save_minutes:
            run.save(out / CHECKPOINT)
            last["save"] = run.elapsed
        if lead and held_out is not None and run.elapsed - last["check"] > 60 * check_minutes:
            found = metrics.evaluate(run.model, held_out, check_limit, device=run.device, spread=spread)["all"]
            log.add(run.step, {f"held-out {k}": v for k, v in found.items()})
            run.elapsed = before + time.monotonic() - began
            last["check"] = run.elapsed
    if lead:
        if held_out is not None:
            run.record["held_out"] = metrics.evaluate(run.model, held_out, device=run.device, spread=spread)
            run.record["held_out_data"] = held_out.fingerprint
            log.add(run.step, {f"held-out {k}": v for k, v in run.record["held_out"]["all"].items()})
        run.save(out / CHECKPOINT)
        state = run.state()
        export.write(out / f"{run.config['network']['kind']}.safetensors", run.model, state["record"])
        (out / "record.json").write_text(json.dumps(state["record"], indent=1), encoding="utf-8")


def start(options):
    """The run that the command line asks for."""
    device = torch.device(options.device if options.device != "auto" else "cuda" if torch.cuda.is_available() else "cpu")
    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
    config = configs.get(options.config, options.net, options.set)
    network = {**config["network"], "suffix": config["training"]["suffix"]}
    missions = data.load(options.data, network, options.cache, options.maps, options.families)
    held_out = data.load(options.held_out, network, options.cache).to(device) if options.held_out else None
    for found in (missions, held_out):
        if found is not None and config["network"]["variant"] == "ways" and np.isnan(found.ways).any():
            raise SystemExit("a data set has no lengths of ways, which this StateNet reads: generate it anew")
    run = Run(config, missions, options.seed, device, Team.from_environment(device))
    if "epochs" in config["training"] and options.minutes is None and options.steps is None:
        options.steps = math.ceil(config["training"]["epochs"] * run.passes / config["training"]["batch"])
    if options.minutes is None and options.steps is None:
        raise SystemExit("this configuration has no number of epochs: give --minutes or --steps")
    checkpoint = options.out / CHECKPOINT
    if checkpoint.exists():
        run.restore(checkpoint)
        print(f"continuing at step {run.step}", flush=True)
    else:
        _begin(run, options)
    return run, held_out


def _begin(run, options):
    """What a fresh run takes from elsewhere."""
    if options.begin:
        giver, _ = export.read(options.begin)
        run.model.load_state_dict(giver.state_dict())
        run.record["began"] = hashlib.sha256(options.begin.read_bytes()).hexdigest()
    if options.trunk:
        weights = torch.load(options.trunk, map_location="cpu", weights_only=True)
        weights = {k: v for k, v in weights.items() if not k.startswith("fc.")}
        run.model.trunk.load_state_dict(weights)
        run.record["trunk"] = Path(options.trunk).name
    elif run.options.get("frozen_epochs"):
        print("no --trunk file: the trunk is trained from scratch and never frozen", flush=True)
    if options.statenet:
        giver, _ = export.read(options.statenet)
        run.record["handed"] = models.handed_layers(giver, run.model)
        print(f"layers handed over: {run.record['handed'] or 'none'}", flush=True)


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Trains PathNet or StateNet. Continues the run in --out if there is one.")
    parser.add_argument("net", choices=["pathnet", "statenet"])
    parser.add_argument("--config", default="compact", help="compact, raster, paper, or a JSON file")
    parser.add_argument("--set", action="append", default=[], metavar="PART.KEY=VALUE", help="change the configuration")
    parser.add_argument("--data", type=Path, required=True, help="data set to train on")
    parser.add_argument("--held-out", type=Path, help="data set to evaluate on")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run: checkpoint, log, weight file")
    parser.add_argument("--cache", type=Path, help="folder that keeps data sets as they were read")
    parser.add_argument("--minutes", type=float, help="budget in minutes of training")
    parser.add_argument("--steps", type=int, help="budget in steps; reproducible")
    parser.add_argument("--maps", type=int, help="use only the first so many maps")
    parser.add_argument("--families", type=lambda text: text.split(","), help="train on these families of maps alone, separated by commas")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--trunk", type=Path, help="state dictionary of an ImageNet ResNet-50 (StateNet, paper)")
    parser.add_argument("--statenet", type=Path, help="weight file whose graph layers start a PathNet (IV-D)")
    parser.add_argument("--begin", type=Path, help="weight file of the same network to go on from, with another target or other data")
    parser.add_argument("--save-minutes", type=float, default=5.0)
    parser.add_argument("--check-minutes", type=float, default=5.0)
    parser.add_argument("--tensorboard", action="store_true")
    options = parser.parse_args(arguments)
    run, held_out = start(options)
    minutes = None if options.steps is not None else options.minutes
    train(run, options.out, held_out, minutes, options.steps, options.save_minutes, options.check_minutes, tensorboard=options.tensorboard)


if __name__ == "__main__":
    main()
