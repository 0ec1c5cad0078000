"""What ends the process that unpacks it."""

import os
import signal


def die() -> None:
    """End as the system ends who takes too much memory."""
    os.kill(os.getpid(), signal.SIGKILL)


class Poison:
    """Stands for a motion that no process survives."""

    def __reduce__(self):
        return die, ()
