"""The report of a reconstruction: one HTML file that needs nothing else."""

from digs_warp.report.page import write_report as write_report
