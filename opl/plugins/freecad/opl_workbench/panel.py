"""The panel of a job: what is asked for, a run with its progress, the motion or the reason."""

from __future__ import annotations

import os
import queue
import tempfile
import threading
from typing import Any

import FreeCAD
import FreeCADGui
from PySide import QtCore, QtGui

from . import running
from .cell_files import take_cell
from .client import RemoteJob, ServiceError
from .fields import OF_CELL_FILE, TABS, field
from .found import marked, motion_of
from .keeping import kept
from .motion_object import motion_view_of, show_moment
from .picked import picked_faces, picked_solids
from .views import CellView

EVERY = 100  # [ms] between two looks at what the thread has told
STEPS = 1000  # of the slider


class Panel:
    """The task panel of one job."""

    def __init__(self, job: Any) -> None:
        self.job = job
        self.told: queue.Queue[Any] = queue.Queue()
        self.running: str | None = None  # id of the job at the service, empty before it has one
        self.form = QtGui.QWidget()
        self.form.setWindowTitle(f"Belt grinding: {job.Label}")
        self.column = QtGui.QVBoxLayout(self.form)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.fields: dict[str, Any] = {}
        self._add_picking()
        self._add_running()  # above the fields: what is said is seen without scrolling
        self._add_tabs()
        self.timer = QtCore.QTimer(self.form)
        self.timer.timeout.connect(self.look)
        self.refresh()

    # what is on it

    def _add_picking(self) -> None:
        self.faces, self.gripper, self.cell = wrapped(), wrapped(), wrapped()
        rows = (
            ("Take picked faces", self.take_faces, self.faces),
            ("Take picked gripper", self.take_gripper, self.gripper),
            ("Cell file...", self.ask_cell, self.cell),
        )
        for text, action, label in rows:
            self.column.addWidget(self._button(text, action))
            self.column.addWidget(label)

    def _add_tabs(self) -> None:
        self.tabs = QtGui.QTabWidget()
        # all four titles are seen where FreeCAD's column of tasks is narrow
        self.tabs.setStyleSheet("QTabBar::tab { padding: 3px 2px; min-width: 0px; }")
        self.tabs.setUsesScrollButtons(False)
        for title, names in TABS:
            page = QtGui.QWidget()
            form = QtGui.QFormLayout(page)
            form.setContentsMargins(4, 4, 4, 4)
            form.setRowWrapPolicy(QtGui.QFormLayout.WrapLongRows)
            for name, label in names:
                self.fields[name] = field(self.job, name)
                if isinstance(self.fields[name], (QtGui.QAbstractSpinBox, QtGui.QComboBox)):
                    form.addRow(label, self.fields[name])
                else:  # longer than what is left beside its label
                    form.addRow(QtGui.QLabel(label))
                    form.addRow(self.fields[name])
            self.tabs.addTab(page, title)
        self.column.addWidget(self.tabs)

    def _add_running(self) -> None:
        self.points = self._button("Cutter points", lambda: self.start("points"))
        self.run = self._button("Run", lambda: self.start("run"))
        self.stop = self._button("Cancel", self.cancel)
        self._add_buttons(self.points, self.run, self.stop)
        self.progress = QtGui.QProgressBar()
        self.said = wrapped()
        self.said.setTextInteractionFlags(QtCore.Qt.TextSelectableByMouse)
        self.moment = QtGui.QSlider(QtCore.Qt.Horizontal)
        self.moment.setMaximum(STEPS)
        self.moment.valueChanged.connect(self.moved)
        self.where = wrapped()
        for widget in (self.progress, self.said, self.moment, self.where):
            self.column.addWidget(widget)
        self.save = self._button("Save programs...", self.ask_folder)
        self.page = self._button("Report", self.open_page)
        self.part = self._button("Show part", lambda: self.show_motion(False))
        self._add_buttons(self.part, self.page, self.save)

    def _add_buttons(self, *buttons: Any) -> None:
        """Add buttons, two in a row: the column of tasks is narrow."""
        grid = QtGui.QGridLayout()
        for k, button in enumerate(buttons):
            grid.addWidget(button, k // 2, k % 2)
        self.column.addLayout(grid)

    def _button(self, text: str, action: Any) -> Any:
        button = QtGui.QPushButton(text)
        button.clicked.connect(lambda _=False: self._tried(action))
        return button

    def _tried(self, action: Any) -> None:
        """Do something; what cannot be done is said in the panel."""
        try:
            action()
        except (ValueError, OSError, ServiceError) as error:
            self.said.setText(str(error))

    # what is asked for

    def take_faces(self) -> None:
        """Take the faces that are picked in the 3D view."""
        part, names = picked_faces()
        self.job.Faces = (part, names)
        self.refresh()

    def take_gripper(self) -> None:
        """Take the solids that are picked as the gripper; none picked is none."""
        self.job.Gripper = picked_solids(self.job)
        self.refresh()

    def ask_cell(self) -> None:
        """Ask for a cell file; none is a cell of the fields."""
        path, _ = QtGui.QFileDialog.getOpenFileName(
            self.form, "Cell file", "", "YAML (*.yaml *.yml)"
        )
        self.take_cell(path)

    def take_cell(self, path: str) -> None:
        """Take a cell file, with what it names, into the document."""
        take_cell(self.job, path)
        self.refresh()

    def refresh(self) -> None:
        """Show the job as it is."""
        job = self.job
        job.recompute()
        names = job.Faces[1] if job.Faces else ()
        self.faces.setText(f"{job.Faces[0].Label}: {', '.join(names)}" if names else "none")
        self.gripper.setText(", ".join(one.Label for one in job.Gripper) or "none")
        self.cell.setText(os.path.basename(job.CellFile) or "none: as below")
        for name in OF_CELL_FILE:
            self.fields[name].setEnabled(not job.CellFile)
        self.fields["WheelName"].setEnabled(bool(job.CellFile))
        busy = self.running is not None
        self.run.setEnabled(not busy)
        self.points.setEnabled(not busy)
        self.stop.setEnabled(busy)
        self.save.setEnabled(job.Status == "ok")
        self.page.setEnabled("report.html" in kept(job, "RunKept"))
        self.moment.setEnabled(motion_of(job) is not None)
        if not busy:
            self.said.setText(verdict(job))

    # a run

    def start(self, task: str) -> None:
        """Ask the service in a thread; of a run its cutter points first."""
        self.job.Document.recompute()
        client = running.service()
        asked = [running.request(self.job, one) for one in ("points", "run")]
        asked = asked if task == "run" else asked[:1]
        self.running = ""
        self.refresh()
        self.said.setText("asked the service ...")
        thread = threading.Thread(target=self._ask, args=(client, asked), daemon=True)
        thread.start()
        self.timer.start(EVERY)

    def _ask(self, client: Any, asked: list[running.Request]) -> None:
        """Ask one after the other; runs in a thread, touches neither document nor window."""
        try:
            for request in asked:
                answer = running.ask(client, request, self.told.put)
                self.told.put((request, answer))
                if answer.job.status != "ok":
                    break
        except ServiceError as error:
            self.told.put(error)
        self.told.put(None)

    def look(self) -> None:
        """Look at what the thread has told."""
        while not self.told.empty():
            news = self.told.get()
            if isinstance(news, RemoteJob):
                self.running = news.id
                self.progress.setValue(round(100 * news.fraction))
                self.said.setText(f"{news.task}: {news.state}, {news.stage.replace('_', ' ')}")
            elif isinstance(news, tuple):
                running.store(self.job, *news)
            elif isinstance(news, ServiceError):
                self.job.Status, self.job.Message = "error", str(news)
            else:
                self.ended()

    def ended(self) -> None:
        """Show what became of a run: its motion, or where it failed."""
        self.timer.stop()
        self.running = None
        self.progress.setValue(100 if self.job.Status in ("ok", "points") else 0)
        self.refresh()
        if self.job.Status == "ok":
            self.show_motion(True)
            if motion := motion_of(self.job):
                self.moment.setValue(round(STEPS * motion.moment_of(0.0) / motion.seconds))
        else:
            self.show_motion(False)

    def cancel(self) -> None:
        """Cancel the run."""
        if self.running:
            running.service().cancel(self.running)

    # what was found

    def show_motion(self, wanted: bool) -> None:
        """Show the cell at a moment of the motion, or the part where it lies in the document."""
        view = motion_view_of(self.job)
        if not isinstance(view.ViewObject.Proxy, CellView):
            CellView(view.ViewObject)
        view.recompute()
        view.ViewObject.Visibility = wanted
        for obj in (self.job.Faces[0] if self.job.Faces else None, self.job, *self.job.Gripper):
            if obj is not None:
                obj.ViewObject.Visibility = not wanted

    def moved(self, value: int) -> None:
        """Show another moment of the motion."""
        motion = motion_of(self.job)
        if motion is None:
            return
        view = motion_view_of(self.job)
        if not view.ViewObject.Visibility:
            self.show_motion(True)
        show_moment(view, motion.seconds * value / STEPS)
        self.where.setText(f"{view.Moment:.2f} s: {view.Where}")

    def ask_folder(self) -> None:
        """Ask where the files go, and write them."""
        folder = QtGui.QFileDialog.getExistingDirectory(self.form, "Folder for the programs")
        if folder:
            self.said.setText("\n".join(running.save_programs(self.job, folder)))

    def open_page(self) -> None:
        """Open the page of the run in the browser."""
        path = os.path.join(tempfile.mkdtemp(prefix="opl_"), "report.html")
        with open(path, "wb") as file:
            file.write(kept(self.job, "RunKept")["report.html"])
        QtGui.QDesktopServices.openUrl(QtCore.QUrl.fromLocalFile(path))

    # what FreeCAD asks of a panel

    def getStandardButtons(self) -> int:
        """Return the only button: Close."""
        return int(QtGui.QDialogButtonBox.Close)

    def reject(self) -> bool:
        """Close the panel; a run goes on at the service, which answers when it is asked again."""
        self.timer.stop()
        FreeCADGui.Control.closeDialog()
        FreeCAD.ActiveDocument.recompute()
        return True


def wrapped() -> Any:
    """Return a label that makes the panel longer, not wider."""
    label = QtGui.QLabel()
    label.setWordWrap(True)
    label.setSizePolicy(QtGui.QSizePolicy.Ignored, QtGui.QSizePolicy.Preferred)
    return label


def verdict(job: Any) -> str:
    """Return what became of a job, in words."""
    if job.Status in ("ok", "points"):
        return f"{'program proven' if job.Status == 'ok' else 'no program yet'}: {job.Figures}"
    if job.Status == "changed":
        return "changed since it was run: run it again"
    place = f" (marked in red: {len(marked(job))} cutter points)" if marked(job) else ""
    return f"{job.Status}: {job.Message}{place}" if job.Status else "not run yet"


def open_panel(job: Any) -> Panel:
    """Open the panel of a job; return it."""
    FreeCADGui.Control.closeDialog()
    panel = Panel(job)
    FreeCADGui.Control.showDialog(panel)
    return panel
