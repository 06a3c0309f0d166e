"""Structure from motion: frames -> posed cameras and sparse points (paper section 3.2)."""
