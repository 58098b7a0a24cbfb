"""What FreeCAD runs at the start of its window: the workbench is made known."""

import FreeCADGui


class OplWorkbench(FreeCADGui.Workbench):  # type: ignore[misc]
    """Belt grinding: pick faces, run, see the motion, save programs."""

    MenuText = "Belt grinding"
    ToolTip = "Proven robot programs for belt grinding, by the service of opl"

    def __init__(self) -> None:
        import os

        import opl_workbench

        folder = os.path.dirname(os.path.dirname(opl_workbench.__file__))
        self.__class__.Icon = os.path.join(folder, "icons", "opl.svg")

    def Initialize(self) -> None:
        """Add commands, toolbar and menu when the workbench is first chosen."""
        from opl_workbench.commands import COMMANDS, add_commands

        add_commands()
        self.appendToolbar("Belt grinding", COMMANDS)
        self.appendMenu("Belt grinding", COMMANDS)

    def GetClassName(self) -> str:
        """Return the kind of workbench that FreeCAD knows for those in Python."""
        return "Gui::PythonWorkbench"


FreeCADGui.addWorkbench(OplWorkbench())
