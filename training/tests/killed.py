"""``nngtl-train`` in a process that is killed when it would take the step of this number: ``killed.py STEP ARGUMENTS…``."""

import os
import signal
import sys

from nngtl_training import train

take = train.Run.train_step


def take_or_die(run, progress):
    if run.step == int(sys.argv[1]):
        os.kill(os.getpid(), signal.SIGKILL)
    return take(run, progress)


train.Run.train_step = take_or_die
train.main(sys.argv[2:])
