"""Walks through the workbench with FreeCAD's window, as a user would; started by a test.

Pictures of the window lie beside what it tells.
"""

import os
import subprocess
import time

import FreeCAD
import FreeCADGui
import Part
from PySide import QtCore, QtGui
from walking import given, set_up, tell, told

PATIENCE = 120.0  # [s] for a run


def waited(until, seconds=PATIENCE):
    """Let the window live until something is so."""
    end = time.monotonic() + seconds
    while not until():
        if time.monotonic() > end:
            raise TimeoutError
        FreeCADGui.updateGui()
        time.sleep(0.02)


def picture(name):
    """Take a picture of the whole screen."""
    end = time.monotonic() + 1.0
    waited(lambda: time.monotonic() > end)
    path = os.path.join(os.path.dirname(given["told"]), f"{name}.png")
    subprocess.run(["import", "-window", "root", path], check=True)


def look(direction):
    view = FreeCADGui.ActiveDocument.ActiveView
    getattr(view, direction)()
    view.fitAll()


def walk():
    preferences = FreeCAD.ParamGet("User parameter:BaseApp/Preferences/Mod/opl")
    preferences.SetString("Address", given["address"])
    FreeCADGui.activateWorkbench("OplWorkbench")
    told["commands"] = [name for name in FreeCADGui.listCommands() if name.startswith("Opl_")]
    document = FreeCAD.newDocument("Walk")
    Part.insert(given["step"], document.Name)
    part = document.Objects[-1]
    look("viewIsometric")
    for name in given["faces"]:  # what a click on a face does
        FreeCADGui.Selection.addSelection(document.Name, part.Name, name)
    FreeCADGui.runCommand("Opl_NewJob")

    from opl_workbench import job_object, panel

    (job,) = job_object.jobs_of(document)
    stem = set_up(document, job)
    FreeCADGui.Selection.clearSelection()
    FreeCADGui.Selection.addSelection(stem)
    desk = panel.open_panel(job)
    desk.take_gripper()
    desk.fields["Feed"].setValue(25.0)
    desk.fields["JobName"].setText("WINDOW")
    desk.fields["JobName"].editingFinished.emit()
    told["taken"] = [job.Feed, job.JobName, [one.Label for one in job.Gripper], list(job.Faces[1])]
    told["before"] = desk.said.text()

    desk.points.click()
    waited(lambda: desk.running is None)
    told["points"] = [job.Status, desk.said.text()]
    look("viewIsometric")
    picture("points")

    seen = set()
    desk.run.click()
    waited(lambda: seen.add(desk.said.text()) or desk.running is None)
    told["seen"], told["status"] = sorted(seen), job.Status
    desk.moment.setValue(500)
    told["where"] = desk.where.text()
    look("viewIsometric")
    picture("motion")
    motion = panel.motion_view_of(job)
    told["hidden"] = [part.ViewObject.Visibility, motion.ViewObject.Visibility]

    document.saveAs(given["document"])
    desk.reject()
    FreeCAD.closeDocument(document.Name)
    again = FreeCAD.openDocument(given["document"])
    (job,) = job_object.jobs_of(again)
    told["icons"] = [os.path.isfile(one.ViewObject.Proxy.getIcon()) for one in (job, job.InList[0])]
    told["scene"] = [one.ViewObject.Proxy.root.getNumChildren() for one in (job, job.InList[0])]
    desk = panel.open_panel(job)
    desk.moment.setValue(300)
    told["again"] = [job.Status, desk.said.text()]
    look("viewIsometric")
    picture("reopened")
    column = desk.form
    while not isinstance(column, QtGui.QScrollArea):
        column = column.parentWidget()
    told["width"] = [desk.form.width(), column.viewport().width()]
    titles = desk.tabs.tabBar()
    told["titles"] = [titles.tabRect(3).right(), titles.width(), desk.form.width()]
    for tab in range(4):
        desk.tabs.setCurrentIndex(tab)
        picture(f"tab_{tab}")
    desk.tabs.setCurrentIndex(0)

    # a post where the part has to be when it is ground: the reason, and where it is
    post = again.addObject("Part::Box", "Post")
    post.Length, post.Width, post.Height = 60.0, 60.0, 400.0
    post.Placement.Base = FreeCAD.Vector(770.0, 205.0, 120.0)
    again.recompute()
    job.Obstacles = [post]
    desk.refresh()
    told["changed"] = desk.said.text()
    desk.run.click()
    waited(lambda: desk.running is None)
    told["refused"] = [job.Status, job.Message, panel.marked(job)]
    look("viewIsometric")
    picture("reason")
    post.ViewObject.Visibility = False
    look("viewIsometric")
    picture("marks")

    desk.fields["Feed"].setValue(26.0)  # the same job would be answered at once
    desk.run.click()
    waited(lambda: desk.running)
    desk.stop.click()
    waited(lambda: desk.running is None)
    told["cancelled"] = job.Status


QtCore.QTimer.singleShot(500, lambda: tell(walk))
