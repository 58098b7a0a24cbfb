"""Fields of the panel, each bound to a property of the job."""

from __future__ import annotations

from typing import Any

import FreeCAD
from PySide import QtGui

# tab, then its fields: property and label
TABS = (
    ("Part", (("JobName", "Name"), ("Flange", "Flange at the part, mm and deg"))),
    ("Cell", (
        ("Robot", "Robot"), ("Clearance", "Clearance, mm"),
        ("ContactFrame", "Contact frame in base, mm and deg"), ("WheelWidth", "Wheel width, mm"),
        ("WheelRadius", "Wheel radius, mm"), ("MaxRoll", "Largest roll, deg"),
        ("MaxBeltPenetration", "Into the belt, mm"), ("WheelName", "Wheel of the cell file"),
    )),
    ("Passes", (
        ("PlaneNormal", "Normal of the planes"), ("Pitch", "Pitch, mm"), ("Rows", "Rows, 0: all"),
        ("Margin", "Margin, mm"), ("EndMargin", "Left out at ends, mm"), ("Order", "Order"),
        ("MaxChordError", "Chord error, mm"), ("MaxStep", "Longest step, mm"),
    )),
    ("Process", (
        ("Feed", "Feed, mm/s"), ("Approach", "Approach, mm"), ("ApproachSpeed", "Approach, mm/s"),
        ("FreeMoveSpeed", "Free moves, %"), ("Home", "Home, deg"), ("Method", "Search"),
        ("ContactPositions", "Contact positions"), ("MaxContactStep", "Contact step"),
        ("MaxContactError", "Contact error, mm"), ("Controller", "Controller"),
        ("AcceptUnverifiedPulses", "Accept unverified pulses of"),
    )),
)  # fmt: skip
# of a cell, what a cell file says where there is one; the last is for a cell file only
OF_CELL_FILE = (
    "Robot", "Clearance", "ContactFrame", "WheelWidth", "WheelRadius", "MaxRoll",
    "MaxBeltPenetration",
)  # fmt: skip
LARGEST = 1e6
NARROW = 50  # [px] a field may be, where FreeCAD's column of tasks is narrow


def field(job: Any, name: str) -> Any:
    """Return the widget for a property; a change of one is a change of the other."""
    kind = job.getTypeIdOfProperty(name)
    if kind == "App::PropertyPlacement":
        return _placement(job, name)
    if kind == "App::PropertyEnumeration":
        box = QtGui.QComboBox()
        box.setMinimumWidth(NARROW)
        box.addItems(job.getEnumerationsOfProperty(name))
        box.setCurrentText(getattr(job, name))
        box.currentTextChanged.connect(lambda text: setattr(job, name, text))
        return box
    if kind == "App::PropertyInteger":
        box = QtGui.QSpinBox()
        box.setMinimumWidth(NARROW)
        box.setMaximum(100_000)
        box.setValue(getattr(job, name))
        box.valueChanged.connect(lambda value: setattr(job, name, value))
        return box
    if kind in ("App::PropertyLength", "App::PropertyAngle", "App::PropertyFloat"):
        value = getattr(job, name)
        return _number(float(getattr(value, "Value", value)), lambda to: setattr(job, name, to))
    line = QtGui.QLineEdit(_text(job, name))
    line.editingFinished.connect(lambda: _take(job, name, line))
    return line


def _number(value: float, changed: Any) -> Any:
    box = QtGui.QDoubleSpinBox()
    box.setMinimumWidth(NARROW)
    box.setRange(-LARGEST, LARGEST)
    box.setDecimals(4)
    box.setButtonSymbols(QtGui.QAbstractSpinBox.NoButtons)
    box.setKeyboardTracking(False)
    box.setValue(value)
    box.valueChanged.connect(changed)
    return box


def _placement(job: Any, name: str) -> Any:
    """Return six numbers: x, y, z, and turns about the fixed axes x, y, z."""
    whole = QtGui.QWidget()
    grid = QtGui.QGridLayout(whole)
    grid.setContentsMargins(0, 0, 0, 0)
    now = getattr(job, name)
    yaw, pitch, roll = now.Rotation.toEuler()
    boxes: list[Any] = []

    def changed(_: float) -> None:
        x, y, z, a, b, c = (box.value() for box in boxes)
        setattr(job, name, FreeCAD.Placement(FreeCAD.Vector(x, y, z), FreeCAD.Rotation(c, b, a)))

    for k, value in enumerate((*now.Base, roll, pitch, yaw)):
        box = _number(value, changed)
        box.setToolTip(("x", "y", "z", "roll", "pitch", "yaw")[k])
        boxes.append(box)
        grid.addWidget(box, k // 3, k % 3)
    return whole


def _text(job: Any, name: str) -> str:
    value = getattr(job, name)
    if isinstance(value, str):
        return value
    return ", ".join(f"{one:g}" if isinstance(one, float) else str(one) for one in value)


def _take(job: Any, name: str, line: Any) -> None:
    """Take what was typed; what is no value of the property is put back."""
    words = [word for word in line.text().replace(",", " ").split() if word]
    kind = job.getTypeIdOfProperty(name)
    try:
        if kind == "App::PropertyString":
            setattr(job, name, line.text().strip())
        elif kind == "App::PropertyStringList":
            setattr(job, name, words)
        elif kind == "App::PropertyVector":
            x, y, z = map(float, words)
            setattr(job, name, FreeCAD.Vector(x, y, z))
        else:
            setattr(job, name, [float(word) for word in words])
    except ValueError:
        line.setText(_text(job, name))
