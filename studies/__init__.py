"""What the project measures of itself: benchmarks, two studies, their pages, and the preference kit."""
