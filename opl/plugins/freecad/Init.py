"""What FreeCAD runs at its start, with or without its window: nothing has to be set up."""
