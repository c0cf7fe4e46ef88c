"""Where agents can stand and walk, how far it is to goals, and where goals can be seen from."""

from thinknav_sim.navigation.complexity import navigation_complexity
from thinknav_sim.navigation.geodesic import distance_field, distances_at, shortest_path
from thinknav_sim.navigation.goals import Goal, GoalObject, find_goal
from thinknav_sim.navigation.grid import NavigationGrid
from thinknav_sim.navigation.tables import FieldTable, GridTable

__all__ = [
    "FieldTable",
    "Goal",
    "GoalObject",
    "GridTable",
    "NavigationGrid",
    "distance_field",
    "distances_at",
    "find_goal",
    "navigation_complexity",
    "shortest_path",
]
