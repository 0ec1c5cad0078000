"""What crews compute in tests, deeds that end a process among them, and a run of tasks through a crew."""

import os
import signal
import time
from collections import Counter

from studies.pool import ONE_THREAD


def doubled(task, progress):
    """What the processes compute here: twice a number, or the deed that is named."""
    progress(1)
    if task == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "ended":
        os._exit(3)
    if task == "hung":
        time.sleep(1000)
    if task == "memory":
        raise MemoryError("no room for the mesh")
    if task == "disk":
        raise OSError(28, "No space left on device", "x.npz")
    if task == "threads":
        return [os.environ[name] for name in ONE_THREAD]
    return 2 * task


def worked(crew, tasks):
    """Answers by task, and progress by task, of a crew that gets all of these."""
    found, told, left = {}, Counter(), list(tasks)
    with crew:
        while left or crew.busy:
            while left and crew.free:
                task = left.pop(0)
                crew.give(task, task)
            for task, answer in crew.answers(lambda task, steps: told.update({task: steps})):
                found[task] = answer
    return found, told
