"""Which reconstruction people prefer: videos side by side, answer sheets, and their evaluation."""
