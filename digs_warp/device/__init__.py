"""The layer below the kernels: threads, launches, compilation, memory layouts, external libraries."""
