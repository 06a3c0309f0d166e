"""The machine below the kernels: threads, launches, compilation, memory layouts, foreign libraries."""
