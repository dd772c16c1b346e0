"""Training of nngtl's networks: data, models, training loop, export.

The contract with the Rust side stands in ``docs/networks.md`` and ``docs/dataset.md``.
"""

__version__ = "0.1.0"
