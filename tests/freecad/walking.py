"""What both walks through the workbench share: what they are given, the job's cell, what they tell.

They take what they need from the variable OPL_WALK, a JSON object, and write what they saw to
`told` of it.
"""

import json
import os
import sys
import traceback

from opl_workbench import job_object

given = json.loads(os.environ["OPL_WALK"])
told = {}


def set_up(document, job):
    """Give a job its cell and its properties; return the stem between flange and part."""
    for name, rows in given["placements"].items():
        setattr(job, name, job_object.placement(rows))
    job.Flange = job.Flange.inverse()  # given as the part in the flange's frame
    stem = document.addObject("Part::Cylinder", "Stem")  # drawn where it holds the part
    stem.Radius, stem.Height, stem.Placement = 22.0, 100.0, job.Flange
    for name, value in given["properties"].items():
        setattr(job, name, value)
    document.recompute()
    return stem


def tell(walk):
    """Walk, write what was seen or what went wrong, and end FreeCAD, which would wait."""
    try:
        walk()
    except BaseException:
        told["failed"] = traceback.format_exc()
    with open(given["told"], "w", encoding="utf-8") as file:
        json.dump(told, file)
    sys.stdout.flush()
    os._exit(0)
