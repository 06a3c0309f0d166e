"""The report of a reconstruction: one self-contained HTML file."""

from digs_warp.show.report.page import write_report as write_report
