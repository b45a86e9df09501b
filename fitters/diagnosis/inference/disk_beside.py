"""A disk of finite diameter with whatever acts beside that: the ways to it, the quickest first."""

from collections.abc import Callable

from ...disk.bare_disk import bare_disk
from ...disk.two_d.disk_fit import NAME
from ...interface import FitTask
from .disk_with_dot import with_dot
from .disk_with_wires import (
    NEAR,
    DiskBeside,
    alone_with_wires,
    better,
    is_described,
    is_narrow,
    left_by,
    of_random_ceramics,
    together_with_wires,
    wide_disk_with_wires,
)


def disk_beside(
    task: FitTask, hopeless: float, progress: Callable[[str], None], jobs: int, of_plate: float
) -> DiskBeside:
    """Return the disk fitted alone, and with the effects that it seems to have; a search begins with them.

    The ways are tried in the order of what they cost; the first that describes the recordings ends it.
    `hopeless`: rms of ln Z that it must not exceed; `of_plate`: what a plate without effects leaves. Raises FitError if
    no way leads to such a disk.
    """
    if not is_narrow(bare_disk(task, NAME, round_one=True, frees=True)):
        return wide_disk_with_wires(task, hopeless, progress, jobs, of_plate)
    near = alone_with_wires(task, hopeless, progress, jobs)
    if near is not None and is_described(near):
        return near
    dotted = with_dot(task, progress, jobs)
    if dotted is not None and is_described(dotted):
        return dotted
    together = together_with_wires(task, near and near.alone, progress, jobs)
    found = [one for one in (near, together, dotted) if one is not None and left_by(one.whole) < NEAR]
    return better(found) if found else of_random_ceramics(task, hopeless, progress, jobs)
