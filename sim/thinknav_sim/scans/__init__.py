"""Scans of real homes as scenes: GLB, OBJ, PLY and HM3D folders, with their objects and floors."""

from thinknav_sim.scans.frame import Units, UpAxis
from thinknav_sim.scans.load import Scan, ScanOptions, load_scan
from thinknav_sim.scans.store import write_scene

__all__ = ["Scan", "ScanOptions", "Units", "UpAxis", "load_scan", "write_scene"]
