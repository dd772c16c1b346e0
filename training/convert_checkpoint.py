"""Turns checkpoints of the published NNgTL networks into weight files.

``python training/convert_checkpoint.py LTL_Net_pretrained.pth BA_Predict_pretrained.pth --out models/published``
"""

import sys

from nngtl_training.convert import main

if __name__ == "__main__":
    sys.exit(main())
