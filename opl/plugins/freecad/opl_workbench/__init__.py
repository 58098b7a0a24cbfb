"""The workbench of opl for FreeCAD: a part, its faces and a cell in, a proven program out.

Runs in FreeCAD's own Python and knows opl through its service alone, so versions never meet.
"""
