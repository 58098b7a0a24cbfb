"""Key paths of a job file that messages of the rooms above name."""

from __future__ import annotations

NAME = "name"
CLEARANCE = "clearance_mm"

# a YAML file that has one of these keys is a job
OF_A_JOB = frozenset({"workpiece", "wheel", "passes"})

# changes that make a coarse row of the part that comes with opl: enough that all which computes is
# loaded by it
COARSE_EXAMPLE = {
    "passes.rows": 1, "passes.max_chord_error_mm": 0.3, "passes.max_step_mm": 40,
    "search.contact_positions": 15, "search.max_contact_error_mm": 0.5,
    "wheel.max_belt_penetration_mm": 1.0,
}  # fmt: skip

# what holds a list; a list at any other key is a sweep
LISTS = frozenset(
    {
        "T_base_contact0_mm", "T_base_user_mm", "T_flange_tool_mm", "T_flange_workpiece_mm",
        "accept_unverified_pulses", "after_pass", "at_end", "at_mm", "at_start", "axle",
        "before_pass", "bodies", "box_mm", "centre_mm", "cylinder_mm", "faces", "front",
        "home_deg", "joints", "left_edge", "left_side", "max_acceleration_deg_s2", "obstacles",
        "plane_normal", "right_edge", "right_side", "rim", "rotation_deg", "rx_ry_rz_deg",
        "xyz_mm",
    }
)  # fmt: skip

WHEEL_POSE = "wheel.T_base_contact0_mm"
WHEEL_WIDTH = "wheel.width_mm"
WHEEL_MAX_ROLL = "wheel.max_roll_deg"
WHEEL_MAX_BELT_PENETRATION = "wheel.max_belt_penetration_mm"

FIXTURE_POSE = "fixture.T_flange_workpiece_mm"

SURFACE = "workpiece.surface"
PART = "workpiece.mesh"
FACES = "workpiece.faces"

PASSES = "passes"
# by the attribute of `opl.geometry.passes.Passes` that an error names
OF_PASSES = {
    "plane_normal": "passes.plane_normal",
    "pitch": "passes.pitch_mm",
    "max_bow_height": "passes.max_chord_error_mm",
    "largest_step": "passes.max_step_mm",
    "rows": "passes.rows",
    "kind": "passes.kind",
    "repeats": "passes.repeats",
}

SEARCH_CONTACT_POSITIONS = "search.contact_positions"
SEARCH_CONTACT_CHANGE = "search.max_contact_change"
SEARCH_OBJECTIVE = "search.objective"
SEARCH_CONTACT_WEIGHT = "search.weights.contact"

PROCESS_HOME = "process.home_deg"
PROCESS_APPROACH = "process.approach_mm"
PROCESS_FEED = "process.feed_mm_s"
PROCESS_CONTACT_SPEED = "process.max_contact_speed"
PROCESS_MAX_DWELL = "process.max_dwell_s"
PROCESS_MAX_ACCELERATION = "process.max_acceleration_deg_s2"

# by the setting that a `SettingError` names
OF_PROGRAM = {
    "controller": "program.controller",
    "tool": "program.tool",
    "user_frame": "program.user_frame.number",
    "corner_radius": "program.corner_radius_mm",
    "accepted_pulses": "program.accept_unverified_pulses",
    "pulses_per_radian": "program.pulse_ratios",
}
PROGRAM_AT_START = "program.at_start"
PROGRAM_BELT = "program.belt_switched_by"
PROGRAM_CONTROLLER = "program.controller"
PROGRAM_MOTION = "program.motion"
PROGRAM_STATIONARY_TOOL = "program.stationary_tool"
PROGRAM_TOOL_POSE = "program.T_flange_tool_mm"
PROGRAM_PULSE_RATIOS = "program.pulse_ratios"
PROGRAM_ACCEPT_UNVERIFIED_PULSES = "program.accept_unverified_pulses"
