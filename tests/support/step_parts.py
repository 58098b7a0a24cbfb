"""The V part as STEP file: the solid that its surface bounds, from the sizes it is made of."""

import json
from pathlib import Path

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeWire as MakeWire
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.GC import GC_MakeArcOfCircle
from OCP.gp import gp_Pnt, gp_Vec
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

from tests.support.jobs import V_SHAPE


def write_v_step(path: Path) -> Path:
    """Write the V part: flank, tip, flank and a flat bottom, extruded along x."""
    surface = json.loads((V_SHAPE / "surface.json").read_text(encoding="utf-8"))
    rows = np.array(surface["control_points_mm"])
    profile, width = rows[0], float(rows[-1, 0, 0] - rows[0, 0, 0])
    first, left, right, last = (gp_Pnt(*profile[k]) for k in (0, 2, -3, -1))
    apex = gp_Pnt(*profile[len(profile) // 2])  # where the two arcs of the tip meet
    wire = MakeWire()
    for edge in (
        BRepBuilderAPI_MakeEdge(first, left),
        BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(left, apex, right).Value()),
        BRepBuilderAPI_MakeEdge(right, last),
        BRepBuilderAPI_MakeEdge(last, first),
    ):
        wire.Add(edge.Edge())
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    writer = STEPControl_Writer()
    solid = BRepPrimAPI_MakePrism(face, gp_Vec(width, 0.0, 0.0)).Shape()
    writer.Transfer(solid, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    return path
