"""Walks through the workbench in FreeCAD without its window, as a user would; started by a test."""

import FreeCAD
import Part
from opl_workbench import cell_files, job_object, job_text, motion_object, running
from opl_workbench.client import Client
from walking import given, set_up, tell, told


def faces_outside(part):
    """Return the names of the faces that a user clicks on: flanks and tip."""
    names = []
    for number, face in enumerate(part.Shape.Faces, start=1):
        u, v = (sum(face.ParameterRange[k : k + 2]) / 2.0 for k in (0, 2))
        normal = face.normalAt(u, v)
        if abs(normal.x) < 0.5 and normal.z > -0.5:
            names.append(f"Face{number}")
    return names


def walk():
    document = FreeCAD.newDocument("Walk")
    Part.insert(given["step"], document.Name)
    part = document.Objects[-1]
    job = job_object.make_job(document, part, faces_outside(part))
    job.JobName = "V_STEP"
    job.Gripper = [set_up(document, job)]
    document.recompute()

    states = []
    client = Client(given["address"])
    running.plan(job, lambda at: states.append([at.task, at.state, at.stage]), client)
    told.update(states=states, faces=list(job.Faces[1]), status=job.Status, message=job.Message)
    told["figures"] = job.Figures
    if job.Status == "ok":
        told["saved"] = running.save_programs(job, given["programs"])
    document.saveAs(given["document"])
    FreeCAD.closeDocument(document.Name)

    again = FreeCAD.openDocument(given["document"])
    (job,) = job_object.jobs_of(again)
    job.touch()
    again.recompute()
    sent = {f"job/{name}": content for name, content in job_text.job_files(job).items()}
    kept = running.kept(job, "RunKept")
    told["other"] = [name for name, content in sent.items() if kept[name] != content]
    told["reopened"] = [job.Status, job.Figures, sorted(kept)]
    motion = motion_object.motion_view_of(job)
    motion.recompute()
    told["moments"] = []
    for part in (0.0, 0.3, 0.5, 1.0):
        motion_object.show_moment(motion, part * motion.Seconds)
        a = motion.Part.toMatrix().A
        pose = [a[4 * k : 4 * k + 4] for k in range(4)]
        told["moments"].append([motion.Moment, list(motion.Posture), pose, motion.Where])
    job.Pitch = 4.0
    again.recompute()
    told["changed"] = job.Status

    # the same part in the cell of a file; what the file names lies in the document
    cell_files.take_cell(job, given["cell"])
    job.Home, job.Robot = [], "no robot"
    running.show_points(job, client)
    solids = [found["name"] for found in motion_object.cell_of(job).solids]
    told["of_cell_file"] = [job.Status, job.Message, solids, sorted(running.kept(job, "CellKept"))]


tell(walk)
