"""Turns a run's folder into one page for people. Reads what was logged; measures nothing itself."""

from thinknav_trainer.report.page import write_report

__all__ = ["write_report"]
