"""Planners: whatever turns a frame and a goal into a subgoal."""

from thinknav_server.planners.base import Plan, PlanItem, Planner, PlannerIdentity, View
from thinknav_server.planners.scripted import Script, ScriptedPlanner, load_script

__all__ = [
    "Plan",
    "PlanItem",
    "Planner",
    "PlannerIdentity",
    "Script",
    "ScriptedPlanner",
    "View",
    "load_script",
]
