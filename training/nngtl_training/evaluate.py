"""Held-out metrics of a weight file: ``nngtl-evaluate MODEL DATA``."""

import argparse
import json
from pathlib import Path

from . import data, export, metrics


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Evaluates a weight file on a data set, as JSON.")
    parser.add_argument("model", type=Path, help="weight file")
    parser.add_argument("data", type=Path, help="data set")
    parser.add_argument("--limit", type=int, help="so many missions, spread over the set")
    parser.add_argument("--cache", type=Path, help="folder that keeps data sets as they were read")
    options = parser.parse_args(arguments)
    model, _ = export.read(options.model)
    missions = data.load(options.data, model.config, options.cache)
    print(json.dumps(metrics.evaluate(model, missions, options.limit), indent=1))


if __name__ == "__main__":
    main()
